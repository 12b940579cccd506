"""What the documentation says is what the code does."""

import re
from pathlib import Path

import yaml

from ride.parameter_table import PATH, table

ROOT = Path(__file__).resolve().parents[1]


def test_the_parameter_page_is_current():
    assert PATH.read_text() == table(), "run: python -m ride.parameter_table"


def test_every_message_field_is_explained():
    for path in sorted((ROOT / "interfaces" / "phil_interfaces" / "msg").glob("*.msg")):
        for line in path.read_text().splitlines():
            if line and not line.startswith("#"):
                assert "#" in line, f"{path.name}: {line}"


def test_every_message_is_built_and_has_a_header_and_a_cycle():
    listed = (ROOT / "interfaces" / "phil_interfaces" / "CMakeLists.txt").read_text()
    for path in (ROOT / "interfaces" / "phil_interfaces" / "msg").glob("*.msg"):
        assert f'"msg/{path.name}"' in listed
        text = path.read_text()
        assert "std_msgs/Header header" in text and "uint64 cycle" in text


def test_a_forge_installs_what_the_set_up_asks_for_and_runs_the_same_script():
    asked = re.findall(r"missing\+=\((\S+)\)", (ROOT / "scripts" / "lib" / "environment.sh").read_text())
    (job,) = yaml.safe_load((ROOT / ".github" / "workflows" / "test.yml").read_text())["jobs"].values()
    commands = [step["run"] for step in job["steps"] if "run" in step]
    (installed,) = re.findall(r"apt-get install (.+)", "\n".join(commands))
    assert {word for word in installed.split() if not word.startswith("-")} == set(asked)
    assert commands[-1] == ".ci/run"
