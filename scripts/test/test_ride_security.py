"""The page that says who may move the drive knows everything in the code by which that can be done."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

from phil_base.parameters import infos
from phil_node.surroundings import OF_TRANSPORTS, THIS_MACHINE
from ride.settings import NODES

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "security.md").read_text()
TABLE = PAGE.split("## Who may move the drive")[1].split("\n## ")[0]
MOVING = ("test_rig_sim", "impedance_mpc", "catenary_model")


def sources(node: str) -> str:
    return "\n".join(path.read_text() for path in sorted((ROOT / node / node).glob("*.py")))


@pytest.mark.parametrize("node", NODES)
def test_every_live_parameter_is_listed(node: str) -> None:
    live = [info.name for info in infos(import_module(f"{node}.parameters").Parameters) if info.live]
    for name in live:
        assert (f"`{node}.{name}`" if node in MOVING else f"`{name}`") in TABLE


def test_every_live_parameter_that_is_listed_is_one() -> None:
    listed = re.findall(r"\| `(\w+)\.([\w.]+)` \| live parameter", TABLE)
    assert listed
    for node, name in listed:
        assert any(info.live and info.name == name for info in infos(import_module(f"{node}.parameters").Parameters))


def test_every_service_is_listed() -> None:
    base = (ROOT / "interfaces/phil_node/phil_node/base.py").read_text()
    served = [(node, name) for node in NODES for name in re.findall(r"\.serve\(\w+, \"([^\"]+)\"", sources(node))]
    served += [("NODE", name) for name in re.findall(r"create_service\(\w+, \"([^\"]+)\"", base)]
    assert len(served) >= 4
    for node, name in served:
        assert f"`{name.replace('~', node)}`" in TABLE
    assert "`NODE/change_state`" in TABLE


def test_every_topic_that_a_moving_node_listens_to_is_listed() -> None:
    heard = {
        name
        for node in MOVING
        for name in re.findall(r"(?:listen|receive_cycles)\(\s*\w+, \"([^\"]+)\"", sources(node))
    }
    heard |= set(re.findall(r"create_subscription\(\s*\w+, \"([^\"]+)\"", "\n".join(map(sources, MOVING))))
    assert len(heard) >= 3
    for name in heard:
        assert f"`{name}`" in TABLE


def test_the_variables_that_open_a_ride_are_named() -> None:
    assert THIS_MACHINE.name in PAGE
    for name in ("ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER", "FASTDDS_BUILTIN_TRANSPORTS"):
        assert name in OF_TRANSPORTS and name in PAGE
