"""Files appear whole or not at all."""

import os
import resource
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from phil_base.atomic import together, whole, write_text

CUT = 4096
"""Bytes that a process may write into a file; the text that it tries to write is longer."""


def limited(code: str, place: Path) -> subprocess.CompletedProcess[str]:
    """Run code in a process whose files cannot grow beyond CUT bytes, as on a disk that fills up."""
    lead = "import signal, sys, pathlib\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
    lead += f"place = pathlib.Path({str(place)!r})\n"
    return subprocess.run(
        [sys.executable, "-c", lead + code],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (CUT, CUT)),
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.mark.parametrize("before", [None, "what was there"])
def test_a_disk_that_fills_up_leaves_what_was_there(tmp_path: Path, before: str | None) -> None:
    file = tmp_path / "result.json"
    if before is not None:
        file.write_text(before)
    done = limited(f"from phil_base.atomic import write_text\nwrite_text(place, 'x' * {2 * CUT})", file)
    assert done.returncode == 1 and "File too large" in done.stderr and str(file) in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ([] if before is None else [file.name])
    assert before is None or file.read_text() == before


def test_the_figures_of_a_study_are_whole_or_the_old_ones(tmp_path: Path) -> None:
    file = tmp_path / "figures.json"
    file.write_text("{}")
    code = f"from phil_base.command_line import write_json\nsys.exit(not write_json(place, ['x' * {2 * CUT}]))"
    done = limited(code, file)
    assert (done.returncode, done.stderr) == (1, f"--json {file} cannot be written: File too large\n")
    assert file.read_text() == "{}" and list(tmp_path.iterdir()) == [file]


def test_a_text_is_written_as_it_is_for_everybody(tmp_path: Path) -> None:
    file, plain = tmp_path / "text", tmp_path / "plain"
    write_text(file, "µ\n")
    plain.write_text("µ\n", encoding="utf-8")
    assert file.read_bytes() == plain.read_bytes()
    assert stat.S_IMODE(file.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


def test_a_link_stays_one(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    file, link = tmp_path / "elsewhere" / "file", tmp_path / "link"
    file.write_text("old")
    link.symlink_to(file)
    write_text(link, "new")
    assert link.is_symlink() and file.read_text() == "new"
    assert [path.name for path in file.parent.iterdir()] == ["file"]


def test_a_pipe_is_written_to(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True) as reader:
        write_text(pipe, "through")
        assert reader.communicate(timeout=60)[0] == "through"
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_nothing_is_seen_before_its_end(tmp_path: Path) -> None:
    file = tmp_path / "file"
    with whole(file) as draft:
        draft.write_text("all")
        assert not file.exists()
    assert file.read_text() == "all" and list(tmp_path.iterdir()) == [file]


def test_files_that_belong_together_come_together(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    with together(tmp_path) as drafts:
        (drafts / "a").write_text("new")
        (drafts / "deep").mkdir()
        (drafts / "deep" / "b").write_text("new")
        assert (tmp_path / "a").read_text() == "old" and not (tmp_path / "deep").exists()
    assert (tmp_path / "a").read_text() == (tmp_path / "deep" / "b").read_text() == "new"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "deep"]


def test_of_what_was_broken_off_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")

    def broken_off() -> None:
        with together(tmp_path) as drafts:
            (drafts / "a").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        broken_off()
    assert (tmp_path / "a").read_text() == "old" and len(list(tmp_path.iterdir())) == 1
