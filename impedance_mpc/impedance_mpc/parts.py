"""What a controller is put together from, by name: a bench may give others, with a clock in them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from impedance_mpc import correction, prepare
from impedance_mpc.books import Books
from impedance_mpc.solver import SolverMaker, solver_of


class Parts(NamedTuple):
    """Functions of one cycle, and makers of what keeps a state; each takes and gives what the default one does."""

    solver: SolverMaker = solver_of
    """Makes what solves the quadratic programs."""
    books: Callable[[float], Books] = Books
    """Makes the books, from Ts in s."""
    force_ahead: Callable[..., Any] = prepare.force_ahead_held
    """Notes both states, carries the plan on, and gives the contact force predicted for t_(k+1)."""
    prepare: Callable[..., Any] = prepare.prepare_held
    """Fills in gradient and bounds of the program."""
    bounds: Callable[..., tuple[float, float, int]] = correction.bounds
    """Bounds of the correction force, and their case."""


PARTS = Parts()
"""Those of every ride."""
