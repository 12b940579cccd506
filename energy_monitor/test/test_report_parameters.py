"""Which of a file's parameters reach the nodes of the ride in a bag, and what is refused in one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from energy_monitor.analysis import Settings, analyse
from energy_monitor.bag import BagError, read_bag
from energy_monitor.report.cli import main
from energy_monitor.report.ride_parameters import parameters_of
from energy_monitor.report.verdicts import read_limits
from phil_base.parameters import ParameterError


def written(folder: Path, node: str, values: str) -> Path:
    file = folder / "params.yaml"
    file.write_text(f"{node}:\n  ros__parameters: {values}\n")
    return file


@pytest.mark.parametrize("node", ["energy_monitor", "/energy_monitor", "/**", "/left/energy_monitor", "/left/*"])
def test_names_and_patterns_reach_the_nodes_of_the_ride(
    node: str, synthetic: Callable[..., Path], tmp_path: Path
) -> None:
    bag = read_bag(synthetic(tmp_path / "bag", cycles=60, namespace="/left"))
    values = parameters_of(written(tmp_path, node, "{contact: {run_in: 0.05}}"), bag)
    assert values["energy_monitor"] == {"contact.run_in": 0.05}


@pytest.mark.parametrize(
    ("node", "values", "message"),
    [
        ("energy_monitor", "{contact: {run_in: soon}}", "'contact.run_in' = 'soon' is not a number"),
        (
            "energy_monitor",
            "{contact: {cutoff: 5000.0}}",
            "'contact.cutoff' = 5000.0 is not allowed: a number from 1 to",
        ),
        ("energy_monitor", "{contact: {cutoff: 60.0}, cycle_time: 0.01}", "below half the cycle rate"),
        ("test_rig_sim", "{uplift_force: much}", "'uplift_force' = 'much' is not a number"),
        ("/right/energy_monitor", "{contact: {run_in: 0.05}}", "nothing for a node of this ride"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(
    node: str, values: str, message: str, ride_bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, node, values)
    with pytest.raises(ParameterError, match=node.rpartition("/")[2]):
        parameters_of(file, read_bag(ride_bag))
    assert main([str(ride_bag), "--no-html", "--json", "/dev/null", "--params", str(file)]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1 and said.startswith(f"analyze: {file}: ")


def test_a_low_pass_that_the_cycles_of_the_bag_do_not_allow_is_refused(ride_bag: Path) -> None:
    with pytest.raises(BagError, match="low-pass of 600 Hz needs more than the"):
        analyse(read_bag(ride_bag), Settings(cutoff=600.0), read_limits(None))
