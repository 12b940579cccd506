"""Clamped ends, w = w_x = 0 (3.7): reflects everything, the worst choice and the yardstick of the others."""

from __future__ import annotations

from catenary_model.boundary.layer import Layer
from catenary_model.moving_frame import MovingFrame


def clamped(frame: MovingFrame, layer: Layer) -> None:
    """Hold displacement and rotation of both wires at both ends."""
    last = 4 * (frame.mesh.stations - 1)
    for station, inward in ((0, 1), (last, -1)):
        for row in range(station, station + 4):
            for matrix in (frame.mass, frame.damping, frame.stiffness):
                matrix[row, :] = 0.0
                # the neighbour's columns that point to this row
                neighbour = station + 4 * inward + 2 * ((row - station) // 2)
                column = (2 - 2 * inward) + row % 2
                matrix[neighbour : neighbour + 2, column] = 0.0
            frame.mass[row, 2 + row % 2] = 1.0
