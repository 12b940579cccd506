"""What the nodes themselves reported, held against the numbers recomputed from the bag."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from energy_monitor.bag import Bag, Table
from energy_monitor.contact_quality import contact_quality_of
from energy_monitor.report.alignment import last_ride, unique
from energy_monitor.report.results import Agreement, Series
from energy_monitor.topics import AUDITED, BELIEVED, CONTACT_QUALITY

BOOKKEEPERS = {"energy_monitor": AUDITED, "impedance_mpc": BELIEVED}
"""Nodes that keep books of energy and momentum, and where they publish them."""

_ENERGY = ("e_tr", "e_cat", "delta_e", "exchanged_energy", "work_tr", "work_cat", "delta_work")
_MOMENTUM = ("p_tr", "p_cat", "delta_p", "exchanged_momentum", "impulse_tr", "impulse_cat")
_QUALITY = ("mean", "sigma", "minimum", "maximum")


def own_books(bag: Bag) -> Mapping[str, Table]:
    """Give the books that each bookkeeper published, of the last ride, by node."""
    found = {node: bag.find(topic, "ConservedQuantities") for node, topic in BOOKKEEPERS.items()}
    return {node: unique(last_ride(table)) for node, table in found.items() if table is not None}


def books(series: Series, bag: Bag, until: int | None = None) -> list[Agreement]:
    """Compare each bookkeeper's sums with the recomputed ones at the same cycles, those before `until` if it is given.

    Where the recording began later than the ride, the increments since the first common cycle are compared.
    """
    found = []
    for node, table in own_books(bag).items():
        cycle, ours, theirs = np.intersect1d(
            series.cycle, table["cycle"].astype(np.int64), assume_unique=True, return_indices=True
        )
        if until is not None:
            kept = cycle < until
            cycle, ours, theirs = cycle[kept], ours[kept], theirs[kept]
        if len(cycle) == 0:
            continue
        differences = {}
        for name in _ENERGY + _MOMENTUM:
            apart = getattr(series, name)[ours] - table.real(name)[theirs]
            if series.cycle[0] > 0:
                apart = apart - apart[0]
            differences[name] = float(np.abs(apart).max())
        share = max(
            max(differences[name] for name in _ENERGY) / max(float(series.exchanged_energy[-1]), 1e-9),
            max(differences[name] for name in _MOMENTUM) / max(float(series.exchanged_momentum[-1]), 1e-9),
        )
        found.append(Agreement(node, len(cycle), differences, share))
    return found


def contact_quality(
    series: Series, bag: Bag, ts: float, loss_threshold: float, cutoff: float, order: int, loss_duration: float = 0.0
) -> list[Agreement]:
    """Compare the monitor's last contact-force statistics with the recomputed ones up to the same cycle.

    The monitor's run-in is taken from its number of samples. Empty if the bag lacks the statistics or some cycle.
    """
    table = bag.find(CONTACT_QUALITY, "ContactQuality")
    if table is None:
        return []
    table = unique(last_ride(table))
    table = table.take((table["samples"] > 0) & (table["cycle"] <= series.cycle[-1]))
    if len(table) == 0 or series.cycle[0] != 0 or series.cycle[-1] != len(series.cycle) - 1:
        return []
    count = int(table["cycle"][-1]) + 1
    run_in = (count - int(table["samples"][-1])) * ts
    ours = contact_quality_of(series.f_tr[:count], ts, run_in, loss_threshold, cutoff, order, loss_duration)
    differences = {name: abs(float(table[name][-1]) - getattr(ours, name)) for name in _QUALITY}
    share = max(differences.values()) / max(abs(ours.mean), 1e-9)
    differences["loss_share"] = abs(float(table["loss_share"][-1]) - ours.loss_share)
    source = "energy_monitor, contact quality"
    return [Agreement(source, 1, differences, max(share, differences["loss_share"]))]
