"""Messages of one cycle of a stream that came more than once: which one counts, and what to say of the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag import Table
from energy_monitor.bag_channel import left_out

APART = 500_000_000
"""Log time in ns by which a message is so far from its neighbours that one that is near them counts instead."""


def unique(table: Table) -> Table:
    """Sort by cycle number and keep one message of each cycle.

    It is the first, unless that one was recorded far from the cycles around it, as one that was left from before the
    ride, and another one was not.
    """
    cycle, first, count = np.unique(table["cycle"], return_index=True, return_counts=True)
    if len(cycle) == len(table):
        return table if np.all(np.diff(first) == 1) else table.take(first)
    single = np.flatnonzero(count == 1)
    if len(single):
        expected = np.interp(table.real("cycle"), cycle[single].astype(np.float64), table.log_time[first[single]])
        far = np.abs(table.log_time - expected)
        at = np.searchsorted(cycle, table["cycle"])
        nearest = np.lexsort((far, at))[np.searchsorted(np.sort(at), np.arange(len(cycle)))]
        first = np.where(far[first] > far[nearest] + APART, nearest, first)
    return table.take(first)


def repeated(table: Table) -> list[str]:
    """Say which cycles of a stream came more than once: again, or with other values.

    The catenary's first and last state may come again: it repeats them until it is heard.
    """
    cycle = table["cycle"].astype(np.int64)
    order = np.argsort(cycle, kind="stable")
    number = cycle[order]
    again = np.flatnonzero(np.diff(number) == 0) + 1
    if not len(again):
        return []
    before = np.searchsorted(number, number[again])
    alike = np.ones(len(again), np.bool_)
    for name, column in table.columns.items():
        if isinstance(column, np.ndarray) and not name.startswith("header."):
            one, other = column[order[before]], column[order[again]]
            alike &= (one == other) | ((one != one) & (other != other))
    notes = []
    usual = (
        np.isin(number[again], number[[0, -1]]) if table.msgtype == "CatenaryState" else np.zeros(len(again), np.bool_)
    )
    if same := int((alike & ~usual).sum()):
        notes.append(left_out(same, table.topic, "the bag holds the same message twice"))
    if not alike.all():
        where = ", ".join(ranges(np.unique(number[again[~alike]]), 3))
        why = f"the bag holds another one with other values for the same cycle ({where}), as of two publishers"
        notes.append(left_out(int((~alike).sum()), table.topic, why))
    return notes


def ranges(numbers: NDArray[np.int64] | list[int], most: int = 20) -> list[str]:
    """Write sorted cycle numbers as ranges ("7", "12..15"), `most` of them and a remark for the rest."""
    array = np.asarray(numbers, dtype=np.int64)
    if len(array) == 0:
        return []
    groups = np.split(array, np.flatnonzero(np.diff(array) > 1) + 1)
    texts = [str(g[0]) if len(g) == 1 else f"{g[0]}..{g[-1]}" for g in groups[:most]]
    if len(groups) > most:
        texts.append(f"and {len(groups) - most} more")
    return texts
