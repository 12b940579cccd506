"""Figures of a ride that was not recorded: the monitor's last ones."""

from __future__ import annotations

from rich.table import Table

from ride.watch import Watch


def live_summary(watch: Watch, seconds: float) -> Table:
    """Make a table of what the monitor said last; ``seconds`` is the ride's wall time."""
    table = Table(title="the ride, as the monitor saw it", show_header=False)
    add = table.add_row
    add("simulated time", f"{watch.ridden:.2f} s")
    if seconds > 0.0:
        add("wall time", f"{seconds:.2f} s ({watch.ridden / seconds:.2f} times real time)")
    if watch.quality is not None:
        quality = watch.quality
    if watch.quality is not None and not quality.samples:
        add("contact force, 20 Hz", "not evaluated: the ride is not longer than its run-in")
    elif watch.quality is not None:
        add("contact force, 20 Hz", f"mean {quality.mean:.1f} N, sigma {quality.sigma:.1f} N")
        add("", f"minimum {quality.minimum:.1f} N, maximum {quality.maximum:.1f} N")
        add("loss of contact", f"{100.0 * quality.loss_share:.3f} % of the time")
    if watch.books is not None:
        books = watch.books
        share = abs(books.delta_e) / books.exchanged_energy if books.exchanged_energy else 0.0
        of = f"{100.0 * share:.3f} % of {books.exchanged_energy:.1f} J exchanged"
        add("energy error", f"{books.delta_e:+.4f} J, {of}")
        add("momentum error", f"{books.delta_p:+.3f} N s of {books.exchanged_momentum:.0f} N s")
    if watch.rig_timing is not None:
        add("late cycles", str(watch.rig_timing.late))
    for name, text in {**watch.warnings, **watch.errors}.items():
        add(name, text)
    return table
