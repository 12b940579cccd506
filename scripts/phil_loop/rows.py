"""Rows of a ride as it goes: written in place, cycle by cycle, and turned into columns at the end."""

from __future__ import annotations

from collections.abc import Mapping
from struct import Struct
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from impedance_mpc.cycle import Answer
from phil_loop.record import (
    BookColumns,
    CommandColumns,
    RampColumns,
    Record,
    RigColumns,
    TimeColumns,
    TrueColumns,
    WireColumns,
)
from test_rig_sim.rig import RigSample
from test_rig_sim.supervisor import Ramp

Floats = NDArray[np.float64]
C = TypeVar("C")

POINT = ("w_cat", "v_cat", "a_cat", "f_cat", "track_position", "work", "impulse")
"""What `catenary_model.layout` has of the contact point, in its order."""
FIRST, BEHIND = 5, 8
"""Droppers, slack droppers and iterations in the catenary's counters."""
BESIDE = ("companion_place", "companion_force", "companion_height", "companion_loss")
"""What `catenary_model.companions` has of further pantographs, in its order."""
COUNTED = ("droppers", "slack_droppers", "iterations")
MOST_ITERATIONS = 255
"""What the message's number of iterations goes to."""
TOTALS = tuple(BookColumns.__dataclass_fields__)
ANSWER, BOOKS = Struct(f"{len(Answer._fields)}d"), Struct(f"{len(TOTALS)}d")


class Rows:
    """A block of memory for each source of numbers, for so many cycles; one that lasts longer gets more."""

    def __init__(self, cycles: int, companions: int = 0) -> None:
        self._made, self._companions = 0, companions
        self._room(max(cycles, 1))

    def _room(self, cycles: int) -> None:
        """Have room for so many cycles, with what is there already."""
        blocks = {
            "mode": np.zeros(cycles, np.int64),
            "signals": np.zeros((cycles, len(RigSample._fields))),
            "point": np.zeros((cycles, len(POINT))),
            "counter": np.zeros((cycles, len(COUNTED)), np.int64),
            "answer": np.zeros((cycles, len(Answer._fields))),
            "totals": np.zeros((cycles, len(TOTALS))),
            "ramp": np.full((cycles, 2), np.nan),
            "times": np.zeros((cycles, 3)),
            "beside": np.zeros((cycles, self._companions, len(BESIDE))),
        }
        if self._made:
            for name, block in blocks.items():
                block[: self._made] = getattr(self, f"_{name}")[: self._made]
        self._size = cycles
        self._mode, self._signals, self._point, self._counter = (blocks[n] for n in tuple(blocks)[:4])
        self._answer, self._totals, self._ramp, self._times, self._beside = (blocks[n] for n in tuple(blocks)[4:])
        self._answers, self._books = self._answer.data.cast("B"), self._totals.data.cast("B")

    def note(
        self, k: int, mode: int, signals: Floats, point: Floats, counter: NDArray[np.int64], answer: Answer,
        totals: tuple[float, ...],
    ) -> None:  # fmt: skip
        """Note cycle k: both states at t_k, the command, and the books after it."""
        if k >= self._size:
            self._room(2 * self._size)
        self._made = k + 1
        self._mode[k] = mode
        self._signals[k] = signals
        self._point[k] = point
        self._counter[k] = counter[FIRST:BEHIND]
        ANSWER.pack_into(self._answers, k * ANSWER.size, *answer)
        BOOKS.pack_into(self._books, k * BOOKS.size, *totals)

    def accompany(self, k: int, companions: Floats) -> None:
        """Note the further pantographs at t_k."""
        self._beside[k] = companions[:, : len(BESIDE)]

    def moved(self, k: int, ramp: Ramp) -> None:
        """Note what the drive followed from t_k on."""
        self._ramp[k] = ramp

    def time(self, k: int, controller: int, catenary: int, rig: int) -> None:
        """Note what the parts took for cycle k, ns."""
        self._times[k] = controller, catenary, rig

    def record(
        self, ts: float, outcome: str, reason: str, settings: Mapping[str, Mapping[str, Any]], timed: bool
    ) -> Record:
        """Give all cycles as columns."""
        n = self._made
        shown = dict(zip(RigSample._fields, np.ascontiguousarray(self._signals[:n].T), strict=True))
        wire = dict(zip(POINT, np.ascontiguousarray(self._point[:n].T), strict=True))
        counted = dict(zip(COUNTED, np.ascontiguousarray(self._counter[:n].T), strict=True))
        np.minimum(counted["iterations"], MOST_ITERATIONS, out=counted["iterations"])
        beside = dict(zip(BESIDE, np.ascontiguousarray(self._beside[:n].transpose(2, 0, 1)), strict=True))
        answer = dict(zip(Answer._fields, np.ascontiguousarray(self._answer[:n].T), strict=True))
        totals = dict(zip(TOTALS, np.ascontiguousarray(self._totals[:n].T), strict=True))
        return Record(
            ts=ts,
            rig=_columns(RigColumns, shown | {"mode": self._mode[:n].copy()}),
            true=_columns(TrueColumns, shown),
            wire=_columns(WireColumns, wire | counted | beside),
            command=_columns(CommandColumns, answer),
            ramp=RampColumns(*np.ascontiguousarray(self._ramp[:n].T)),
            books=_columns(BookColumns, totals),
            outcome=outcome,
            reason=reason,
            settings=settings,
            times=TimeColumns(*np.ascontiguousarray(1e-9 * self._times[:n].T)) if timed else None,
        )


def _columns(kind: type[C], found: Mapping[str, NDArray[Any]]) -> C:
    """Make columns of a kind from those that have its fields' names; whole numbers where it wants them."""
    fields: dict[str, Any] = kind.__dataclass_fields__  # type: ignore[attr-defined]
    return kind(
        **{
            name: found[name].astype(np.int64, copy=False) if entry.type == "Whole" else found[name]
            for name, entry in fields.items()
        }
    )
