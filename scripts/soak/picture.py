"""Memory of all processes over the time of a ride."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from energy_monitor.report.figures import NODES
from energy_monitor.report.style import INK, MUTED, RC, WIDTH, extent, legend_above
from soak.judge import column, quantity, settling, times
from soak.looks import Sample


def draw(samples: Sequence[Sample], processes: Sequence[str], path: Path) -> None:
    """Draw resident memory, its change since the ride settled, and what is shared, into a PNG file."""
    import matplotlib
    from matplotlib.figure import Figure

    end = float(times(samples)[-1])
    settled = settling(end)
    with matplotlib.rc_context(RC):
        drawing = Figure(figsize=(WIDTH, 6.4), dpi=110)
        upper, middle, lower = drawing.subplots(3, 1, sharex=True)
        for process in processes:
            time, resident = quantity(samples, process, "resident")
            if not len(time):
                continue
            style = {"color": NODES.get(process, INK), "linewidth": 1.1, "label": process}
            upper.plot(time, resident / 1024.0, **style)
            after = time >= settled
            if after.any():
                middle.plot(time[after], resident[after] - resident[after][0], **style)
            lower.plot(*_mib(quantity(samples, process, "shared")), **style)
        time, segments = column(samples, lambda one: None if one.segments is None else one.segments / 1024.0)
        lower.plot(*_mib((time, segments)), color=MUTED, linewidth=1.1, linestyle="--", label="all segments")
        for axes in (upper, middle, lower):
            axes.axvspan(0.0, settled, color="#EFEFEF", linewidth=0, zorder=0)
        upper.set_title("Resident memory")
        upper.set_ylabel("MiB")
        middle.set_title("Its change since the ride had settled")
        middle.set_ylabel("KiB")
        lower.set_title("Shared memory of the middleware, touched by each process")
        lower.set_ylabel("MiB")
        lower.set_xlabel("time in s")
        extent(upper, 0.0, end)
        legend_above(upper, 5)
        drawing.savefig(path)


def _mib(found: tuple[object, object]) -> tuple[object, object]:
    time, values = found
    return time, values / 1024.0  # type: ignore[operator]
