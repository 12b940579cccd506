"""What is measured: the catenary's step, long lines, the controller's cycle (the whole loop: `realtime`)."""

from __future__ import annotations

from collections.abc import Callable

from bench.outcome import Outcome


def catenary(quick: bool) -> Outcome:
    """Time the catenary's step: distribution, spans, phases, competitors."""
    from bench.catenary import run

    return run(quick)


def lines(quick: bool) -> Outcome:
    """Time and memory from the file of a long line to a model at rest; statics against the dense way."""
    from bench.lines import run

    return run(quick)


def mpc(quick: bool) -> Outcome:
    """Time a whole cycle of the controller over segment, horizon and moves; its parts; its solver against others."""
    from bench.mpc import run

    return run(quick)


BENCHES: dict[str, Callable[[bool], Outcome]] = {"catenary": catenary, "lines": lines, "mpc": mpc}
