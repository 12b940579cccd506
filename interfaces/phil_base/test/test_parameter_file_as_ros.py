"""The same parameter files for ROS and for our reader: rcl, through a real rclpy node, has the last word."""

from contextlib import contextmanager

import pytest
import rclpy
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.node import Node

from phil_base.parameter_file import is_rclpys, read_parameter_file
from phil_base.yaml_file import YamlError

HEAD = "rig:\n  ros__parameters:\n"
REFUSED = "refused"


@pytest.fixture(scope="module")
def context():
    found = rclpy.Context()
    found.init()
    # The participant of DDS goes with a context's last node. Fast DDS now and then waits for ever for the listener of
    # one that goes while it is being discovered; here one is enough for all.
    keeper = Node("keeper", context=found, use_global_arguments=False, start_parameter_services=False)
    yield found
    keeper.destroy_node()
    found.try_shutdown()


@contextmanager
def node(context, paths, namespace):
    made = Node(
        "rig",
        context=context,
        namespace=namespace,
        cli_args=["--ros-args", *(word for each in paths for word in ("--params-file", str(each)))],
        automatically_declare_parameters_from_overrides=True,
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=False,
    )
    yield made
    made.destroy_node()


def comparable(values):
    """Types as well as values, NaN equal to itself."""
    plain = {key: list(value) if hasattr(value, "tolist") else value for key, value in values.items()}
    return {key: repr(value) for key, value in plain.items()}


def of_ros(context, paths, namespace):
    try:
        with node(context, paths, namespace) as made:
            found = made.get_parameters_by_prefix("")
            return comparable({key: entry.value for key, entry in found.items() if not _default(key, entry.value)})
    except (RuntimeError, ValueError):  # rcl refuses the file; rclpy has no type for an empty list
        return REFUSED


def of_ours(paths, namespace):
    try:
        values = read_parameter_file(*paths).values(f"{namespace}/rig")
    except YamlError as error:
        assert str(error).startswith(str(paths[0].parent))
        assert "line" in str(error)
        assert "\n" not in str(error)
        return REFUSED
    if None in values.values():
        return REFUSED
    return comparable({key: value for key, value in values.items() if not _default(key, value)})


def _default(key, value):
    """Rclpy declares these on every node."""
    return (key, value) in (("use_sim_time", False), ("start_type_description_service", True))


def check(context, folder, *contents, namespace=""):
    paths = [folder / f"{i}.yaml" for i in range(len(contents))]
    for path, content in zip(paths, contents, strict=True):
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    found = of_ros(context, paths, namespace)
    assert of_ours(paths, namespace) == found
    return found


NAMES = [
    "rig",
    "/rig",
    "ns/rig",
    "/ns/rig",
    "/**",
    "/*",
    "'**'",
    "'*'",
    "/**/rig",
    "/*/rig",
    "/ns/**",
    "/ns/*",
    "/**/*",
]
NAMES += [
    "/**/*",
    "other",
    "/",
    "//rig",
    "ns//rig",
    "/rig/",
    "1rig",
    "my-rig",
    "/a*/rig",
    "/***",
    "'**/rig'",
    "~/rig",
    "''",
]


@pytest.mark.parametrize("name", NAMES)
def test_a_name_reaches_the_same_nodes(context, tmp_path, name):
    for namespace in ("", "/ns", "/ns/deep"):
        check(context, tmp_path, f"{name}:\n  ros__parameters: {{a: 1}}\n", namespace=namespace)


SCALARS = r"""
1 010 08 0x1F 0X1f 0o10 0b11 -5 +3 -010 00 -0 0_1 1_000 1:30 60:00 1,5 9223372036854775807 9223372036854775808 0x -
-9223372036854775809 99999999999999999999 1.5 .5 5. 1e3 1E3 1e-6 1.0e-06 1e 1e400 -1e400 1e-310 5e-324 2.3e-308 0x1p3
0x1.8 nan NaN .nan .NaN .NAN -.nan inf Infinity infinit .inf -.INF +.Inf .iNf -inf + . .. --5 yes Yes yES no On off y N
true TRUE tRUE false ~ null Null 2024-01-01 12:30:00 hello "5" '5' "yes" "" '' "a\0b" "\x35" !!str_5 !!int_"5" !!float_5
!!bool_yes !!str_010 !own_5 &anchor_5 *anchor [] [1,2] [1,2.0] [1.5,2.0] [yes,no] [a,b] [a,1] [1,] [[1,2]] [[1],[2]]
[{b:_1}] {} {b:_1} {b:_{c:_1,d:_2},e:_3} [~,null] ["1",'2'] [08,010] é €
"""
"""With _ for a space before a value; 0_1 and 1_000 are meant."""


