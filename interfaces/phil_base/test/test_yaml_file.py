"""One reader for the YAML files of our own, and what is written so that every reader takes it for the same."""

import math

import pytest
import rclpy
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import parameter_dict_from_yaml_file

from phil_base.parameter_file import read_parameter_file
from phil_base.parameters import nest
from phil_base.yaml_file import YamlError, dump_yaml, parse_yaml, read_yaml
from ride.settings import NODES, resolve


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("010", 10), ("-007", -7), ("0o10", 8), ("0x1F", 31), ("+5", 5), ("1e-3", 1e-3), ("1E3", 1000.0), (".5", 0.5),
        ("5.", 5.0), ("-.5e1", -5.0), ("1.0e+05", 1e5), ("08", 8), ("08.5", 8.5), ("1:30", "1:30"), ("60:00", "60:00"),
        ("1_000", "1_000"), ("1,5", "1,5"), ("0b11", "0b11"), ("yes", "yes"), ("off", "off"),
        ("y", "y"),         ("True", True), ("false", False), ("", None), ("~", None), ("null", None),
        ("2024-01-01", "2024-01-01"), ("=", "="),
        (".inf", math.inf), ("-.Inf", -math.inf), ("inf", "inf"), ("nan", "nan"), ("1e400", math.inf), ("'5'", "5"),
        ("!!str 5", "5"), ("!!float 5", 5.0), ("9223372036854775808", 2.0**63), ("9" * 5000, math.inf), ("0o9", "0o9"),
        ("\ufeffa: 1\r\nb: 2\r\n", {"a": 1, "b": 2}), ("{1: a, yes: b}", {"1": "a", "yes": "b"}),
    ],
)  # fmt: skip
def test_a_value_is_that_of_yaml_1_2(text, value):
    found = parse_yaml(text)
    assert found == value
    assert type(found) is type(value)


def test_nan_is_a_number():
    assert math.isnan(parse_yaml(".nan"))


def test_anchors_and_merge_keys_save_writing():
    text = "first: &wire {mass: 1.0, damping: 0.2}\nsecond: {<<: *wire, damping: 0.3}\nthird: *wire\n"
    tree = parse_yaml(text)
    assert tree["second"] == {"mass": 1.0, "damping": 0.3}
    assert tree["third"] == tree["first"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"a: 1\nb: 2\na: 3\n", "line 3: 'a' is given twice, first in line 1"),
        (b"x: {a: 1, 'a': 2}\n", "line 1: 'a' is given twice, first in line 1"),
        (b"- {b: {c: 1,\n  c: 1}}\n", "line 2: 'c' is given twice, first in line 1"),
        (b"a: 1\n---\nb: 2\n", "line 2: but found another document"),
        (b"a: 1\nb:\n\tc: 2\n", r"line 3: .*tab"),
        (b"a: [1, 2\n", "line 1"),
        ("a: 1\nb: \u00e4\n".encode("latin-1"), "line 2: byte 0xe4 is not UTF-8"),
        ("a: 1\n".encode("utf-16"), "line 1: byte 0xff is not UTF-8"),
        (b"a: 1\nb: \x00\n", "not allowed|control characters"),
        (b"a: &x [*x]\n", "line 1: an entry refers to itself"),
        (b"a: *x\n", "line 1: found undefined alias"),
        (b"? [1]\n: 2\n", "line 1: a key has to be a text"),
        (b"a: !!float fast\n", "line 1: 'fast' is no float"),
        (b"a: !!python/name:os.system\n", "line 1: could not determine a constructor"),
        (b"[" * 5000, "nested too deeply|line 1"),
    ],
)
def test_what_cannot_be_used_is_one_line_with_file_and_line(tmp_path, content, words):
    path = tmp_path / "mine.yaml"
    path.write_bytes(content)
    with pytest.raises(YamlError, match=words) as caught:
        read_yaml(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_said_so(tmp_path):
    with pytest.raises(YamlError, match=r"none\.yaml: cannot be read: No such file"):
        read_yaml(tmp_path / "none.yaml")


scalars = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_subnormal=False)
    | st.sampled_from(
        ["yes", "1e3", "010", "1:30", "0x1p3", "nan", "~", "", "=", "a: b", "# c", "1_000", "08", "<<", "a\nb"]
    )
    | st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
)
lists = st.lists(st.floats(allow_nan=False, allow_subnormal=False), min_size=1, max_size=4)


@pytest.fixture(scope="module")
def context():
    found = rclpy.Context()
    found.init()
    yield found
    found.try_shutdown()


@settings(max_examples=40)
@given(values=st.lists(scalars | lists, min_size=1, max_size=8))
@example(values=[1e-6, 1e-05, 1e22, 1e300, -0.0, 2.0, 100.0, 2.2250738585072014e-308, math.inf, -math.inf, 5, -3])
def test_what_is_written_is_the_same_to_every_reader(context, tmp_path_factory, values):
    values = {f"p{i}": value for i, value in enumerate(values)}
    path = tmp_path_factory.getbasetemp() / "written.yaml"
    path.write_text(dump_yaml({"rig": {"ros__parameters": values}}), encoding="utf-8")
    node = Node(
        "rig",
        context=context,
        cli_args=["--ros-args", "--params-file", str(path)],
        automatically_declare_parameters_from_overrides=True,
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=False,
    )
    of_ros = {key: node.get_parameter(key).value for key in values}
    node.destroy_node()
    readers = {
        "rcl": {key: list(value) if hasattr(value, "tolist") else value for key, value in of_ros.items()},
        "our reader of parameter files": read_parameter_file(path).values("/rig"),
        "YAML 1.1": yaml.safe_load(path.read_text(encoding="utf-8"))["rig"]["ros__parameters"],
        "YAML 1.2": read_yaml(path)["rig"]["ros__parameters"],
    }
    for reader, found in readers.items():
        assert {key: repr(value) for key, value in found.items()} == {k: repr(v) for k, v in values.items()}, reader


def test_rclpys_loader_takes_every_number_of_a_ride_for_one(tmp_path):
    """But for those that str() writes with an exponent and no point: rclpy reads str() of what it has read again."""
    wanted = resolve(None, {"energy_monitor": {"tolerance.relative": 1.5e-6}})
    number = {float: ParameterType.PARAMETER_DOUBLE, int: ParameterType.PARAMETER_INTEGER}
    for name in NODES:
        path = tmp_path / f"{name}.yaml"
        path.write_text(dump_yaml({name: {"ros__parameters": nest(wanted[name])}}))
        found = parameter_dict_from_yaml_file(str(path))
        assert found.keys() == wanted[name].keys()
        for key, value in wanted[name].items():
            if type(value) in number and ("e" not in str(value) or "." in str(value)):
                assert found[key].value.type == number[type(value)], key
