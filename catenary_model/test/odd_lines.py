"""Lines for the tests of statics."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from catenary_model.line import DROPPERS_3_1, Dropper, Line, Mast, Span, SteadyArm

Array = NDArray[np.float64]


def with_lengths(line: Line, lengths: Array | list[float | None]) -> Line:
    """The line with these unstressed lengths (None: computed), in the order of its droppers."""
    values = iter(lengths)
    spans = tuple(
        dataclasses.replace(
            span,
            droppers=tuple(
                dataclasses.replace(d, length=None if (x := next(values)) is None else float(x)) for d in span.droppers
            ),
        )
        for span in line.spans
    )
    return dataclasses.replace(line, spans=spans)


def uneven_line() -> Line:
    """Three different spans with everything a line can have."""
    first = Span(
        50.0, tuple(Dropper(at, 8e4, 0.6) for at in (5.0, 14.0, 23.0, 31.0, 38.0, 45.0)), 0.025, Mast(4e5, 1.4)
    )
    second = Span(60.0, tuple(Dropper(at, mass=0.4) for at in DROPPERS_3_1), 0.0, Mast(6e5, 1.3), SteadyArm(250.0, 1.0))
    third = Span(43.5, tuple(Dropper(at) for at in (4.5, 12.0, 20.0, 28.0, 36.5)), 0.01, Mast(5e5, 1.5))
    return Line(spans=(first, second, third))
