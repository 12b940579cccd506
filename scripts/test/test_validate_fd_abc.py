"""Absorbing boundaries by optimisation: a shortened run holds, ends that reflect or grow do not."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catenary_model import absorbing
from catenary_model.absorbing import incidence
from phil_study.outcome import Outcome, Row
from validate import fd_abc, fd_abc_beam

pytestmark = pytest.mark.slow

SAID: list[str] = []
GUIDE = Path(__file__).resolve().parents[2] / "docs" / "absorbing_boundaries.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fd_abc")


@pytest.fixture(scope="module")
def kept() -> list[incidence.Incidence]:
    """Result over the angle of the shortened run, to be used again."""
    return []


@pytest.fixture(scope="module")
def outcome(folder: Path, kept: list[incidence.Incidence]) -> Outcome:
    original = incidence.incidence

    def keeping(**given: Any) -> incidence.Incidence:
        kept.append(original(**given))
        return kept[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(incidence, "incidence", keeping)
        return fd_abc.run(True, folder, SAID.append)


@pytest.fixture
def angles(outcome: Outcome, kept: list[incidence.Incidence]) -> incidence.Incidence:
    assert outcome.overviews
    return kept[0]


def by_name(rows: list[Row]) -> dict[str, Row]:
    return {row.name: row for row in rows}


def test_a_shortened_run_holds(outcome: Outcome) -> None:
    assert [row.name for row in outcome.rows if row.holds is False] == []
    assert all(np.isfinite(row.value) for row in (*outcome.rows, *outcome.details))
    held = {(row.case, row.name) for row in outcome.rows if row.holds}
    case = "2-D, tuned for normal incidence"
    assert {(case, f"reflected at {angle} degrees") for angle in range(0, 61, 5)} <= held
    for name in ("waves", "pulse in time", "packets in time"):
        assert any(of == fd_abc.LOSSLESS and name in what for of, what in held)
    assert SAID


def test_files_of_a_run(outcome: Outcome, folder: Path) -> None:
    """Pictures are there; the coefficients that are written are those that were judged."""
    assert outcome.rows
    for name in ("snapshots", "reflection", "angle", "square"):
        assert (folder / f"fd_abc_{name}.png").read_bytes().startswith(b"\x89PNG")
    stencil, (end,), info = absorbing.read_file(folder / "fd_abc_beam_without_damping.json")
    reflected = np.abs(absorbing.reflection(stencil, end, np.geomspace(0.5, 30.0, 50))).max()
    row = next(row for row in outcome.rows if row.name == "reflected, 0.5 to 30 Hz, waves")
    assert 100.0 * reflected == pytest.approx(row.value, rel=0.02)
    assert info["radii"]["whole"] < 1.0
    scheme, (side, _), _ = absorbing.read_file(folder / "fd_abc_wave_2d_tuned_for_0.json")
    assert scheme.dims == 2
    assert side.coefficients.shape[1:] == incidence.SHAPE


def case_of(end: absorbing.BoundaryStencil) -> fd_abc_beam.Case:
    stencil = fd_abc_beam.beam(0.0)
    given = absorbing.Design(stencil, end, fd_abc_beam.WEIGHTING, np.nan, np.nan, np.nan, ())
    return fd_abc_beam.measured("given", stencil, given, True, SAID.append)


def test_a_clamped_end_fails() -> None:
    """It returns all of a wave, by analysis (rounding) and in time (2 %: a packet disperses on its way), for ever."""
    rows = by_name(fd_abc.beam_rows(case_of(absorbing.clamped(fd_abc_beam.beam(0.0), "left"))))
    assert rows["reflected, 0.5 to 30 Hz, waves"].value == pytest.approx(100.0, rel=1e-9)
    assert rows["reflected, packets in time"].value == pytest.approx(100.0, rel=0.02)
    for name in ("0.5 to 30 Hz, waves", "pulse in time", "packets in time"):
        assert rows[f"reflected, {name}"].holds is False
    for name in ("snapshots against the long beam", "spectral radius - 1, small domain", "spectral radius - 1, 100 m"):
        assert rows[name].holds is False


def test_an_end_that_grows_fails() -> None:
    """Its nodes move away by a per mille a step: the eigenvalues say so exactly (rounding), the long run shows it."""
    c = np.zeros((2, 2, 2))
    c[0, 1, 0] = c[1, 1, 1] = 1.001
    rows = by_name(fd_abc.beam_rows(case_of(absorbing.BoundaryStencil(c))))
    for name in ("small domain", "100 m"):
        assert rows[f"spectral radius - 1, {name}"].value == pytest.approx(1e-3, rel=1e-6)
        assert rows[f"spectral radius - 1, {name}"].holds is False
    parts = fd_abc_beam.BLOCKS - 2
    steps = fd_abc_beam.SHORT_RUN // fd_abc_beam.BLOCKS
    last = rows["last part of the long run"]
    assert last.value == pytest.approx(1.001 ** (parts * steps), rel=0.01)
    assert last.holds is False


def test_a_boundary_of_first_order_fails(angles: incidence.Incidence) -> None:
    """Put in the place of the tuned one it is above Engquist and Majda's second order from 20 degrees on."""
    swapped = angles._replace(worst={**angles.worst, fd_abc.NORMAL: angles.worst["EM 1"]})
    rows = by_name([row for row in fd_abc.angle_rows(swapped) if row.case == fd_abc.CASES[fd_abc.NORMAL]])
    assert all(rows[f"reflected at {angle} degrees"].holds is False for angle in range(20, 61, 5))
    shares = {
        form: rows[f"largest share of Engquist-Majda 2, {form}"] for form in ("diagonal", "centred", "box scheme")
    }
    assert [row.holds for row in shares.values()] == [False, False, None]
    assert shares["centred"].high == shares["diagonal"].high == 1.0


