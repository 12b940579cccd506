"""What is wrong in the environment is named before ROS starts, one line each, with exit code 2."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from phil_node.surroundings import THIS_MACHINE, addresses, complaints, installed, keep_to_this_machine, reach

ROOT = Path(__file__).resolve().parents[3]


def said(**environment: str) -> list[str]:
    return list(complaints({"ROS_LOG_DIR": "/tmp", **environment}))


def test_an_ordinary_environment_is_accepted(tmp_path: Path) -> None:
    profiles = tmp_path / "profiles.xml"
    profiles.write_text("<profiles/>")
    assert said() == []
    assert said(RMW_IMPLEMENTATION="", ROS_DOMAIN_ID="", ROS_LOCALHOST_ONLY="", FASTRTPS_DEFAULT_PROFILES_FILE="") == []
    for name in installed(os.environ):
        assert said(RMW_IMPLEMENTATION=name) == []
    for text in ("0", "1", "101", "232"):
        assert said(ROS_DOMAIN_ID=text) == []
    assert said(ROS_LOCALHOST_ONLY="1", FASTRTPS_DEFAULT_PROFILES_FILE=str(profiles)) == []
    assert said(ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET") == []


def test_a_middleware_is_judged_by_its_library(tmp_path: Path) -> None:
    (line,) = said(RMW_IMPLEMENTATION="rmw_other_cpp", AMENT_PREFIX_PATH=os.environ.get("AMENT_PREFIX_PATH", ""))
    assert line.startswith("RMW_IMPLEMENTATION=rmw_other_cpp: it is not there")
    assert "rmw_fastrtps_cpp" in line and "unset RMW_IMPLEMENTATION" in line and "ros-jazzy-rmw-other-cpp" in line
    index = tmp_path / "share/ament_index/resource_index/rmw_typesupport"
    index.mkdir(parents=True)
    for name in ("rmw_implementation", "rmw_zenoh_cpp", "rmw_connextdds"):
        (index / name).touch()
    assert installed({"AMENT_PREFIX_PATH": str(tmp_path)}) == ["rmw_connextdds", "rmw_zenoh_cpp"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("ROS_DOMAIN_ID", text) for text in ("abc", "-1", "4x", "010", "0x10", "233", "1.0", " 3", "٣")),
        *(("ROS_LOCALHOST_ONLY", text) for text in ("yes", "true", "2")),
        *(("ROS_AUTOMATIC_DISCOVERY_RANGE", text) for text in ("localhost", "HOST", "OFF")),
        ("RCUTILS_LOGGING_USE_STDOUT", "yes"),
        ("RCUTILS_COLORIZED_OUTPUT", "auto"),
        ("RCUTILS_LOGGING_BUFFERED_STREAM", "x"),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "/none/profiles.xml"),
        ("FASTDDS_DEFAULT_PROFILES_FILE", __file__),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "/tmp"),
        ("ROS_STATIC_PEERS", "127.0.0.1;no host"),
        ("ROS_LOG_DIR", "/proc/none"),
        ("ROS_LOG_DIR", __file__),
    ],
)
def test_what_ros_would_take_for_something_else_is_named(name: str, value: str) -> None:
    (line,) = said(**{name: value})
    assert name in line and value.split(";")[-1] in line and "\n" not in line


def test_security_that_is_enforced_needs_keys(tmp_path: Path) -> None:
    enforced = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}
    for keys in ({}, {"ROS_SECURITY_KEYSTORE": "/none"}):
        (line,) = said(**enforced, **keys)
        assert line.startswith("ROS_SECURITY_KEYSTORE=")
    assert said(**enforced, ROS_SECURITY_KEYSTORE=str(tmp_path)) == []
    assert said(ROS_SECURITY_ENABLE="true", ROS_STATIC_PEERS="127.0.0.1;localhost;") == []


def test_another_middleware_does_not_read_the_profiles_of_fast_dds() -> None:
    lines = said(RMW_IMPLEMENTATION="rmw_other_cpp", FASTRTPS_DEFAULT_PROFILES_FILE="/none")
    assert len(lines) == 1 and "rmw_other_cpp" in lines[0]


@pytest.mark.parametrize(
    "module",
    ["catenary_model.node", "impedance_mpc.node", "energy_monitor.node", "test_rig_sim.node", "ride", "record"],
)
def test_every_process_names_it_before_ros_is_loaded(module: str, tmp_path: Path) -> None:
    environment = os.environ | {"RMW_IMPLEMENTATION": "rmw_other_cpp"}
    command = {"ride": ["ride", "--out", "ride"], "record": ["energy_monitor.record", "--out", "ride"]}
    done = subprocess.run(
        [sys.executable, "-m", *command.get(module, [module])],
        env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and done.stderr.startswith("RMW_IMPLEMENTATION=rmw_other_cpp: ")
    assert not (tmp_path / "ride").exists()


@pytest.mark.parametrize("folder", ["Prüfstand", "試験台", "a;b", "cost$", "(copy)", "it's"])
def test_a_path_that_messages_cannot_be_built_in_is_named_before_anything_is_installed(
    tmp_path: Path, folder: str
) -> None:
    script = tmp_path / folder / "scripts/lib/environment.sh"
    script.parent.mkdir(parents=True)
    script.write_text((ROOT / "scripts/lib/environment.sh").read_text())
    ended = subprocess.run(
        ["bash", "-c", '. "$1" && phil_check_path', "bash", str(script)], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 3
    assert ended.stderr.startswith(f"error: the path '{tmp_path / folder}' has a letter beyond ASCII")
    assert not (tmp_path / folder / ".venv").exists()


def test_a_path_with_spaces_is_none_of_them(tmp_path: Path) -> None:
    script = tmp_path / "two words+1.2_a-b" / "environment.sh"
    script.parent.mkdir(parents=True)
    script.write_text((ROOT / "scripts/lib/environment.sh").read_text())
    subprocess.run(["bash", "-c", '. "$1" && PHIL_ROOT="${1%/*}" phil_check_path', "bash", str(script)], check=True)


@pytest.mark.parametrize(
    ("given", "discovery", "closed"),
    [
        ({}, "SYSTEM_DEFAULT", True),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": ""}, "SYSTEM_DEFAULT", True),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, "SYSTEM_DEFAULT", True),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}, "SYSTEM_DEFAULT", False),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, "SUBNET", False),
        ({"ROS_LOCALHOST_ONLY": "1"}, "SYSTEM_DEFAULT", True),
        ({"ROS_LOCALHOST_ONLY": "0"}, "SYSTEM_DEFAULT", True),
        ({"ROS_STATIC_PEERS": "192.0.2.7"}, "LOCALHOST", False),
        ({"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}, "LOCALHOST", False),
    ],
)
def test_nodes_keep_to_this_machine_unless_told_otherwise(
    given: dict[str, str], discovery: str | None, closed: bool
) -> None:
    environment = dict(given)
    keep_to_this_machine(environment)
    assert environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE") == discovery
    assert (environment.get("FASTRTPS_DEFAULT_PROFILES_FILE") == str(THIS_MACHINE)) == closed
    assert (reach(environment) == "") == closed
    if environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE") == "SUBNET":
        assert environment["FASTDDS_BUILTIN_TRANSPORTS"] == "UDPv4"  # viewers would stop the loop by shared memory
    inherited = dict(environment)
    keep_to_this_machine(inherited)
    assert inherited == environment  # by the processes that a ride starts


def test_the_profile_listens_on_the_loopback_alone() -> None:
    names = {"dds": "http://www.eprosima.com"}
    profile = ElementTree.parse(THIS_MACHINE)
    assert [found.text for found in profile.iterfind(".//dds:interfaceWhiteList/dds:address", names)] == ["127.0.0.1"]
    assert [found.text for found in profile.iterfind(".//dds:type", names)] == ["UDPv4"]
    assert [found.text for found in profile.iterfind(".//dds:useBuiltinTransports", names)] == ["false"]


def test_fast_dds_takes_all_of_the_profile() -> None:
    """It says what it does not know on its output, and goes on without all of the file."""
    code = "import phil_node.before_rclpy, rclpy; rclpy.init(); rclpy.create_node('profiled'); print('made')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert "made" in done.stdout
    assert "XMLPARSER" not in done.stdout + done.stderr


def test_who_opens_a_ride_is_told_to_whom() -> None:
    for given in ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, {"ROS_STATIC_PEERS": "192.0.2.7"}):
        environment = {**given, "ROS_DOMAIN_ID": "7"}
        keep_to_this_machine(environment)
        said = reach(environment)
        assert "move the drive" in said and "\n" not in said
        assert all(address in said for address in addresses())
        assert "192.0.2.7" in said or "domain 7" in said


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"ROS_SECURITY_ENABLE": "True"}, "ROS_SECURITY_ENABLE=True: has to be true or false"),
        ({"ROS_SECURITY_STRATEGY": "enforce"}, "ROS_SECURITY_STRATEGY=enforce: has to be Enforce or Permissive"),
    ],
)
def test_slips_that_would_switch_security_off_are_refused(given: dict[str, str], words: str) -> None:
    (line,) = said(**given)
    assert line.startswith(words)


@pytest.mark.parametrize("secured", [False, True])
def test_security_needs_a_middleware_that_has_it(tmp_path: Path, secured: bool) -> None:
    (tmp_path / "libfastrtps.so").write_bytes(b"\x7fELF" + (b"DDS:Auth:PKI-DH:1.0" if secured else b""))
    found = said(ROS_SECURITY_ENABLE="true", LD_LIBRARY_PATH=str(tmp_path), ROS_SECURITY_KEYSTORE=str(tmp_path))
    assert [line.split(":")[0] for line in found] == ([] if secured else ["ROS_SECURITY_ENABLE=true"])
