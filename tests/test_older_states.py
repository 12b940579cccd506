"""What an earlier state of this software recorded and wrote is read by this one: a bag and the parameters of its ride.

The archive is a ride of 0.2 s in lockstep at 250 km/h with the delivered parameters, made by the state that its name
says, before the packages were taken apart.
"""

import json
import tarfile
from pathlib import Path

import numpy as np
import pytest

from energy_monitor.bag import read_bag
from energy_monitor.report.cli import main as analyze
from phil_loop import ClosedLoop, resolve

pytestmark = pytest.mark.slow

ARCHIVE = Path(__file__).parent / "data" / "ride_of_0fec957.tar.xz"
CYCLES = 100


@pytest.fixture(scope="module")
def ride(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("older")
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(folder, filter="data")
    return folder / "ride"


def test_its_bag_is_read_in_full(ride: Path) -> None:
    bag = read_bag(ride / "bag")
    assert bag.complete
    rig = bag.table("test_rig_sim/state", "RigState")
    np.testing.assert_array_equal(rig["cycle"], np.arange(CYCLES))
    command = bag.table("impedance_mpc/command", "ImpedanceCommand")
    np.testing.assert_array_equal(command["cycle"], np.arange(CYCLES))
    assert set(bag.table("catenary_model/state", "CatenaryState")["cycle"]) == set(range(CYCLES + 1))
    assert len(bag.table("catenary_model/impedance_model", "ImpedanceModel")) == 1


def test_its_report_is_made_with_the_figures_of_then(ride: Path, tmp_path: Path) -> None:
    analyze([str(ride / "bag"), "--out", str(tmp_path)])
    report = json.loads((tmp_path / "report.json").read_text())
    force = report["contact_force"]
    # As that state's own report said. Filters and sums may be taken in another order: 1e-9 is far above rounding.
    assert force["samples"] == 99 and force["losses"] == 9
    assert force["mean"] == pytest.approx(12.283473312463991, rel=1e-9)
    assert force["sigma"] == pytest.approx(12.697802011725997, rel=1e-9)
    assert report["ride"]["ended"] and report["ride"]["distance"] == pytest.approx(13.75)
    assert [stream["missing"] for stream in report["streams"]] == [0, 0, 0]


def test_its_parameter_file_gives_the_same_ride(ride: Path) -> None:
    record = ClosedLoop(resolve(ride / "params.yaml", {})).ride()
    rig = read_bag(ride / "bag").table("test_rig_sim/state", "RigState")
    assert record.cycles == CYCLES
    # On the machine that recorded it the first cycles are equal to the bit. On another one kernels are compiled for its
    # processor; the active bounds of a few programs may then change a cycle earlier or later, 0.1 mm at the most.
    np.testing.assert_allclose(record.rig.w_tr, rig["w_tr"], atol=1e-4)
    np.testing.assert_allclose(record.rig.w_tr[:20], rig["w_tr"][:20], atol=1e-9)
