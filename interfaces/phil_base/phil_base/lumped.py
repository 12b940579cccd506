"""Pantographs as chains of masses, from their sources: the one place of their numbers for rig, catenary, studies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Lumped:
    """Chain of masses from the frame to the head: mass i hangs on mass i - 1 (mass 0: on the car body)."""

    masses: tuple[float, ...]
    """kg."""
    springs: tuple[float, ...]
    """N/m."""
    dashpots: tuple[float, ...]
    """N s/m."""
    source: str
    """Where the numbers stand, and how they were had."""

    @property
    def damping(self) -> list[list[float]]:
        """D of the chain, N s/m, (n, n)."""
        return tridiagonal(self.dashpots)

    @property
    def stiffness(self) -> list[list[float]]:
        """K of the chain, N/m, (n, n)."""
        return tridiagonal(self.springs)


def tridiagonal(links: Sequence[float]) -> list[list[float]]:
    """Matrix of a chain whose link i joins bodies i - 1 and i, the first one the ground; (n, n), unit of the links."""
    matrix = [[0.0] * len(links) for _ in links]
    for i, link in enumerate(links):
        matrix[i][i] += link
        if i > 0:
            matrix[i - 1][i - 1] += link
            matrix[i][i - 1] -= link
            matrix[i - 1][i] -= link
    return matrix


LUMPED = {
    "en50318": Lumped((15.0, 7.2), (50.0, 4200.0), (90.0, 10.0), "reference pantograph of EN 50318:2002"),
    "three_mass": Lumped(
        (6.0, 9.0, 7.5),
        (160.0, 15500.0, 7000.0),
        (100.0, 0.1, 0.1),
        "generic high-speed pantograph; masses and springs are those of the AC simple benchmark, read in public code",
    ),
    "benchmark": Lumped(
        (6.0, 9.0, 7.5),
        (160.0, 15500.0, 7000.0),
        (100.0, 0.1, 45.0),
        "pantograph of the AC simple benchmark; masses and springs read in public code (github.com/vivek-nexus/"
        "pantograph-catenary-model-ui, commit 72611a6), dampers from memory, unverified: that code has none",
    ),
    "dsa380": Lumped(
        (5.80, 6.00, 7.12),
        (0.1, 14100.0, 9430.0),
        (70.0, 0.0, 0.0),
        "DSA380, second-hand: two public sources (one of them public code) have the same numbers, neither the maker's",
    ),
    "dsa250": Lumped(
        (4.645, 5.855, 7.51),
        (80.0, 6200.0, 8380.0),
        (70.0, 0.0, 0.0),
        "DSA250, second-hand: public code, one source",
    ),
}
"""By the name under which rig and catenary know them."""
