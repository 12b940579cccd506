"""Loads the build of ProxQP that gives the same result to the last bit in every run.

ProxSuite comes as up to three builds and its package loads the one with the widest vectors. Those for AVX2 and AVX-512
sum in an order that depends on how a buffer happens to be aligned, and malloc aligns to 16 bytes only: two equal runs
then differ in the last bit, now and then. The plain build works on 16-byte vectors, is not concerned by this, and is
as fast at the size of this problem. The module is loaded past the package, because two builds cannot share a process.
"""

from __future__ import annotations

import importlib
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np  # noqa: F401  (loaded before ProxSuite, which shares its OpenMP)

NAME = "proxsuite_pywrap"


def _plain_build() -> Path | None:
    package = find_spec("proxsuite")
    for folder in (package.submodule_search_locations or []) if package else []:
        for suffix in EXTENSION_SUFFIXES:
            path = Path(folder) / f"{NAME}{suffix}"
            if path.is_file():
                return path
    return None


def _load() -> Any:
    path = _plain_build()
    # Already loaded by somebody else, or built in another way: take what there is.
    if path is None or "proxsuite" in sys.modules:
        return importlib.import_module("proxsuite").proxqp
    spec = spec_from_file_location(NAME, path)
    if spec is None or spec.loader is None:
        return importlib.import_module("proxsuite").proxqp
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.proxqp


proxqp: Any = _load()
"""The module ``proxsuite.proxqp``."""
