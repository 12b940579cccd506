"""All packages, the tools' file, the citation and the changelog are of one version; it is told by `package.xml`."""

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent for pattern in ("*", "interfaces/*") for path in ROOT.glob(f"{pattern}/package.xml"))
VERSIONS = {
    ElementTree.parse(path / "package.xml").findtext("name"): ElementTree.parse(path / "package.xml").findtext(
        "version"
    )
    for path in PACKAGES
}
(VERSION,) = set(VERSIONS.values())


def test_the_packages_are_those_of_the_workspace():
    nodes = {"catenary_model", "energy_monitor", "impedance_mpc", "test_rig_sim"}
    assert set(VERSIONS) == {*nodes, "phil_base", "phil_interfaces", "phil_loop", "phil_node"}
    assert re.fullmatch(r"\d+\.\d+\.\d+", VERSION)


@pytest.mark.parametrize("package", [path for path in PACKAGES if (path / "setup.py").is_file()], ids=lambda p: p.name)
@pytest.mark.slow
def test_setuptools_takes_the_version_of_the_package(package):
    asked = [sys.executable, "setup.py", "--quiet", "--version"]
    said = subprocess.run(asked, cwd=package, capture_output=True, text=True, check=True)
    assert said.stdout.split() == [VERSION], said.stderr


def test_the_project_has_the_version_of_its_packages():
    project = (ROOT / "pyproject.toml").read_text().partition("[project]")[2]
    assert re.search(r'^version = "(.+)"$', project, flags=re.MULTILINE)[1] == VERSION


def test_the_newest_entry_of_the_changelog_is_of_this_version():
    entries = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(), flags=re.MULTILINE)
    assert entries[0] == VERSION


def test_who_cites_the_software_cites_this_version():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert cited["cff-version"] == "1.2.0"
    assert cited["version"] == VERSION
    assert {"message", "title", "authors"} <= set(cited)