def test_the_box_scheme_is_engquist_and_majdas_condition(angles: incidence.Incidence) -> None:
    """Either reflects tan(a/2)^4 on a fine grid, 11.1 % at 60 degrees; this grid differs by up to half a percent."""
    most = fd_abc.amplitudes(angles)[fd_abc.BOX]
    exact = 100.0 * np.tan(np.radians(angles.degrees) / 2.0) ** 4
    inside = angles.degrees <= 60.0
    np.testing.assert_allclose(most[inside], exact[inside], atol=0.6)


def test_the_bump_leaves_on_the_left_alone() -> None:
    """By T8 both packets are out: what is left of 0.5 m is far below the goal; a clamped end keeps them."""
    stencil = fd_abc_beam.beam(0.0)
    good = fd_abc_beam.snapshots(stencil, fd_abc_beam.one_way(stencil))
    kept = fd_abc_beam.snapshots(stencil, absorbing.clamped(stencil, "left"))
    assert good.frames[0].max() == pytest.approx(fd_abc_beam.DEFLECTION)
    assert np.abs(good.frames[-1]).max() < 0.01 * fd_abc_beam.DEFLECTION
    assert np.abs(kept.frames[-1]).max() > 0.3 * fd_abc_beam.DEFLECTION
    np.testing.assert_allclose(good.frames[:3], good.exact[:3], atol=1e-12)


def test_the_twenty_lines_of_the_guide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They run as they stand, take no more than twenty lines, and reflect less than a per cent."""
    text = GUIDE.read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len([line for line in code.splitlines() if line.strip()]) <= 20
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(code, names)
    assert names["echo"].max() < 0.01
    assert names["frames"].shape == (501, 161)
    assert absorbing.read_file(tmp_path / "string_on_bed.json")[1][0].side == "left"


def test_pictures_of_the_guide_are_there() -> None:
    named = re.findall(r"!\[[^]]*\]\(([^)]+)\)", GUIDE.read_text(encoding="utf-8"))
    assert len(named) >= 6
    assert [name for name in named if not (GUIDE.parent / name).is_file()] == []
