"""Finite-horizon quadratic cost (3.38) and its minimiser, linear in what is to be corrected (3.39)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary.control_design.segment import Segment

Array = NDArray[np.float64]


def free_response(segment: Segment, outputs: int, horizon: int, states: Array) -> Array:
    """Return y of steps 1 .. horizon without input from each column of states, (horizon, outputs, columns)."""
    y = np.empty((horizon, outputs, states.shape[1]))
    for step in range(horizon):
        states = segment.A @ states
        y[step] = states[:outputs]
    return y


def forced_response(segment: Segment, outputs: int, inputs: int, horizon: int, moves: int) -> Array:
    """Return G, (horizon outputs, moves inputs): y = free + G u, the last move held to the end of the horizon."""
    impulse = np.empty((horizon, outputs, inputs))
    state = segment.B[:, :inputs]
    for step in range(horizon):
        impulse[step] = state[:outputs]
        state = segment.A @ state
    G = np.zeros((horizon, outputs, moves, inputs))
    for step in range(horizon):
        for at in range(step + 1):
            G[step, :, min(at, moves - 1)] += impulse[step - at]
    return G.reshape(horizon * outputs, moves * inputs)


def first_move(G: Array, error: Array, output_weight: Array, input_weight: Array, effort: float) -> Array:
    """Return u_k that minimises (3.38) for each column of y_ref - y_free, (inputs, columns).

    Q_ABC and R_ABC are diagonal, the squares of the weights; R_ABC is scaled so that effort = 1 weighs inputs like
    what they do. error has the rows of G; output_weight and input_weight are those of one step.
    """
    outputs, inputs = output_weight.size, input_weight.size
    Q = np.tile(output_weight**2, G.shape[0] // outputs)
    R = np.tile(input_weight**2, G.shape[1] // inputs)
    hessian = (G.T * Q) @ G
    R *= effort * np.trace(hessian) / R.sum()
    return np.asarray(np.linalg.solve(hessian + np.diag(R), (G.T * Q) @ error)[:inputs])
