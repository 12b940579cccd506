"""Ways to damage a command line, as hypothesis strategies: options and values, changed, lost, doubled, made up.

No absolute folder is here that could be made: what comes of the damage is done, in the folder of the case.
"""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import strategies as st

Damage = Callable[[bytes], bytes]
Words = list[bytes]

_PLACES = st.integers(0, 2**31 - 1)
_NUMBERS = (
    "nan", "inf", "-inf", "-1", "0", "-0", "1", "2.5", "1e9", "1e300", "1e400", "-1e400", "1e-320", "1_0", "\u0663",
    "0x10", "1,5", " 5", "5 ", "5s", "+5", ".5", "5.", "1:30", "9" * 30, "9" * 5000, "true", "null",
)  # fmt: skip
_PLACES_ON_DISK = (
    "", ".", "..", "file", "file/below", "ride", "ride/bag", "ride/params.yaml", "new", "new/and/deeper", "/dev/null",
    "/dev/full", "/dev/zero", "/dev/null/below", "/proc/none", "/proc/self/mem", "/sys/none", "a" * 300, "a/" * 3000,
    "~nobody/x", "a b", "\x1b[31mred", "two\nlines", "\u202e", "\U0001f600", "%s%n", "[/red]", "{}",
)  # fmt: skip
_NAMES = (
    "nominal", "en50318", "nothing", "lockstep", "realtime", "fe", "realtime ", "REALTIME", "catenary", "a" * 2000,
    "__class__", "kill-*", "[", "*", "a//b", "/dev/null/lab", "~/x", "x" * 300, "1x", "HEAD", "--upload-pack=x",
)  # fmt: skip
_NODES = ("catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor", "nobody", "*", "**", "")
_KEYS = (
    "speed_kmh", "line", "duration", "mode", "cycle_time", "seed", "pantograph", "pantograph_file", "control",
    "limits.position", "limits", "trajectory.file", "operating_mode", "discretisation", "real_time.priority",
    "use_sim_time", "unknown", "", "a..b", "limits.file",
)  # fmt: skip
_TEXTS = (
    "{}", "{a: 1}", "[1, 2]", "[", "&a [*a]", "!!python/tuple [1]", "!!binary aGk=", "'", "|", "[" * 3000, "file",
    "yes",
)  # fmt: skip

_ANY_TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0/-"), max_size=12)
_SET = st.builds(
    lambda node, key, sign, value: f"{node}.{key}{sign}{value}",
    st.sampled_from(_NODES),
    st.sampled_from(_KEYS),
    st.sampled_from(("=", "=", "=", ":=", "")),
    st.sampled_from((*_NUMBERS, *_PLACES_ON_DISK, *_NAMES, *_TEXTS)),
)
_RULES = st.builds(
    lambda name, sign, value: f"{name}{sign}{value}",
    st.sampled_from(("__ns", "__node", "speed_kmh", "~/state", "a/b", "nobody:__ns", "", "rostopic://x", "a b")),
    st.sampled_from((":=", ":=", ":=", "=", "")),
    st.sampled_from((*_NUMBERS, *_PLACES_ON_DISK, *_NAMES, *_TEXTS)),
)
_LETTERS = st.one_of(
    st.sampled_from(_NUMBERS),
    st.sampled_from(_PLACES_ON_DISK),
    st.sampled_from(_NAMES),
    st.floats().map(repr),
    st.integers(-(2**70), 2**70).map(str),
    _SET,
    _RULES,
    _ANY_TEXT,
).map(lambda text: text.encode("utf-8", "surrogatepass"))
_BYTES = st.sampled_from((b"\xff\xfe", b"file\x80", b"\xed\xa0\x80"))
_VALUES = st.one_of(_LETTERS, _LETTERS, _LETTERS, _BYTES)
_OPTIONS = (
    b"--speed-kmh", b"--duration", b"--mode", b"--seed", b"--rig", b"--params", b"--set", b"--out", b"--overwrite",
    b"--no-bag", b"--json", b"--topics", b"--namespace", b"--ready-file", b"--expect-topics", b"--recover", b"--limits",
    b"--run-in", b"--ride", b"--rate", b"--seconds", b"--against", b"--pairs", b"--quick", b"--short", b"--list",
    b"--update-docs", b"--minutes", b"--viewers", b"--domain", b"--bags", b"--mutations", b"--bag", b"--repeat",
    b"--ros-args", b"-r", b"-p", b"--params-file", b"--log-level", b"--", b"-", b"-h", b"--help", b"--no",
    b"--nonsense", b"-x", b"--out=", b"--json=", b"@file", b"--=", b"---",
)  # fmt: skip


def _words(change: Callable[[Words], Words]) -> Damage:
    """Make a damage of what changes the words after the command."""

    def damage(content: bytes) -> bytes:
        name, *words = content.split(b"\0")
        return b"\0".join([name, *change(words)])

    return damage


def _value(at: int, new: bytes) -> Damage:
    def change(words: Words) -> Words:
        places = [i for i, word in enumerate(words) if not word.startswith(b"-")]
        if not places:
            return [*words, new]
        i = places[at % len(places)]
        return [*words[:i], new, *words[i + 1 :]]

    return _words(change)


