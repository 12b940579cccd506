"""What a node would refuse when it is configured is refused before a ride starts; what is only odd is told."""

import re
from importlib import import_module

import pytest

from catenary_model.build import build as build_catenary
from catenary_model.reduced import NEWMARK_BETA, NEWMARK_GAMMA
from energy_monitor.limits import chosen
from impedance_mpc.plant import Impedance
from impedance_mpc.switching import EnvironmentSwitch
from phil_base.parameters import ParameterError, build
from ride.checks import notices
from ride.command import carry_out
from ride.options import parse
from ride.settings import resolve
from test_rig_sim.operation import rules
from test_rig_sim.rig import Rig

DEFAULTS = resolve(None, {})


def group(node, **changes):
    return build(import_module(f"{node}.parameters").Parameters, {**DEFAULTS[node], **changes}, node)


def as_the_catenary_does(p):
    build_catenary(p.config())


def as_the_rig_does(p):
    rules(p, Rig(p).plant.loop)


def as_the_monitor_does(p):
    chosen(p.limits.file, p.limits.standard)


def as_the_controller_does(p):
    reduced = build_catenary(group("catenary_model").config()).reduced
    m, d, k, b = reduced.M, reduced.D, reduced.K, reduced.b
    EnvironmentSwitch(p, Impedance(m, d, k, b, b, p.cycle_time, NEWMARK_BETA, NEWMARK_GAMMA))


PANTOGRAPH = {"pantograph": "state_space", "pantograph_file": "FOLDER/limits.yaml"}
NO_LIFT = "kind: state_space\nA: [[0, 1], [-100, -10]]\nB: [[0], [0]]\nC: [1, 0]\ninputs: [contact_force]\n"
TRAJECTORY = {"trajectory.kind": "file", "trajectory.file": "FOLDER/way.csv"}

REFUSED = [
    (as_the_monitor_does, {"limits.standard": "en50367_dc"}, "", r"'limits.standard' = 'en50367_dc' is not one of"),
    (as_the_monitor_does, {"limits.file": "FOLDER/none.yaml"}, "", r"'limits.file': .*none.yaml: cannot be read"),
    (as_the_monitor_does, {"limits.file": "FOLDER/limits.yaml"}, "a: [", r"limits.yaml: is no YAML: line 1"),
    (as_the_monitor_does, {"limits.file": "FOLDER/limits.yaml"}, "a: {}\na: {}\n", r"line 2: 'a' is given twice"),
    (as_the_monitor_does, {"limits.file": "FOLDER/limits.yaml"}, "a: {title: x}\n", r"a: 'checks' is missing"),
    (as_the_rig_does, {"trajectory.kind": "file"}, "", r"trajectory.file is empty"),
    (
        as_the_rig_does,
        {**TRAJECTORY, "trajectory.file": "FOLDER/none.csv"},
        "",
        r"none.csv cannot be read: No such file",
    ),
    (as_the_rig_does, PANTOGRAPH, NO_LIFT, r"'pantograph_file': at rest no lift puts the head at its nominal height"),
    (as_the_rig_does, TRAJECTORY, "0,0\n1;5\n", r"line 2: '1;5' is not 'time, position'"),
    (as_the_rig_does, TRAJECTORY, "0,0\n1,nan\n", r"line 2"),
    (as_the_rig_does, TRAJECTORY, "0,0\n1,1_0\n", r"line 2"),
    (as_the_rig_does, TRAJECTORY, "0,0\n0,1\n", r"the times do not rise"),
    (as_the_rig_does, TRAJECTORY, "0,0\n1e7,0.01\n", r"lasts 1e\+07 s, at most 3600 s"),
    (as_the_rig_does, TRAJECTORY, "0,0\n9,0.5\n", r"trajectory.file: .*position of 0.5 m, allowed are 0.3"),
    (
        as_the_rig_does,
        {"trajectory.amplitude": 0.2, "trajectory.frequency": 20.0},
        "",
        r"trajectory.frequency: .*speed",
    ),
    (as_the_rig_does, {"start": "apart", "touch.highest": 0.021}, "", r"start = apart: .*0.051 m high"),
    (
        as_the_controller_does,
        {"environments.mass_spring_damper.stiffness": 0.0},
        "",
        r"'environments.mass_spring_damper.stiffness' = 0 N/m has to be above 0: singular",
    ),
    (
        as_the_catenary_does,
        {"discretisation": "fd", "grid_boundary_nodes": 3, "grid_boundary_levels": 6},
        "",
        r"grid_boundary = 'absorbing'.*not 3 and 6",
    ),
]
NODE = {
    as_the_monitor_does: "energy_monitor",
    as_the_rig_does: "test_rig_sim",
    as_the_controller_does: "impedance_mpc",
    as_the_catenary_does: "catenary_model",
}


