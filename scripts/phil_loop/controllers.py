"""What commands the drive: our controller, or one of a user's own in its place."""

from __future__ import annotations

from typing import Protocol

from impedance_mpc.books import Books
from impedance_mpc.controller import Command, EnvironmentReading, RigReading
from impedance_mpc.cycle import Answer
from phil_base.enumerations import FOLLOWING


class Controller(Protocol):
    """A controller of a user's own; see docs/library.md for one in twenty lines."""

    def command(self, rig: RigReading, wire: EnvironmentReading, following: bool) -> Command:
        """Give the command of cycle k from rig and wire at t_k.

        It has to set ``u_tr`` and ``u_tr_next``, the references (m) at t_k and t_(k+1), and ``f_cat``, the force (N)
        that is to act on the catenary at t_(k+1). ``following``: the rig did as it was told until t_k; if not, it
        approaches, holds, lands or retracts, and nothing that the command says moves it. The arrays of ``wire`` are
        views that the next cycle overwrites.
        """

    def reset(self) -> None:
        """Forget everything: the next command is that of cycle 0."""


class Commander(Protocol):
    """What the loop asks for commands."""

    books: Books

    def answer(self, rig: RigReading, wire: EnvironmentReading, mode: int) -> Answer:
        """Give the command of cycle k; ``mode`` is that of the rig."""

    def reset(self) -> None:
        """Go back to before cycle 0."""


class Own:
    """A user's controller as the loop asks it: its commands, and the books that our controller keeps itself.

    Raises
    ------
    TypeError
        It has no ``command`` or no ``reset``.
    """

    def __init__(self, controller: Controller, ts: float) -> None:
        for name in ("command", "reset"):
            if not callable(getattr(controller, name, None)):
                raise TypeError(f"controller = {controller!r} has no method '{name}' (command and reset are needed)")
        self.controller = controller
        self.books = Books(ts)

    def reset(self) -> None:
        """Clear the books, and reset the controller."""
        self.books.clear()
        self.controller.reset()

    def answer(self, rig: RigReading, wire: EnvironmentReading, mode: int) -> Answer:
        """Enter the instant into the books, then ask the controller."""
        following, books = mode in FOLLOWING, self.books
        if following:
            books.add(rig.f_tr, rig.v_tr, wire.f, wire.v)
        books.accumulate(rig.work, wire.work, rig.impulse, wire.impulse, counted=following)
        c = self.controller.command(rig, wire, following)
        return Answer(
            c.u_tr, c.u_tr_next, rig.f_tr, c.f_predicted, c.f_cor, c.f_cat, c.f_cor_lower, c.f_cor_upper,
            c.correction, 0, c.status, c.iterations, c.fallbacks, wire.w, wire.v,
        )  # fmt: skip