def _within(at: int, new: bytes) -> Damage:
    """Change what stands after the last ``=`` or ``:=`` of a word: a value of NODE.KEY=VALUE."""

    def change(words: Words) -> Words:
        places = [i for i, word in enumerate(words) if b"=" in word]
        if not places:
            return words
        i = places[at % len(places)]
        return [*words[:i], words[i].rpartition(b"=")[0] + b"=" + new, *words[i + 1 :]]

    return _words(change)


def _at(at: int, change: Callable[[bytes], Words]) -> Damage:
    def changed(words: Words) -> Words:
        if not words:
            return words
        i = at % len(words)
        return [*words[:i], *change(words[i]), *words[i + 1 :]]

    return _words(changed)


def _added(at: int, new: Words) -> Damage:
    def change(words: Words) -> Words:
        i = at % (len(words) + 1)
        return [*words[:i], *new, *words[i:]]

    return _words(change)


def _again(first: int, second: int) -> Damage:
    """Say an option twice, its value with it, or another one."""

    def change(words: Words) -> Words:
        if not words:
            return words
        i = first % len(words)
        j = second % (len(words) + 1)
        return [*words[:j], *words[i : i + 2], *words[j:]]

    return _words(change)


def _swapped(first: int, second: int) -> Damage:
    def change(words: Words) -> Words:
        if not words:
            return words
        found = list(words)
        i, j = first % len(words), second % len(words)
        found[i], found[j] = found[j], found[i]
        return found

    return _words(change)


def _joined(at: int) -> Damage:
    def change(words: Words) -> Words:
        if len(words) < 2:
            return words
        i = at % (len(words) - 1)
        return [*words[:i], words[i] + b"=" + words[i + 1], *words[i + 2 :]]

    return _words(change)


def _shorter(at: int, by: int) -> Damage:
    return _at(at, lambda word: [word[: len(word) - by % (len(word) + 1)]])


WORDS: st.SearchStrategy[Damage] = st.one_of(
    st.builds(_value, _PLACES, _VALUES),
    st.builds(_value, _PLACES, _VALUES),
    st.builds(_value, _PLACES, _VALUES),
    st.builds(_within, _PLACES, _VALUES),
    st.builds(_at, _PLACES, st.just(lambda word: [])),
    st.builds(_added, _PLACES, st.builds(lambda option: [option], st.sampled_from(_OPTIONS))),
    st.builds(_added, _PLACES, st.builds(lambda option, value: [option, value], st.sampled_from(_OPTIONS), _VALUES)),
    st.builds(
        _added, _PLACES, st.builds(lambda option, value: [option + b"=" + value], st.sampled_from(_OPTIONS), _VALUES)
    ),
    st.builds(_added, st.just(2**30), st.builds(lambda value: [b"--set", value], _SET.map(str.encode))),
    st.builds(_again, _PLACES, _PLACES),
    st.builds(_swapped, _PLACES, _PLACES),
    st.builds(_joined, _PLACES),
    st.builds(_shorter, _PLACES, st.integers(1, 8)),
    st.just(_words(lambda words: [])),
    st.just(_words(lambda words: words * 3)),
)
"""Of a command line."""

Lines = dict[str, tuple[str, ...]]


def examples() -> Lines:
    """Give good command lines of every command, a value for every option."""
    return {
        "ride": (
            "--overwrite",
            "--speed-kmh 200 --duration 5 --pantograph en50318 --line alternating_spans --mode lockstep --seed 3",
            "--params ride/params.yaml --rig nominal --set impedance_mpc.control=integrated --out new --no-report",
            "--overwrite --no-bag --ordinary-scheduling --discretisation fd --out ride",
            "--set catenary_model.speed_kmh=200 --set test_rig_sim.seed=5 --set test_rig_sim.operating_mode=position",
        ),
        "record": (
            "--out new --duration 5 --namespace /dev/null/lab --topics state /dev/null/lab/state",
            "--all --ready-file ready --expect-topics state command",
            "--recover ride --out new",
            "--out new --ros-args -r __ns:=/dev/null/lab -p use_sim_time:=false",
        ),
        "analyze": ("ride --out new --json numbers.json --ride 1 --run-in 0.01", "ride --params ride/params.yaml"),
        "bench": (
            "realtime --json numbers.json --out new --rate 1000 --seconds 20 --disturbed",
            "realtime --against HEAD --pairs 3 --quick --set test_rig_sim.seed=5",
            "catenary --quick --json numbers.json",
        ),
        "validate": ("en50318 --quick --json numbers.json --out new",),
        "faults": ("kill-* --rate 500 --json numbers.json --out new", "--short", "--list", "--update-docs"),
        "soak": (
            "--minutes 1 --rate 500 --mode realtime --viewers 2 --out new --json numbers.json",
            "--set test_rig_sim.seed=5",
        ),
        "doctor": ("--json numbers.json --seconds 3 --domain 5 --bags new",),
        "fuzz": ("yaml --mutations 10 --seed 3 --out new --json numbers.json", "bag --bag ride/bag"),
        "node": (
            "--ros-args --params-file ride/params.yaml -r __ns:=/dev/null/lab -r state:=other --log-level info",
            "--ros-args -p speed_kmh:=200.0 -p line:=single_wire --remap __node:=rig -- beside",
        ),
    }  # fmt: skip


def content(command: str, line: str) -> bytes:
    """Give a command line as a file has it."""
    return b"\0".join(word.encode() for word in [command, *line.split()])
