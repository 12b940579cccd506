"""One push on a line, seen from a train and at rest: what both discretisations must show alike."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from catenary_model.line import CONTACT_3_1, Dropper, Line, Span, SteadyArm
from catenary_model.observed import MovingCatenary

FREE = Line(carrier=CONTACT_3_1, spans=(Span(60.0, ()),), name="free wires")
HEAVY = Line(
    spans=(
        Span(
            50.0, tuple(Dropper(x, mass=0.4) for x in (5.0, 15.0, 25.0, 35.0, 45.0)), steady_arm=SteadyArm(300.0, 0.5)
        ),
        Span(
            60.0, tuple(Dropper(x, mass=0.4) for x in (5.0, 17.0, 30.0, 43.0, 55.0)), steady_arm=SteadyArm(300.0, 0.5)
        ),
    ),
    name="masses",
)

M = TypeVar("M", bound=MovingCatenary)


def pulse(t: float, length: float = 0.1) -> float:
    """A smooth push of `length` s, N."""
    return 100.0 * np.sin(np.pi * t / length) ** 2 if 0.0 < t < length else 0.0


def difference(
    make: Callable[[float, float], M],
    push_at: Callable[[M, float, float], None],
    look_at: Callable[[M, float], float],
    speed: float,
) -> float:
    """Push at a fixed point of the line, cycles of 1 ms, seen from a train of this speed (m/s) and at rest.

    Rms of the difference over rms of the motion, observed where it is pushed and 12.3 m on, for 0.5 s, before anything
    comes back from the ends. `make` builds a catenary for speed and start position; `push_at` and `look_at` take a
    place relative to the pantograph, m.
    """
    pushed, seen = 97.3, (97.3, 109.6)
    records = []
    for v, start in ((0.0, 90.0), (speed, 90.0 - 0.22 * speed)):
        catenary = make(v, start)
        w = []
        for k in range(1, 501):
            zeta = start + v * 0.001 * k
            push_at(catenary, pushed - zeta, pulse(k * 0.001, 0.15))
            catenary.step(0.0)
            w.append([look_at(catenary, at - zeta) for at in seen])
        records.append(np.array(w))
    still, moving = records
    rms = np.sqrt(np.mean((moving - still) ** 2, axis=0)) / np.sqrt(np.mean(still**2, axis=0))
    return float(rms.max())
