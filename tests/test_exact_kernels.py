"""Compiled code rounds as it is written: rides repeat to the last bit, also the first one after an update.

See docs/decisions/no_contracted_products.md.
"""

import ast
import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor", "interfaces", "scripts", "examples")
SOURCES = [path for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))]
RIDE = """
import hashlib, math
from catenary_model.build import Config, build
from catenary_model.line_file import load_line
line = load_line("pre_sag_steady_arm")
catenary = build(Config(line=line, speed=70.0, discretisation="fd", grid_boundary="one_way"))
seen = hashlib.sha256()
for k in range(1500):
    catenary.step(100.0 + 20.0 * math.sin(0.01 * k))
    seen.update(catenary.state.point.tobytes())
print(seen.hexdigest())
"""


def test_no_kernel_is_compiled_with_fast_mathematics() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{node.value.lineno}"
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.keyword) and node.arg == "fastmath"
        if not (isinstance(node.value, ast.Constant) and node.value.value is False)
    ]
    assert not found


@pytest.mark.slow
def test_a_ride_by_kept_kernels_equals_the_one_that_compiled_them(tmp_path: Path) -> None:
    environment = dict(os.environ, PHIL_CACHE=str(tmp_path))
    seen = [
        subprocess.run([sys.executable, "-c", RIDE], env=environment, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert list(tmp_path.rglob("*.nbc"))
    assert seen[0] == seen[1] and len(seen[0].strip()) == hashlib.sha256().digest_size * 2
