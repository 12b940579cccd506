"""Uniform mesh in the frame of the track."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.elements import shape_derivatives
from catenary_model.line import Line

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TrackMesh:
    """Equal elements from one mast of the line to a later one."""

    start: float
    """Track position of the first node, m."""
    h: float
    """Element length, m."""
    elements: int
    """Number of elements."""

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return self.elements + 1

    @property
    def end(self) -> float:
        """Track position of the last node, m."""
        return self.start + self.h * self.elements

    @property
    def zeta(self) -> Array:
        """Track positions of the nodes, m, (nodes,)."""
        return self.start + self.h * np.arange(self.nodes, dtype=np.float64)

    def locate(self, zeta: float) -> tuple[int, Array]:
        """Return the element that holds track position zeta (m) and its shape functions there, (4,).

        Raises ValueError outside the mesh; a position on the very end belongs to the last element.
        """
        at = (zeta - self.start) / self.h
        if not -1e-9 <= at <= self.elements + 1e-9:
            raise ValueError(f"zeta = {zeta} m is not between {self.start} and {self.end} m")
        e = min(max(int(at), 0), self.elements - 1)
        return e, shape_derivatives(np.array([at - e]), self.h)[0][:, 0]


def span_start(line: Line, span: int) -> float:
    """Track position of the mast at the beginning of a span of any running number (also negative), m."""
    repeat, which = divmod(span, len(line.spans))
    return repeat * line.period + line.span_starts[which]


def mesh_spans(line: Line, first_span: int, spans: int, element_length: float) -> TrackMesh:
    """Mesh `spans` spans from running number `first_span` on; the element is shortened to fit a whole number in.

    Raises ValueError if there is not at least one span, or fewer than eight elements.
    """
    if spans < 1:
        raise ValueError(f"spans = {spans} must be at least 1")
    start, end = span_start(line, first_span), span_start(line, first_span + spans)
    elements = math.ceil((end - start) / element_length - 1e-9)
    if elements < 8:
        raise ValueError(f"element_length = {element_length} m leaves fewer than 8 elements")
    return TrackMesh(start, (end - start) / elements, elements)