def test_a_scalar_has_the_same_type_and_value(context, tmp_path):
    for word in SCALARS.split():
        scalar = word if word[0].isdigit() else word.replace("_", " ")
        check(context, tmp_path, f"{HEAD}    a: {scalar}\n    z: 1\n")
    for style in ("|", "|-", ">", ">-", "|2-"):
        for text in ("5", "yes", "two\n      lines", "  5"):
            check(context, tmp_path, f"{HEAD}    a: {style}\n      {text}\n    z: 1\n")


FILES = {
    "nothing": "",
    "a comment": "# nothing\n",
    "a node twice": "rig:\n  ros__parameters: {a: 1, b: 1}\nrig:\n  ros__parameters: {a: 2, c: 1}\n",
    "with and without slash": "rig:\n  ros__parameters: {a: 1}\n/rig:\n  ros__parameters: {a: 2}\n",
    "without and with slash": "/rig:\n  ros__parameters: {a: 1}\nrig:\n  ros__parameters: {a: 2}\n",
    "three blocks": HEAD + "    a: 1\n/rig:\n  ros__parameters: {a: 2}\nrig:\n  ros__parameters: {a: 3}\n",
    "wildcard after": "rig:\n  ros__parameters: {a: 1}\n/**:\n  ros__parameters: {a: 2}\n",
    "wildcard before": "/**:\n  ros__parameters: {a: 1, b: 1}\nrig:\n  ros__parameters: {a: 2}\n",
    "nested namespace": "ns:\n  rig:\n    ros__parameters: {a: 1}\n  other:\n    ros__parameters: {a: 2}\n",
    "root and node": "/:\n  rig:\n    ros__parameters: {a: 1}\n",
    "parameter twice": HEAD + "    a: 1\n    a: 2\n",
    "twice, other type": HEAD
    + "    a: hello\n    a: 1\n    b: 1\n    b: hello\n    c: 1\n    c: [1, 2]\n    d: [a]\n    d: [1]\n",
    "group twice": HEAD + "    g: {a: 1, b: 1}\n    g: {a: hello}\n    g.b: 7\n",
    "parameter and group": HEAD + "    g: 5\n    g: {a: 1.5}\n    h: {a: 1}\n    h: 2\n",
    "dotted names": HEAD + "    g.a: 1\n    g: {a: 2}\n    g.h: {i: 1}\n",
    "empty group": HEAD + "    g: {}\n",
    "empty group and more": HEAD + "    g: {}\n    a: 1\n",
    "no value": HEAD + "    a:\n",
    "no parameters": HEAD,
    "no mapping": "rig: 5\n",
    "a list": "- 1\n",
    "no ros__parameters": "rig:\n  a: 1\n",
    "something beside": "rig:\n  ros__parameters: {a: 1}\n  b: 2\n",
    "ros__parameters twice": "rig:\n  ros__parameters: {a: 1}\n  ros__parameters: {b: 1}\n",
    "key that begins so": "rig:\n  ros__parameters_of_mine: {a: 1}\n",
    "alias": HEAD + "    a: &x 1\n    b: *x\n",
    "merge key": HEAD + "    <<: {a: 1}\n",
    "odd keys": HEAD + "    5: 1\n    yes: 1\n    'a b': 1\n    ~: 1\n",
    "empty key": HEAD + "    '': 1\n",
    "list as a key": HEAD + "    ? [1]\n    : 2\n",
    "two documents": f"{HEAD}    a: 1\n---\n{HEAD}    b: 1\n",
    "YAML 1.1": f"%YAML 1.1\n---\n{HEAD}    a: 1\n",
    "a tab": HEAD + "\ta: 1\n",
    "unclosed": HEAD + "    a: [1, 2\n",
    "line ends of DOS": (HEAD + "    a: 1\n    b: hello\n").replace("\n", "\r\n"),
    "byte order mark": b"\xef\xbb\xbf" + HEAD.encode() + b"    a: 1\n",
    "UTF-16": (HEAD + "    a: \u00e4\n").encode("utf-16"),
    "latin-1": (HEAD + "    a: \u00e4\n").encode("latin-1"),
    "zero byte": HEAD.encode() + b"    a: 1\x00\n",
    "of rclpy": HEAD + "    use_sim_time: true\n    qos_overrides: {/x: {publisher: {depth: 3}}}\n",
    "of rclpy, off": HEAD + "    start_type_description_service: false\n",
}


@pytest.mark.parametrize("what", FILES)
def test_a_file_means_the_same(context, tmp_path, what):
    check(context, tmp_path, FILES[what])


