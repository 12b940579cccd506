"""Reads a pantograph from a YAML file: transfer functions or a state-space model (formats: docs/pantographs.md)."""

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from phil_base.clear_words import ClearError
from phil_base.yaml_file import YamlError, read_yaml
from test_rig_sim.pantographs.linear import MAX_STATES, ROUNDING, linear_pantograph, realise
from test_rig_sim.pantographs.motion import CONTACT, LIFT, Pantograph

Array = npt.NDArray[np.float64]

KEYS: dict[object, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "transfer_function": (("denominator", "contact"), ("lift", "base")),
    "state_space": (("A", "B", "C", "inputs"), ()),
}
"""Kind to the keys that a file of it needs and to those that it may have besides."""
INPUTS = ("lift", "base", "base_rate", "contact_force")
"""Names of B's columns in a file, in the order of `motion.Pantograph`."""


class PantographFileError(ClearError):
    """A pantograph file is unusable; the text names file and key."""


def read_pantograph(path: Path | str) -> Pantograph:
    """Return the pantograph that the file describes.

    Raises
    ------
    PantographFileError
        The file cannot be read, has other keys than its kind wants, has numbers that do not fit together, gives the
        head no velocity (relative degree below 2), or is unstable.
    """
    file = Path(os.path.expanduser(path))  # noqa: PTH111 - an unknown user's home stays as it is
    try:
        content = read_yaml(file)
    except YamlError as error:
        raise PantographFileError(str(error)) from None
    try:
        return _pantograph(content)
    except ValueError as error:
        raise PantographFileError(f"{path}: {error}") from None


def _pantograph(content: object) -> Pantograph:
    if not isinstance(content, Mapping):
        raise ValueError("has to be a mapping of keys")
    kind = content.get("kind")
    if not isinstance(kind, str) or kind not in KEYS:
        raise ValueError(f"'kind' = {kind!r} is not allowed: one of {', '.join(map(str, KEYS))}")
    needed, allowed = KEYS[kind]
    for key in needed:
        if key not in content:
            raise ValueError(f"'{key}' is missing (kind {kind} needs {', '.join(needed)})")
    for key in content:
        if key not in ("kind", *needed, *allowed):
            raise ValueError(f"'{key}' is unknown (kind {kind} has {', '.join((*needed, *allowed))})")
    A, B, c = _transfer_function(content) if kind == "transfer_function" else _state_space(content)
    return linear_pantograph(A, B, c)


def _transfer_function(content: Mapping[str, Any]) -> tuple[Array, Array, Array]:
    denominator = _numbers(content, "denominator")
    n = denominator.size - 1
    if not 2 <= n <= MAX_STATES:
        raise ValueError(f"'denominator' has degree {n}, allowed are 2 to {MAX_STATES}")
    contact = _numerator(content, "contact", n, 2)
    if contact[0] / denominator[0] <= 0.0:
        raise ValueError("'contact' must begin with the sign of 'denominator': the head gives way to the contact force")
    if denominator[-1] != 0.0 and contact[-1] / denominator[-1] <= 0.0:
        raise ValueError("'contact' must end with the sign of 'denominator': at rest the head gives way as well")
    lift = _numerator(content, "lift", n, 2) if "lift" in content else contact
    base = _numerator(content, "base", n, 1) if "base" in content else np.zeros(0)
    return realise(denominator, contact, lift, base)


def _numerator(content: Mapping[str, Any], key: str, n: int, relative: int) -> Array:
    polynomial = _numbers(content, key)
    degree = polynomial.size - 1
    if degree > n - relative:
        raise ValueError(
            f"'{key}' has degree {degree}, at most {n - relative} is allowed: relative degree of at least {relative}, "
            "so that the head has a velocity"
        )
    return polynomial


def _numbers(content: Mapping[str, Any], key: str) -> Array:
    """Return a polynomial without leading zeros, not zero as a whole."""
    polynomial = np.trim_zeros(_vector(content[key], f"'{key}'"), "f")
    if polynomial.size == 0:
        raise ValueError(f"'{key}' must not be zero")
    return np.asarray(polynomial, dtype=np.float64)


def _vector(value: object, name: str) -> Array:
    if not isinstance(value, list) or not value:
        raise ValueError(f"{name} has to be a list of numbers")
    for i, entry in enumerate(value):
        if isinstance(entry, bool) or not isinstance(entry, (int, float)) or not math.isfinite(entry):
            raise ValueError(f"{name}, entry {i + 1} = {entry!r} is no finite number")
    return np.array(value, dtype=np.float64)


def _matrix(value: object, name: str, columns: int) -> Array:
    if not isinstance(value, list) or not value:
        raise ValueError(f"{name} has to be a list of rows")
    rows = [_vector(row, f"{name} row {i + 1}") for i, row in enumerate(value)]
    for i, row in enumerate(rows):
        if row.size != columns:
            raise ValueError(f"{name} row {i + 1} has {row.size} numbers, {columns} are needed")
    return np.array(rows)


def _state_space(content: Mapping[str, Any]) -> tuple[Array, Array, Array]:
    c = _vector(content["C"], "'C'")
    m = c.size
    if not 2 <= m <= MAX_STATES:
        raise ValueError(f"'C' has {m} numbers, one for each state, allowed are 2 to {MAX_STATES}")
    A = _matrix(content["A"], "'A'", m)
    if A.shape[0] != m:
        raise ValueError(f"'A' has {A.shape[0]} rows, {m} are needed (as many as 'C' has numbers)")
    inputs = content["inputs"]
    names = [str(name) for name in inputs] if isinstance(inputs, list) else []
    if not names or len(set(names)) != len(names) or not set(names) <= set(INPUTS):
        raise ValueError(f"'inputs' = {inputs!r} is not allowed: a list of some of {', '.join(INPUTS)}, each once")
    if "contact_force" not in names:
        raise ValueError("'inputs' must contain contact_force")
    given = _matrix(content["B"], "'B'", len(names))
    if given.shape[0] != m:
        raise ValueError(f"'B' has {given.shape[0]} rows, {m} are needed (as many as 'C' has numbers)")
    B = np.zeros((m, len(INPUTS)))
    for column, name in enumerate(names):
        B[:, INPUTS.index(name)] = given[:, column]
        direct = float(c @ given[:, column])
        if abs(direct) > ROUNDING * float(np.abs(c) @ np.abs(given[:, column])):
            raise ValueError(
                f"'B': C B = 0 is needed (relative degree of at least 2), so that the head has a velocity; the column "
                f"{name} has {direct:.4g}"
            )
    if "lift" not in names:
        B[:, LIFT] = -B[:, CONTACT]
    if c @ A @ B[:, CONTACT] > 0.0:
        raise ValueError("'B': contact_force must push the head down, C A B < 0 in its column (or C A B = 0)")
    return A, B, c
