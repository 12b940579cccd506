"""The examples run and leave their picture."""

import re
import runpy
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from catenary_model import absorbing

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_readme_names_every_example() -> None:
    told = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    scripts = [path.name for path in EXAMPLES.glob("*.py")]
    assert scripts
    assert [name for name in scripts if f"| `{name}` |" not in told] == []


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run an example with options, look at its picture, return what it printed."""

    def run(name: str, *options: str) -> str:
        script = EXAMPLES / f"{name}.py"
        monkeypatch.setattr(sys, "argv", [str(script), "--out", str(tmp_path), *options])
        monkeypatch.setattr(sys, "path", list(sys.path))
        runpy.run_path(str(script), run_name="__main__")
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        return capsys.readouterr().out

    return run


def numbers(pattern: str, told: str) -> list[float]:
    """Give the number that the pattern's group catches in each line that it fits."""
    return [float(found) for found in re.findall(pattern, told)]


@pytest.mark.slow
def test_wave_past_dropper(run: Callable[..., str]) -> None:
    """A taut dropper sends back what two strings with a tie do, within half a per cent; a slack one less."""
    told = run("wave_past_dropper", "--force", "50", "1200")
    taut, slack = numbers(r": ([\d.]+) % sent back", told)
    assert taut == pytest.approx(numbers(r"taut: ([\d.]+) %", told)[0], abs=0.5)
    assert slack < 0.9 * taut


@pytest.mark.slow
def test_clamped_against_absorbed(run: Callable[..., str]) -> None:
    clamped, absorbed, layers = numbers(r"error ([\d.]+) %", run("clamped_against_absorbed", "--duration", "4.5"))
    assert absorbed < 0.5 * clamped
    assert layers < 0.5 * absorbed


@pytest.mark.slow
def test_speed_sweep(run: Callable[..., str]) -> None:
    told = run("speed_sweep", "--speeds", "2", "--spans", "3")
    slow, fast = numbers(r"\+- (\d+) N", told)
    assert fast > 5.0 * slow


@pytest.mark.slow
def test_uneven_spans(run: Callable[..., str]) -> None:
    """The force repeats itself with the line: the strongest wave fits a whole number of times into a period."""
    told = run("uneven_spans", "--line", "alternating_spans", "--periods", "4")
    (waves,) = numbers(r"= ([\d.]+) waves", told)
    assert waves == pytest.approx(round(waves), abs=0.1)


def test_an_unknown_line_is_said_in_one_message(run: Callable[..., str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        run("speed_sweep", "--line", "no_such_line")
    assert refused.value.code == 2
    assert "presets are" in capsys.readouterr().err


def test_sag_and_stiffness(run: Callable[..., str]) -> None:
    told = run("sag_and_stiffness", "--line", "en50318_2002", "--force", "100")
    assert "en50318_2002: lowest -8.1 mm" in told
    assert "2046 to 5053 N/m" in told


@pytest.mark.slow
def test_absorbing_boundary(run: Callable[..., str], tmp_path: Path) -> None:
    """Below a per cent by waves and in time, where a string's own end is far above; stable; the file says the same."""
    told = run("absorbing_boundary")
    absorbing_end, string_end, held = numbers(r"at most ([\d.]+) % reflected", told)
    assert absorbing_end < 1.0 < 20.0 < string_end < held == 100.0
    absorbing_end, string_end, held = numbers(r"Hz, ([\d.]+) % of the initial", told)
    assert absorbing_end < 0.5 < 5.0 < string_end < held
    assert numbers(r"absorbing: .* radius - 1: ([-+.e\d]+)", told)[0] < -1e-7
    stencil, (end,), _ = absorbing.read_file(tmp_path / "absorbing_boundary.json")
    assert abs(absorbing.reflection(stencil, end, np.array([10.0]))[0]) < 0.01
