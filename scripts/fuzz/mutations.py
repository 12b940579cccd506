"""Ways to damage a file, as hypothesis strategies: bytes, words of a text, cells of a database; up to three at once.

What is large or entangled is made here at run time; nothing of it lies about as a file.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hypothesis import strategies as st

from fuzz.words import WORDS

Damage = Callable[[bytes], bytes]

_WORD = re.compile(rb"[\w.+-]+")
_PLACES = st.integers(0, 2**31 - 1)
_COUNTS = st.sampled_from((1, 2, 3, 50, 2000))
_EXTREMES = (0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**63, 2**64 - 1)

_TEXTS = (
    "", "0", "-1", "1", "1e-300", "1e308", "1e400", "-1e400", ".nan", "nan", ".inf", "inf", "-.inf", "1e5", "010",
    "0o17", "99999999999999999999", "1:30", "1_000", "true", "off", "~", "null", "[]", "{}", "[[]]", "[1, 2]", "{a: 1}",
    "- 1",
    "*none", "&here", "!!int x", "!!float 1", "!!binary aGk=", "!!set {a}", "!!python/tuple [1]", "!own 1", "<<",
    "'", '"',
    "|", "? a", ": ", "#", "%YAML 1.2", "---", "...", "\t", "\\", "\x1b[31m", "\u2028", "\u202e", "\U0001f600",
    "a" * 300,
    "/", "..", "~nobody/x.yaml", "/dev/null", ",", ";", "1,2",
)  # fmt: skip
_VALUES = st.one_of(
    st.sampled_from(_TEXTS),
    st.floats(width=64).map(repr),
    st.integers(-(2**70), 2**70).map(str),
    st.text(max_size=12),
).map(lambda text: text.encode("utf-8", "surrogatepass"))


def _entangled(depth: int) -> bytes:
    """Give a mapping in which each list holds the one before it twice: 2^depth entries for who unfolds them."""
    lists = [f"  a{i}: &a{i} [*a{i - 1}, *a{i - 1}]" for i in range(1, depth)]
    return "\n".join(["entangled:", "  a0: &a0 [1, 1]", *lists, ""]).encode()


def _put(content: bytes, begin: int, end: int, new: bytes) -> bytes:
    return content[:begin] + new + content[end:]


def _slice(content: bytes, first: int, second: int) -> tuple[int, int]:
    size = len(content) + 1
    begin = first % size
    return begin, min(begin + second % 64 + 1, len(content))


def _flip(at: int, bit: int) -> Damage:
    def flip(content: bytes) -> bytes:
        if not content:
            return content
        i = at % len(content)
        return _put(content, i, i + 1, bytes([content[i] ^ (1 << bit)]))

    return flip


def _overwrite(at: int, number: int, size: int) -> Damage:
    new = (number & (256**size - 1)).to_bytes(size, "little")
    return lambda content: _put(content, at % (len(content) + 1), at % (len(content) + 1) + size, new)


def _cut(at: int) -> Damage:
    return lambda content: content[: at % (len(content) + 1)]


def _without(first: int, second: int) -> Damage:
    return lambda content: _put(content, *_slice(content, first, second), b"")


def _repeated(first: int, second: int, count: int) -> Damage:
    def repeat(content: bytes) -> bytes:
        begin, end = _slice(content, first, second)
        return _put(content, begin, begin, content[begin:end] * count)

    return repeat


def _exchanged(first: int, second: int, length: int) -> Damage:
    def exchange(content: bytes) -> bytes:
        (a, b), (c, d) = sorted((_slice(content, first, length), _slice(content, second, length)))
        return content if c < b else content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]

    return exchange


def _inserted(at: int, new: bytes) -> Damage:
    return lambda content: _put(content, at % (len(content) + 1), at % (len(content) + 1), new)


def _always(new: bytes) -> Damage:
    return lambda content: new


BYTES: st.SearchStrategy[Damage] = st.one_of(
    st.builds(_flip, _PLACES, st.integers(0, 7)),
    st.builds(_overwrite, _PLACES, st.sampled_from(_EXTREMES), st.sampled_from((1, 2, 4, 8))),
    st.builds(_cut, _PLACES),
    st.builds(_without, _PLACES, _PLACES),
    st.builds(_repeated, _PLACES, _PLACES, _COUNTS),
    st.builds(_exchanged, _PLACES, _PLACES, _PLACES),
    st.builds(
        _inserted, _PLACES, st.one_of(st.binary(max_size=32), st.sampled_from((b"\0", b"\0" * 4096, b"\xff\xfe")))
    ),
    st.just(_always(b"")),
)
"""Of any file."""


def _words(content: bytes) -> list[tuple[int, int]]:
    return [match.span() for match in _WORD.finditer(content)]


def _other_word(at: int, new: bytes) -> Damage:
    def change(content: bytes) -> bytes:
        words = _words(content)
        return _put(content, *words[at % len(words)], new) if words else new

    return change


def _swapped_words(first: int, second: int) -> Damage:
    def swap(content: bytes) -> bytes:
        words = _words(content)
        if not words:
            return content
        (a, b), (c, d) = sorted((words[first % len(words)], words[second % len(words)]))
        return content if a == c else content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]

    return swap


def _lines(change: Callable[[list[bytes]], list[bytes]]) -> Damage:
    return lambda content: b"".join(change(content.splitlines(keepends=True)))


def _moved_line(first: int, second: int, keep: bool) -> Damage:
    def move(lines: list[bytes]) -> list[bytes]:
        if not lines:
            return lines
        line = lines[first % len(lines)]
        rest = lines if keep else [other for i, other in enumerate(lines) if i != first % len(lines)]
        at = second % (len(rest) + 1)
        return [*rest[:at], line, *rest[at:]]

    return _lines(move)


def _lost_line(at: int) -> Damage:
    return _lines(lambda lines: [line for i, line in enumerate(lines) if not lines or i != at % len(lines)])


def _indented(at: int, by: bytes) -> Damage:
    return _lines(lambda lines: [by + line if i == at % len(lines) else line for i, line in enumerate(lines)])


def _swapped_columns(separator: bytes) -> Damage:
    return _lines(lambda lines: [separator.join(reversed(line.rstrip().split(separator))) + b"\n" for line in lines])


def _nested(count: int, bracket: bytes) -> bytes:
    return bracket * count + b"1" + {b"[": b"]", b"{a: ": b"}"}.get(bracket, b"") * count


TEXT: st.SearchStrategy[Damage] = st.one_of(
    st.builds(_other_word, _PLACES, _VALUES),
    st.builds(_other_word, _PLACES, _VALUES),
    st.builds(
        _other_word, _PLACES, st.builds(lambda text, count: text * count, st.sampled_from((b"9", b"a")), _COUNTS)
    ),
    st.builds(_other_word, _PLACES, st.builds(_nested, _COUNTS, st.sampled_from((b"[", b"{a: ", b"- ")))),
    st.builds(_swapped_words, _PLACES, _PLACES),
    st.builds(_moved_line, _PLACES, _PLACES, st.booleans()),
    st.builds(_lost_line, _PLACES),
    st.builds(_indented, _PLACES, st.sampled_from((b" ", b"\t", b"  ", b"- ", b"# ", b"\x0c"))),
    st.just(_swapped_columns(b",")),
    st.just(_swapped_columns(b": ")),
    st.just(lambda content: content.replace(b"\n", b"\r\n")),
    st.just(lambda content: content.replace(b"\n", b"\r")),
    st.just(lambda content: content.replace(b"\n", b" ")),
    st.just(lambda content: b"\xef\xbb\xbf" + content),
    st.just(lambda content: content.decode("utf-8", "replace").encode("utf-16")),
    st.builds(lambda depth: lambda content: content + b"\n" + _entangled(depth), st.sampled_from((4, 30, 60))),
    st.builds(lambda count: lambda content: content + b"\n" + b"x" * 1000 * count + b": 1\n", _COUNTS),
    BYTES,
)
"""Of a text: YAML or CSV."""


def _cells(table: int, column: int, every: int, new: Any) -> Damage:
    def change(connection: sqlite3.Connection) -> None:
        tables = [row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        name = tables[table % len(tables)]
        columns = [row[1] for row in connection.execute(f'PRAGMA table_info("{name}")')]
        chosen = columns[column % len(columns)]
        connection.execute(f'UPDATE OR REPLACE "{name}" SET "{chosen}" = ? WHERE rowid % ? = 0', (new, every))

    return _sql(change)


def _other_table(table: int, what: str) -> Damage:
    def change(connection: sqlite3.Connection) -> None:
        tables = [row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        connection.execute(what.format(f'"{tables[table % len(tables)]}"'))

    return _sql(change)


def _sql(change: Callable[[sqlite3.Connection], None]) -> Damage:
    def apply(content: bytes) -> bytes:
        with TemporaryDirectory(prefix="phil_fuzz_") as folder:
            file = Path(folder) / "bag.db3"
            file.write_bytes(content)
            try:
                with closing(sqlite3.connect(file)) as connection:
                    change(connection)
                    connection.commit()
            except (sqlite3.Error, OverflowError, ZeroDivisionError):
                return content  # damaged by the change before
            return file.read_bytes()

    return apply


_STATEMENTS = ("DROP TABLE {}", "DELETE FROM {}", "ALTER TABLE {} RENAME TO other")

DATABASE: st.SearchStrategy[Damage] = st.one_of(
    st.builds(
        _cells,
        _PLACES,
        _PLACES,
        st.sampled_from((1, 2, 7)),
        st.one_of(
            st.none(), st.floats(), st.integers(-(2**63), 2**63 - 1), st.text(st.characters(codec="utf-8"), max_size=8),
            st.binary(max_size=64), st.just(b"\0" * 10**5),
        ),
    ),
    st.builds(_other_table, _PLACES, st.sampled_from(_STATEMENTS)),
    BYTES,
)  # fmt: skip
"""Of an sqlite3 file."""

DAMAGES = {"text": TEXT, "bytes": BYTES, "database": DATABASE, "words": WORDS}


def mutants(content: bytes, form: str) -> st.SearchStrategy[bytes]:
    """Give contents damaged one to three times; ``form`` is one of `DAMAGES`."""

    def damaged(damages: list[Damage]) -> bytes:
        found = content
        for damage in damages:
            found = damage(found)
        return found

    return st.lists(DAMAGES[form], min_size=1, max_size=3).map(damaged)