keys = st.sampled_from(["a", "b", "c", "a.b", "group", '"a"', "5", "yes", "use_sim_time", '"b c"', "ros__parameters"])
# Not in braces: libyaml before 0.2.1, which the wheels have, refuses 1:30 there, and takes a comma into a tag.
WORDS = "1 010 08 0x1F -5 1.5 1e3 .5 1e-6 1_000 yes No off y ~ .nan -.Inf inf '5' hello 1e400 2 x"
scalars = st.sampled_from(WORDS.split())
lists = st.lists(scalars, max_size=3).map(lambda entries: f"[{', '.join(entries)}]")
values = st.recursive(
    scalars | scalars | lists,
    lambda inner: st.lists(st.tuples(keys, inner), max_size=3).map(
        lambda pairs: "{" + ", ".join(f"{key}: {value}" for key, value in pairs) + "}"
    ),
    max_leaves=6,
)
blocks = st.lists(st.tuples(keys, values), max_size=4).map(
    lambda pairs: "{ros__parameters: {" + ", ".join(f"{key}: {value}" for key, value in pairs) + "}}"
)
nodes = st.sampled_from(["rig", "/rig", "/**", "/*", "ns/rig", "/**/rig", "other"])
files = st.lists(
    st.tuples(nodes, blocks | st.tuples(nodes, blocks).map(lambda pair: f"{{{pair[0]}: {pair[1]}}}")), max_size=3
).map(lambda pairs: "".join(f"{name}: {content}\n" for name, content in pairs))


@settings(max_examples=60)
@given(files, st.sampled_from(["", "/ns"]))
@pytest.mark.slow
def test_any_file_means_the_same(context, tmp_path_factory, content, namespace):
    check(context, tmp_path_factory.getbasetemp(), content, namespace=namespace)


SEVERAL = [
    (HEAD + "    a: 1\n    b: 1\n", HEAD + "    a: 2\n    c: 2\n"),
    (HEAD + "    a: 1\n", HEAD + "    a: hello\n"),
    ("/**:\n  ros__parameters: {a: 1}\n", HEAD + "    a: 2\n", "/**:\n  ros__parameters: {a: 3, b: 3}\n"),
    (HEAD + "    a: 1\n", "/rig:\n  ros__parameters: {a: 2}\n", HEAD + "    a: 3\n"),
    (HEAD + "    g: {a: 1}\n", "", HEAD + "    g: {a: 2, b: 2}\n"),
    (HEAD + "    a: 1\n", "rig: [\n"),
]


@pytest.mark.parametrize("contents", SEVERAL)
def test_several_files_mean_the_same(context, tmp_path, contents):
    check(context, tmp_path, *contents)


def test_what_is_checked_is_not_nothing(context, tmp_path):
    found = check(
        context, tmp_path, "rig:\n  ros__parameters: {a: 010, b: '5', c: [1.5]}\n/**:\n  ros__parameters: {d: on}\n"
    )
    assert found == {"a": "8", "b": "'5'", "c": "[1.5]", "d": "True"}


def test_a_number_that_reads_otherwise_elsewhere_is_told(tmp_path):
    path = tmp_path / "params.yaml"
    path.write_text(
        HEAD + "    a: 010\n    b: '010'\n    c: 10\n    d: 1e3\n    e: 0x10\n    f: 08\n    g: 1e400\n    h: yes\n"
    )
    told = list(read_parameter_file(path).readings())
    assert told[0] == f"{path}, line 3: rig.a: 010 is read as 8, as ROS does"
    assert told[1:] == [f"{path}, line 9: rig.g: 1e400 is read as the text '1e400', as ROS does"]


def test_a_last_word_of_another_type_that_ros_does_not_take_is_told(context, tmp_path):
    pairs = [("a", "1", "2.5"), ("b", "2.5", "1"), ("c", "x", "[1]"), ("d", "1", "2"), ("e", "1", "'2'")]
    content = HEAD + "".join(f"    {key}: {first}\n    {key}: {last}\n" for key, first, last in pairs)
    assert check(context, tmp_path, content) == {"a": "1", "b": "1", "c": "'x'", "d": "2", "e": "1"}
    told = list(read_parameter_file(tmp_path / "0.yaml").readings())
    assert [line.split("0.yaml, ")[1].split(",")[0] for line in told] == [
        "line 4: rig.a: 2.5 is not taken",
        "line 8: rig.c: [1] is not taken",
        "line 12: rig.e: '2' is not taken",
    ]
    assert told[0].endswith("but 1 of another type, given before, as ROS does")


def test_what_rclpy_declares_is_known(context, tmp_path):
    path = tmp_path / "params.yaml"
    path.write_text("")
    with node(context, [path], "") as made:
        declared = list(made.get_parameters_by_prefix(""))
    assert declared
    assert all(is_rclpys(name) for name in declared)
    assert not is_rclpys("seed")
