"""Merging and checking of all parameters before anything is started."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from catenary_model.line import Line
from catenary_model.line_file import dump_line, load_line
from phil_base.parameters import ParameterError
from ride.folder import clear
from ride.options import parse
from ride.settings import NODES, line_text, pantograph_text, resolve, rig_names, write


def file(tmp_path, tree):
    path = tmp_path / "params.yaml"
    path.write_text(yaml.safe_dump(tree))
    return path


def test_options_win_over_the_file_and_the_file_over_defaults(tmp_path):
    params = file(tmp_path, {"catenary_model": {"ros__parameters": {"speed_kmh": 200, "spans": 3}}})
    settings = resolve(params, {"catenary_model": {"speed_kmh": 160.0}})
    assert settings["catenary_model"]["speed_kmh"] == 160.0
    assert settings["catenary_model"]["spans"] == 3
    assert set(settings) == set(NODES)


def test_wildcards_reach_every_node_that_has_the_parameter(tmp_path):
    settings = resolve(file(tmp_path, {"/**": {"ros__parameters": {"cycle_time": 0.003}}}), {})
    assert {values["cycle_time"] for values in settings.values()} == {0.003}


def test_a_wildcard_before_a_name_is_for_that_node_only(tmp_path):
    settings = resolve(file(tmp_path, {"/**/test_rig_sim": {"ros__parameters": {"seed": 11}}}), {})
    assert settings["test_rig_sim"]["seed"] == 11
    with pytest.raises(ParameterError, match=r"spans.*unknown"):
        resolve(file(tmp_path, {"/**/test_rig_sim": {"ros__parameters": {"spans": 3}}}), {})


def test_different_cycle_times_are_refused():
    with pytest.raises(ParameterError, match="cycle_time"):
        resolve(None, {"test_rig_sim": {"cycle_time": 0.004}})


def test_different_clocks_are_refused():
    with pytest.raises(ParameterError, match=r"'mode' has to be the same.*monitor realtime, test_rig_sim lockstep"):
        resolve(None, {"energy_monitor": {"mode": "realtime"}})


def test_an_empty_name_is_no_rig_and_no_folder(capsys):
    with pytest.raises(ParameterError, match="there is no rig ''"):
        resolve(None, {}, "")
    with pytest.raises(SystemExit, match="2"):
        parse(["--out", ""])
    assert "an empty name is no folder" in capsys.readouterr().err


@pytest.mark.slow
def test_the_rig_rides_as_fast_as_the_catenary_says(tmp_path):
    def speed(settings):
        return settings["test_rig_sim"]["speed_kmh"]

    assert speed(resolve(None, {})) == resolve(None, {})["catenary_model"]["speed_kmh"]
    params = file(tmp_path, {"catenary_model": {"ros__parameters": {"speed_kmh": 200.0}}})
    assert speed(resolve(params, {})) == 200.0
    assert speed(resolve(params, {"catenary_model": {"speed_kmh": 160.0}})) == 160.0
    # A ride that is ridden again has both in its file; the command line changes one.
    both = {name: {"ros__parameters": {"speed_kmh": 200.0}} for name in ("catenary_model", "test_rig_sim")}
    assert speed(resolve(file(tmp_path, both), {"catenary_model": {"speed_kmh": 160.0}})) == 160.0
    with pytest.raises(ParameterError, match=r"speed_kmh.*same.*250 km/h.*100 km/h"):
        resolve(None, {"test_rig_sim": {"speed_kmh": 100.0}})


@pytest.mark.parametrize(
    ("tree", "words"),
    [
        ({"catenary_modle": {"ros__parameters": {"spans": 3}}}, "no node 'catenary_modle'"),
        ({"catenary_model": {"ros__parameters": {"spnas": 3}}}, "spnas.*unknown.*spans"),
        ({"catenary_model": {"ros__parameters": {"speed_kmh": 4000.0}}}, "speed_kmh.*4000.*km/h"),
        ({"catenary_model": {"ros__parameters": {"line": "nowhere"}}}, "'line'.*nowhere.*presets are .*en50318_2002"),
        ({"test_rig_sim": {"ros__parameters": {"mode": "fast"}}}, "mode.*fast.*lockstep"),
        ({"/**": {"ros__parameters": {"cycletime": 0.002}}}, "no node has a parameter 'cycletime'"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, tree, words):
    with pytest.raises(ParameterError, match=words):
        resolve(file(tmp_path, tree), {})


def test_a_rig_is_below_the_file_and_the_file_below_options(tmp_path):
    params = file(tmp_path, {"test_rig_sim": {"ros__parameters": {"drive": {"delay": 2}, "load_cell": {"bias": 7.0}}}})
    settings = resolve(params, {"test_rig_sim": {"load_cell.bias": 9.0}}, "harsh")
    rig = settings["test_rig_sim"]
    assert (rig["drive.delay"], rig["load_cell.bias"], rig["load_cell.noise"]) == (2, 9.0, 1.5)
    write(settings, line_text(settings), tmp_path)
    assert resolve(tmp_path / "params.yaml", {}) == settings


def test_a_rig_brings_the_model_that_was_identified_on_it():
    frequencies = {name: resolve(None, {}, name)["impedance_mpc"]["rig_natural_frequency_hz"] for name in rig_names()}
    assert frequencies["harsh"] < frequencies["nominal"] < frequencies["ideal"]


def test_the_nominal_rig_is_the_default():
    assert resolve(None, {}, "nominal") == resolve(None, {})


def test_an_unknown_rig_is_named_with_those_there_are():
    with pytest.raises(ParameterError, match=r"no rig 'real'.*harsh, ideal, nominal"):
        resolve(None, {}, "real")


def test_the_written_file_gives_the_same_ride_again(tmp_path):
    settings = resolve(None, {"test_rig_sim": {"seed": 5}})
    write(settings, line_text(settings), tmp_path)
    assert resolve(tmp_path / "params.yaml", {}) == settings
    assert load_line(tmp_path / "line.yaml") == load_line(settings["catenary_model"]["line"])


def test_a_ride_keeps_a_copy_of_its_own_line(tmp_path, monkeypatch):
    """The file may change or vanish after the start, and the folder from which it was named does not matter."""
    monkeypatch.chdir(tmp_path)
    mine = tmp_path / "mine.yaml"
    mine.write_text(dump_line(Line(name="mine", gravity=9.7)))
    settings = resolve(None, {"catenary_model": {"line": "mine.yaml"}})
    line = line_text(settings)
    (tmp_path / "ride").mkdir()
    mine.write_text("broken")
    write(settings, line, tmp_path / "ride")
    mine.unlink()
    monkeypatch.chdir("/")
    again = resolve(tmp_path / "ride" / "params.yaml", {})
    assert load_line(again["catenary_model"]["line"]) == Line(name="mine", gravity=9.7)


def test_every_problem_of_a_line_is_said_with_parameter_file_and_entry(tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.write_text(dump_line(Line()).replace("length: 60.0", "length: -60.0").replace("gravity: 9.81", "gravity: 99"))
    with pytest.raises(ParameterError) as refused:
        resolve(None, {"catenary_model": {"line": str(mine)}})
    lines = str(refused.value).splitlines()
    assert len(lines) == 2
    for line, entry in zip(sorted(lines), ("gravity = 99", r"spans[0].length = -60"), strict=True):
        assert line.startswith(f"catenary_model: parameter 'line': {mine}: {entry}")


def test_a_home_folder_is_understood(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "mine.yaml").write_text(dump_line(Line(name="mine")))
    assert "mine" in line_text(resolve(None, {"catenary_model": {"line": "~/mine.yaml"}}))


def test_a_pantograph_file_is_kept_with_the_ride(tmp_path):
    example = Path(__file__).parents[2] / "test_rig_sim" / "test_rig_sim" / "config" / "pantograph_en50318.yaml"
    mine, folder = tmp_path / "mine.yaml", tmp_path / "ride"
    mine.write_text(example.read_text())
    folder.mkdir()
    settings = resolve(None, {"test_rig_sim": {"pantograph": "state_space", "pantograph_file": str(mine)}})
    write(settings, line_text(settings), folder, pantograph_text(settings))
    mine.unlink()
    again = resolve(folder / "params.yaml", {})["test_rig_sim"]
    assert again["pantograph_file"] == str(folder / "pantograph.yaml")
    assert Path(again["pantograph_file"]).read_text() == example.read_text()
    with pytest.raises(ParameterError, match=r"pantograph_file.*mine\.yaml"):
        pantograph_text(settings)
    assert pantograph_text(resolve(None, {})) == ""


def test_shortcuts_are_parameters():
    options = parse(
        [
            *("--speed-kmh", "200", "--line", "a.yaml", "--discretisation", "fd", "--seed", "3"),
            *("--set", "impedance_mpc.correction=false"),
        ]
    )
    assert options.overrides == {
        "catenary_model": {"speed_kmh": 200.0, "line": "a.yaml", "discretisation": "fd"},
        "test_rig_sim": {"seed": 3},
        "impedance_mpc": {"correction": False},
    }


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("nonsense", "NODE.KEY=VALUE"),
        ("catenary_model=3", "NODE.KEY=VALUE"),
        (".x=1", "NODE.KEY=VALUE"),
        ("a.b=[1", "YAML"),
    ],
)
def test_a_malformed_set_ends_with_code_2(argument, words, capsys):
    with pytest.raises(SystemExit) as caught:
        parse(["--set", argument])
    assert caught.value.code == 2
    assert words in capsys.readouterr().err


def test_only_what_a_ride_left_is_replaced_and_only_when_asked(tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "data.mcap").write_text("x")
    (tmp_path / "notes.txt").write_text("mine")
    assert not clear(tmp_path, overwrite=False)
    assert (tmp_path / "bag" / "data.mcap").exists()
    assert clear(tmp_path, overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    assert clear(tmp_path, overwrite=False)


@pytest.mark.slow
def test_wrong_parameters_stop_the_command_with_one_line(tmp_path):
    command = [sys.executable, "-m", "ride", "--speed-kmh", "4000", "--out", str(tmp_path / "ride")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.strip().count("\n") == 0
    assert "speed_kmh" in done.stderr and "4000" in done.stderr
    assert not (tmp_path / "ride").exists()


@pytest.mark.parametrize("option", ["--speed-kmh=1_000", "--duration=nan", "--seed=1_0", "--seed=5.0", "--set=a.b=[1"])
def test_a_number_of_the_command_line_is_one_of_yaml(option, capsys):
    with pytest.raises(SystemExit) as ended:
        parse([option])
    assert ended.value.code == 2
    assert option.split("=")[-1] in capsys.readouterr().err


def test_values_of_the_command_line_are_yaml_1_2():
    given = parse(
        ["--set", "n.a=010", "--set", "n.b=1e-3", "--set", "n.c=yes", "--set", "n.d=[1, 2.5]", "--seed", "010"]
    )
    assert given.overrides["n"] == {"a": 10, "b": 1e-3, "c": "yes", "d": [1, 2.5]}
    assert given.overrides["test_rig_sim"] == {"seed": 10}


def test_all_nodes_have_the_clock_of_the_rig(tmp_path):
    def clocks(settings):
        return {values["mode"] for values in settings.values()}

    assert clocks(resolve(None, {})) == {"lockstep"}
    assert clocks(resolve(None, {"test_rig_sim": {"mode": "realtime"}})) == {"realtime"}
    params = file(tmp_path, {"test_rig_sim": {"ros__parameters": {"mode": "realtime"}}})
    assert clocks(resolve(params, {})) == {"realtime"}
    with pytest.raises(ParameterError) as refused:
        resolve(None, {"test_rig_sim": {"mode": "warp"}})
    assert str(refused.value).count("'mode'") == 1  # said once, of the rig