@pytest.mark.parametrize(("builds", "changes", "content", "words"), REFUSED)
@pytest.mark.slow
def test_what_a_node_cannot_be_built_from_is_refused_before_the_start(tmp_path, builds, changes, content, words):
    changes = {k: v.replace("FOLDER", str(tmp_path)) if isinstance(v, str) else v for k, v in changes.items()}
    for name in ("way.csv", "limits.yaml"):
        (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=words):
        builds(group(NODE[builds], **changes))
    with pytest.raises(ParameterError, match=words) as caught:
        resolve(None, {NODE[builds]: changes})
    assert str(caught.value).startswith(f"{NODE[builds]}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("low", "high"), [(0.1, 0.2), (-0.2, -0.1)])
def test_the_controllers_box_contains_the_start(low, high):
    with pytest.raises(ParameterError, match=r"position_minimum.*has to contain the drive's start, 0 m"):
        resolve(None, {"impedance_mpc": {"position_minimum": low, "position_maximum": high}})


def test_wrong_parameters_end_with_2_and_leave_nothing(tmp_path, capsys):
    out = tmp_path / "ride"
    wrong = ["--set", "energy_monitor.limits.standard=en50367_dc"]
    assert carry_out(parse(["--out", str(out), *wrong])) == 2
    said = capsys.readouterr().err.splitlines()
    assert said == ["energy_monitor: parameter 'limits.standard' = 'en50367_dc' is not one of en50367_ac"]
    assert not out.exists()


@pytest.mark.slow
def test_the_defaults_and_the_rigs_give_no_notice():
    for rig in (None, "ideal", "nominal", "harsh"):
        assert notices(None, resolve(None, {}, rig)) == []


@pytest.mark.parametrize(
    ("node", "key", "value", "words"),
    [
        ("impedance_mpc", "rig_delay", 0.02, r"rig_delay = 20 ms does not fit .*command_delay = 0 cycles"),
        ("test_rig_sim", "command_delay", 2, r"rig_delay = 0.8423 ms does not fit .*command_delay = 2 cycles \(4 ms"),
        ("impedance_mpc", "position_maximum", 0.5, r"position_maximum = 0.5 m is beyond .*limits.position = 0.3 m"),
        ("test_rig_sim", "wait_for_subscribers", 3, r"wait_for_subscribers = 3: a ride itself has 2 .*waits for the"),
        ("test_rig_sim", "limits.reference_step", 0.001, r"velocity_limit = 2 m/s is more than .*reference_step"),
    ],
)
def test_what_does_not_fit_is_told(node, key, value, words):
    (told,) = notices(None, resolve(None, {node: {key: value}}))
    assert re.search(words, told)


def test_a_parameter_file_is_taken_as_ros_does_and_what_surprises_is_told(tmp_path):
    params = tmp_path / "mine.yaml"
    params.write_text(
        "test_rig_sim:\n  ros__parameters: {seed: 010}\n"
        "/ns/test_rig_sim:\n  ros__parameters: {seed: 5}\n"
        "rviz:\n  ros__parameters: {colour: 5}\n"
        "/**:\n  ros__parameters: {use_sim_time: true, qos_overrides: {/clock: {subscription: {depth: 3}}}}\n"
    )
    settings = resolve(params, {})
    assert settings["test_rig_sim"]["seed"] == 8
    assert all(values["use_sim_time"] is True for values in settings.values())
    told = notices(params, settings)
    assert told[0] == f"{params}, line 2: test_rig_sim.seed: 010 is read as 8, as ROS does"
    assert [line.split("'")[1] for line in told[1:3]] == ["/ns/test_rig_sim", "rviz"]
    assert "use_sim_time" in told[3]
    assert told[4].startswith("qos_overrides./clock.subscription.depth: has no effect")
    assert len(told) == 5


def test_a_node_twice_counts_twice(tmp_path):
    params = tmp_path / "mine.yaml"
    params.write_text(
        "test_rig_sim:\n  ros__parameters: {duration: 5.0, seed: 2}\n"
        "/test_rig_sim:\n  ros__parameters: {load_cell: {bias: 0.7}}\n"
        "test_rig_sim:\n  ros__parameters: {seed: 3}\n"
    )
    rig = resolve(params, {})["test_rig_sim"]
    assert (rig["duration"], rig["seed"], rig["load_cell.bias"]) == (5.0, 3, 0.7)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("test_rig_sim:\n  ros__parameters: {duration: 1:30}\n", "'duration' = '1:30' is not allowed"),
        ("test_rig_sim:\n  ros__parameters:\n    duration: 1:30\n", "'duration' = '1:30' is not allowed"),
        ("test_rig_sim:\n  ros__parameters: {seed: '5'}\n", "'seed' = '5' is not allowed"),
        ("test_rig_sim:\n  ros__parameters: {use_sim_time: 1}\n", "'use_sim_time' = 1 is not allowed: true or false"),
        ("test_rig_sim:\n  ros__parameters: {seed: &x 5, duration: *x}\n", "mine.yaml: line 2: ROS knows no aliases"),
        ("test_rig_sim:\n  ros__parameters:\n    seed:\n", "mine.yaml: line 3: 'seed' has no value"),
        ("test_rig:\n  ros__parameters: {seed: 5}\n", "there is no node 'test_rig'"),
        ("test_rig_sim:\n  ros_parameters:\n    seed: 5\n", "did you mean it by 'ros_parameters'"),
        ("test_rig_sim:\n  ros__parameters:\n", "mine.yaml: line 2: 'ros__parameters' without any parameter"),
    ],
)
def test_a_parameter_file_that_cannot_be_meant_is_refused(tmp_path, content, words):
    params = tmp_path / "mine.yaml"
    params.write_text(content)
    with pytest.raises(ParameterError, match=words):
        resolve(params, {})


def test_what_is_written_has_what_rclpy_itself_knows(tmp_path):
    from ride.settings import line_text, write

    params = tmp_path / "mine.yaml"
    params.write_text("/**:\n  ros__parameters: {use_sim_time: false}\n")
    settings = resolve(params, {})
    write(settings, line_text(settings), tmp_path)
    assert resolve(tmp_path / "params.yaml", {}) == settings


def test_several_parameter_files_are_all_taken(tmp_path):
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    first.write_text("test_rig_sim:\n  ros__parameters: {seed: 2, duration: 5.0}\n")
    second.write_text("test_rig_sim:\n  ros__parameters: {seed: 3}\n")
    given = parse(["--params", str(first), "--params", str(second)])
    rig = resolve(given.params, {})["test_rig_sim"]
    assert (rig["seed"], rig["duration"]) == (3, 5.0)
