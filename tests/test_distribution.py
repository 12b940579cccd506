"""What `pip install .` gives: modules that work without ROS, all data files, the needs that a ride has."""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
NEEDS_ROS = re.compile(
    r"(catenary_model|impedance_mpc|test_rig_sim|energy_monitor)\.node"
    r"|test_rig_sim\.diagnosis|energy_monitor\.(links|listening|record)"
)
"""Modules of nodes and of the recorder; all others have to do without."""

IMPORT_ALL = """
import importlib, pkgutil, sys
for gone in ("rclpy", "phil_node", "phil_interfaces", "ament_index_python", "ride"):
    sys.modules[gone] = None
for top in sys.argv[1:]:
    for module in pkgutil.walk_packages(importlib.import_module(top).__path__, f"{top}."):
        if module.name.endswith("__main__"):
            continue
        try:
            importlib.import_module(module.name)
        except ImportError:
            print(module.name)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the folder into which the distribution is unpacked, as pip does it."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    # From a copy: setuptools leaves its folders beside the sources.
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if tracked.returncode:
        pytest.skip("the sources are not in a repository of git")
    for name in os.fsdecode(tracked.stdout).split("\0"):
        if name and (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--no-deps",
        "--no-build-isolation",
        "-w",
        str(folder),
        str(source),
    ]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as content:
        content.extractall(folder / "installed")
    return folder / "installed"


def test_every_module_but_those_of_nodes_works_without_ros(installed: Path) -> None:
    packages = sorted(path.parent.name for path in installed.glob("*/__init__.py"))
    assert {"phil_base", "phil_loop", "catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor"} < set(
        packages
    )
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [sys.executable, "-c", IMPORT_ALL, *packages]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=installed, check=False)
    assert done.returncode == 0, done.stderr
    failed = done.stdout.split()
    assert [name for name in failed if not NEEDS_ROS.fullmatch(name)] == []


def test_all_data_files_of_the_packages_are_there(installed: Path) -> None:
    for package in ("catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor"):
        source = ROOT / package / package
        kinds = (".yaml", ".html", ".j2", ".css", ".typed")
        wanted = {path.relative_to(source) for path in source.rglob("*") if path.suffix in kinds}
        found = {path.relative_to(installed / package) for path in (installed / package).rglob("*") if path.is_file()}
        assert wanted
        assert wanted <= found


def test_its_needs_are_those_that_the_scripts_install_for_a_ride() -> None:
    text = (ROOT / "pyproject.toml").read_text()

    def listed(name: str) -> list[str]:
        block = re.search(rf"^{name} = \[\n(.*?)^\]", text, flags=re.MULTILINE | re.DOTALL)
        assert block
        return re.findall(r'^  "(.+?)"', block[1], flags=re.MULTILINE)

    assert listed("dependencies") == listed("run")


def test_it_rides_without_ros(installed: Path) -> None:
    ride = (
        "from phil_loop import ClosedLoop, settings; record = ClosedLoop(settings(speed_kmh=250)).ride(0.1); "
        "print(record.cycles, *sorted({name.partition('.')[0] for name in sys.modules}))"
    )
    gone = "import sys; sys.modules.update(rclpy=None, phil_node=None, phil_interfaces=None, ride=None); "
    code = gone + ride
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PHIL_ROOT")}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, cwd=installed, check=False
    )
    assert done.returncode == 0, done.stderr
    cycles, *modules = done.stdout.split()
    assert int(cycles) == 50
    assert {"impedance_mpc", "catenary_model", "test_rig_sim"} <= set(modules)
