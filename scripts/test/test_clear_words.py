"""What is quoted from a file neither fills a screen nor steers a terminal, and stands for no more than it is."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from energy_monitor.bag_channel import BagError
from energy_monitor.bag_folder import open_source
from energy_monitor.limits import LimitsError
from phil_base.clear_words import ClearError, clear
from phil_base.parameters import ParameterError
from phil_base.yaml_file import MOST_ENTRIES, YamlError, parse_yaml


@given(st.text(max_size=3000))
def test_every_line_can_be_read(text: str) -> None:
    lines = clear(text).split("\n")
    assert len(lines) == len(text.split("\n"))
    assert all(line.isprintable() and len(line) <= 1000 for line in lines)


@given(st.text(st.characters(categories=["L", "N", "P"]), max_size=200))
def test_ordinary_words_stay_as_they_are(text: str) -> None:
    assert clear(text) == text


@pytest.mark.parametrize("kind", [ClearError, YamlError, ParameterError, LimitsError, BagError])
def test_errors_about_files_are_clear(kind: type[Exception]) -> None:
    said = str(kind("rig.yaml: '" + "\x1b[2J" * 1000 + "' is unknown"))
    assert said.isprintable() and len(said) <= 1000
    assert said.startswith("rig.yaml") and said.endswith("is unknown")


def doubling(depth: int) -> str:
    """Each list holds the one before it twice."""
    return "a0: &a0 [1]\n" + "\n".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]" for i in range(1, depth))


def test_aliases_that_stand_for_too_much_are_refused_at_once() -> None:
    assert len(parse_yaml(doubling(8))) == 8
    begin = time.monotonic()
    with pytest.raises(YamlError, match=rf"line \d+: more than {MOST_ENTRIES} entries") as error:
        parse_yaml(doubling(60), "line.yaml")
    assert time.monotonic() - begin < 1.0 and len(str(error.value)) < 200


def test_a_bag_whose_metadata_stands_for_too_much_is_known_by_its_files(tmp_path: Path) -> None:
    (tmp_path / "bag.mcap").write_bytes(b"x")
    names = doubling(40).replace("\n", "\n  ")
    information = f"rosbag2_bagfile_information:\n  {names}\n  relative_file_paths: *a39\n"
    (tmp_path / "metadata.yaml").write_text(information)
    source = open_source(tmp_path)
    assert not source.listed and [file.name for file in source.files] == ["bag.mcap"]
