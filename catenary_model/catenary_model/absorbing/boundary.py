"""Boundary stencils: the unknowns of the design (thesis Figure 3.3, blue), and the file that keeps them."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from catenary_model.absorbing.stencil import Array, Stencil
from phil_base.atomic import write_text

FORMAT = "absorbing-boundary-1"


@dataclass(frozen=True, eq=False)
class BoundaryStencil:
    """Explicit update of the nodes at one side that the interior scheme cannot reach.

    Node p (0 is the outermost one) gets, with k counted from the boundary into the domain at either side,

        w[p, n + 1] = sum_{l, k} coefficients[p, l, k] w[k, n + 1 - l],

    so level l = 0 is the new one and l = 1 the present one. On the new level only k > p may appear: the interior is
    updated first, then the boundary nodes from the inner one outwards. A right boundary counts the same way, mirrored:
    its k is the node N - 1 - k.

    Attributes:
        coefficients: shape (nodes, 1 + N_t, N_x) in one dimension, (nodes, 1 + N_t, N_x, N_y) in two, where the
            last axis is centred: entry m reads the node m - N_y // 2 along the boundary, N_y odd.
        side: "left" (low index) or "right" (high index).
        axis: of the normal, 0 unless the domain has more dimensions.
    """

    coefficients: Array
    side: str = "left"
    axis: int = 0

    def __post_init__(self) -> None:
        """Check shape and causality."""
        c = np.asarray(self.coefficients, float)
        if c.ndim < 3 or c.shape[1] < 2:
            raise ValueError(f"coefficients have shape (nodes, 1 + N_t, N_x[, N_y]) with N_t >= 1, not {c.shape}")
        if self.side not in ("left", "right"):
            raise ValueError(f'side is "left" or "right", not {self.side!r}')
        if any(width % 2 == 0 for width in c.shape[3:]):
            raise ValueError("the number of nodes along the boundary must be odd: it is centred")
        if not np.all(np.isfinite(c)):
            raise ValueError("coefficients of a boundary are finite numbers")
        if np.any(c[~unknowns(c.shape)]):
            raise ValueError("node p may only use new values (level 0) of nodes k > p: the update would be implicit")
        object.__setattr__(self, "coefficients", c)

    @property
    def nodes(self) -> int:
        """Number of boundary nodes."""
        return int(self.coefficients.shape[0])

    @property
    def n_t(self) -> int:
        """Number of old time levels."""
        return int(self.coefficients.shape[1]) - 1

    @property
    def n_x(self) -> int:
        """Number of nodes along the normal."""
        return int(self.coefficients.shape[2])

    def mirrored(self) -> BoundaryStencil:
        """Return the same coefficients at the other side: right for a PDE that is symmetric in space."""
        return replace(self, side="right" if self.side == "left" else "left")

    def names(self) -> list[str]:
        """Names of the coefficients that may differ from zero, in the order of `coefficients[unknowns(shape)]`."""
        return [
            f"c[{p}]: " + ("w_n+1" if level == 0 else "w_n" if level == 1 else f"w_n-{level - 1}") + f", node {list(k)}"
            for p, level, *k in np.argwhere(unknowns(self.coefficients.shape)).tolist()
        ]


def unknowns(shape: tuple[int, ...], new_level: bool = True) -> npt.NDArray[np.bool_]:
    """Mask of the coefficients that an explicit boundary may use.

    Args:
        shape: of the coefficients, (nodes, 1 + N_t, N_x[, N_y]).
        new_level: whether new values of inner neighbours may appear at all.
    """
    mask = np.ones(shape, bool)
    for p in range(shape[0]):
        mask[p, 0, : (p + 1 if new_level else shape[2])] = False
    return mask


def clamped(stencil: Stencil, side: str = "right", axis: int = 0) -> BoundaryStencil:
    """Boundary whose nodes stay at zero: w = w' = 0 (3.7) for a beam, w = 0 for a string."""
    nodes = max(1, stencil.nodes_at(side, axis))
    return BoundaryStencil(np.zeros((nodes, 2, nodes, *(1,) * (stencil.dims - 1))), side, axis)


def write_file(path: Path, stencil: Stencil, *boundaries: BoundaryStencil, **info: Any) -> None:
    """Write boundaries with the PDE, the grid and what was reached, as JSON.

    Args:
        path: of the file.
        stencil: of the interior, whose coefficients, dx and dt the boundaries were designed for.
        boundaries: one or more.
        info: anything that JSON can hold, for example objective=..., reflection=..., radius=...
    """
    data = {
        "format": FORMAT,
        "pde": {
            "name": stencil.name,
            "parameters": dict(stencil.parameters),
            "dx": list(stencil.dx),
            "dt": stencil.dt,
            "offsets": stencil.offsets.tolist(),
            "coefficients": stencil.coefficients.tolist(),
        },
        "boundaries": [{"side": b.side, "axis": b.axis, "coefficients": b.coefficients.tolist()} for b in boundaries],
        "info": info,
    }
    write_text(path, json.dumps(data, indent=1) + "\n")


def read_file(path: Path) -> tuple[Stencil, list[BoundaryStencil], dict[str, Any]]:
    """Read what `write_file` wrote; numbers come back bit by bit.

    Returns:
        The interior stencil, the boundaries, and the information written with them.

    Raises:
        ValueError: the file is not one of this format.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["format"] != FORMAT:
            raise ValueError(f"format {data['format']!r}, expected {FORMAT!r}")
        pde = data["pde"]
        stencil = Stencil(
            np.array(pde["offsets"]),
            np.array(pde["coefficients"]),
            tuple(pde["dx"]),
            pde["dt"],
            pde["name"],
            tuple(pde["parameters"].items()),
        )
        found = [BoundaryStencil(np.array(b["coefficients"]), b["side"], b["axis"]) for b in data["boundaries"]]
        return stencil, found, dict(data["info"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError(f"{path} is not a file of absorbing boundaries: {error}") from error
