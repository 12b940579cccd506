"""The recorder's command line and what it says at the end, without ROS."""

import subprocess
import sys

import pytest

from energy_monitor.definitions import Definition
from energy_monitor.record import arguments, complaint, look_period, main, without_ros_arguments
from energy_monitor.recorder import Channel


@pytest.mark.parametrize(
    "argv",
    [
        ["--duration", "nan"],
        ["--duration", "-1"],
        ["--duration", "inf"],
        ["--duration", "soon"],
        ["--topics", "a//b"],
        ["--topics", "state", "1x"],
        ["--topics", ""],
        ["--topics", "a b"],
        ["--expect-topics", "a/"],
        ["--namespace", "/lab/"],
        ["--namespace", "lab-1"],
        ["--nonsense"],
        ["--namespace", "x" * 240],
        ["--topics", "x" * 300],
        ["--namespace", "y" * 150, "--topics", "x" * 100],
        ["--ready-file", "/proc/none/ready"],
        ["--ready-file", "/tmp"],
        ["--out", ""],
        ["--out", "\udcff"],
    ],
)
def test_a_wrong_command_line_is_one_line_and_code_2(argv, capsys):
    with pytest.raises(SystemExit) as ended:
        main(argv)
    assert ended.value.code == 2
    out, error = capsys.readouterr()
    assert out == "" and error.startswith("record: ") and error.count("\n") == 1


def test_a_right_command_line():
    found = arguments(["--topics", "state", "/lab/state", "~/x", "--namespace", "/lab", "--duration", "2.5"])
    assert found.topics == ["state", "/lab/state", "~/x"]
    assert (found.namespace, found.duration) == ("/lab", 2.5)
    assert arguments(["--namespace", "/"]).namespace == "/"


@pytest.mark.parametrize("wrong", [["-p"], ["--nonsense"], ["-r", "\udcff:=b"]])
def test_wrong_arguments_of_ros_are_one_line_and_leave_no_bag(wrong, tmp_path):
    command = [sys.executable, "-m", "energy_monitor.record", "--out", str(tmp_path / "bag"), "--ros-args", *wrong]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("record: ROS cannot take its arguments: ") and done.stderr.count("\n") == 1
    assert not (tmp_path / "bag").exists()


def test_arguments_of_ros_are_left_to_ros():
    assert without_ros_arguments(["--all", "--ros-args", "-r", "a:=b", "--", "--out", "x"]) == ["--all", "--out", "x"]
    assert without_ros_arguments(["--all", "--ros-args", "-r", "a:=b"]) == ["--all"]


def test_new_topics_are_looked_for_often_at_first():
    assert [look_period(at, False) for at in (0.0, 29.9, 30.1)] == [0.2, 0.2, 1.0]
    assert look_period(100.0, True) <= 0.2


def test_lost_messages_are_named():
    channels = [Channel(name, "t", Definition("", ""), lost=lost) for name, lost in (("/b", 2), ("/a", 1), ("/c", 0))]
    assert complaint(channels) == "3 messages were lost, the bag has gaps: /a 1, /b 2"
    assert complaint(channels[2:]) is None
