"""Designs kept in files, so that the same problem is solved once."""

from __future__ import annotations

import contextlib
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from catenary_model.absorbing.design import DEMANDS, SWEEP, Demands, Design, Sweep, design, design_pair, read_design
from catenary_model.absorbing.stencil import Stencil
from catenary_model.absorbing.weighting import Weighting
from phil_base import cache

SOURCES = (Path(__file__).parent,)
"""Code that makes a design what it is; a digest of it is part of every key."""


def default_folder() -> Path:
    """Folder of the designs among what is kept between runs, see `phil_base.cache`."""
    return cache.folder("absorbing")


def key(stencil: Stencil, *inputs: Any) -> str:
    """Hash of everything that a design depends on; numbers count to 12 digits, so that rounding does not matter."""
    numbers = [*stencil.offsets.ravel().tolist(), *_rounded(stencil.coefficients), *_rounded((*stencil.dx, stencil.dt))]
    text = json.dumps([cache.digest(*SOURCES), numbers, *inputs])
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def cached_design(
    stencil: Stencil,
    side: str,
    n_x: int,
    n_t: int,
    weighting: Weighting,
    *,
    demands: Demands = DEMANDS,
    sweep: Sweep = SWEEP,
    folder: Path | None = None,
) -> Design:
    """Return the design for these inputs from its file, or make it and write the file; arguments as for `design`.

    Args:
        stencil: of the interior.
        side: "left" or "right".
        n_x: nodes that every boundary node's update reads.
        n_t: old time levels that it reads.
        weighting: over frequency.
        demands: on stability.
        sweep: of the least-squares problems.
        folder: of the files; `default_folder()` if None.
    """
    name = key(stencil, side, n_x, n_t, _table(weighting), demands, sweep)
    path = (folder or default_folder()) / f"{name}-{side}.json"
    kept = _read(path)
    if kept is None:
        kept = design(stencil, side, n_x, n_t, weighting, demands=demands, sweep=sweep)
        _write(path, kept)
    return kept


def cached_pair(
    stencil: Stencil,
    n_x: int,
    n_t: int,
    weighting: Weighting,
    *,
    demands: Demands = DEMANDS,
    sweep: Sweep = SWEEP,
    folder: Path | None = None,
) -> tuple[Design, Design]:
    """Return left and right design for these inputs from files, or make and keep them; see `design_pair`."""
    name = key(stencil, "pair", n_x, n_t, _table(weighting), demands, sweep)
    paths = [(folder or default_folder()) / f"{name}-{side}.json" for side in ("left", "right")]
    left, right = (_read(path) for path in paths)
    if left is None or right is None:
        left, right = design_pair(stencil, n_x, n_t, weighting, demands=demands, sweep=sweep)
        for path, made in zip(paths, (left, right), strict=True):
            _write(path, made)
    return left, right


def _rounded(values: Any) -> list[str]:
    return [f"{float(v):.12g}" for v in np.ravel(values)]


def _table(weighting: Weighting) -> list[tuple[float, ...]]:
    return [weighting.frequencies, weighting.weights, weighting.band]


def _read(path: Path) -> Design | None:
    try:
        return read_design(path)
    except (OSError, ValueError):
        return None


def _write(path: Path, made: Design) -> None:
    """Write the file; a full disk is no error."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        made.write(path)
