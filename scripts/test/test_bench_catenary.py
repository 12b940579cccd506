"""The catenary's bench: the other ways it is measured against give the same wire, and all its tables are filled."""

import dataclasses
import json
import sys

import numpy as np
import pytest

from bench import __main__ as entry
from bench import catenary_competitors, catenary_phases
from bench.banded_lu import BandedLU
from bench.catenary import SPANS, UPLIFT, per_span
from bench.catenary_phases import GROUPS, PHASES
from bench.sparse_lu import SparseLU
from catenary_model import ride
from catenary_model.boundary import BOUNDARIES
from catenary_model.line import Line
from catenary_model.line_file import load_line
from catenary_model.model import Catenary, Config
from catenary_model.pantograph import Pantograph
from test_rig_sim.pantographs import PANTOGRAPHS

SAME = 1e-9
"""Rounding: about 1e-13 is seen. A lost coupling of two sites would show at 1e-6 and above."""
RIDDEN_IN, CYCLES = 1000, 40


def heavy(line: Line) -> Line:
    """Droppers of 0.6 kg, so that masses sit on both wires."""
    spans = [
        dataclasses.replace(span, droppers=tuple(dataclasses.replace(one, mass=0.6) for one in span.droppers))
        for span in line.spans
    ]
    return dataclasses.replace(line, spans=tuple(spans))


def small(line: Line) -> Config:
    """A domain of two spans on a coarse mesh."""
    return Config(
        line=line,
        start_position=30.0,
        element_length=1.25,
        layer_behind=30.0,
        layer_ahead=30.0,
        local_compliance=False,
        coupling_tolerance=1e-12,
    )


def force_of_a_pantograph(config: Config) -> np.ndarray:
    chain = PANTOGRAPHS["three_mass"]()
    # more than a real one: droppers go slack and taut again within these few cycles
    rider = Pantograph.of(chain.mass, chain.damping, chain.stiffness, 1.5 * UPLIFT)
    return ride.ride(Catenary(config), rider, (RIDDEN_IN + CYCLES) * config.cycle_time).F


@pytest.mark.parametrize("line", [load_line("en50318_2002"), heavy(load_line("en50318_2002"))], ids=["light", "heavy"])
@pytest.mark.slow
def test_other_ways_are_the_same_wire(line: Line) -> None:
    config = small(line)
    force = force_of_a_pantograph(config)
    before, after = np.split(force, [RIDDEN_IN])
    apart, solves = catenary_competitors.disagreement(config, before, after, (BandedLU, SparseLU))
    assert solves > 1  # a dropper changed its state
    for found in apart:
        assert found.slack_equal
        assert found.wire < SAME


def test_a_difference_would_be_seen() -> None:
    """The model's usual coupling tolerance leaves out something, and that is found."""
    config = small(load_line("en50318_2002"))
    before, after = np.split(force_of_a_pantograph(config), [RIDDEN_IN])
    loose = dataclasses.replace(config, coupling_tolerance=1e-2)
    ((banded,), _) = catenary_competitors.disagreement(loose, before, after, (BandedLU,))
    assert banded.wire > SAME


@pytest.mark.parametrize("changes", [{"local_compliance": True}, {"boundary": "controlled"}])
def test_refuses_what_the_coupled_matrix_does_not_know(changes: dict[str, object]) -> None:
    config = dataclasses.replace(small(load_line("en50318_2002")), boundary_nodes=20, **changes)
    with pytest.raises(ValueError, match="local_compliance"):
        BandedLU(config)


@pytest.mark.parametrize("boundary", ["matched_dashpot", "controlled"])
def test_phases_are_the_step_itself(boundary: str) -> None:
    """To the last bit: whoever changes the step's sequence has to change the phases too."""
    config = dataclasses.replace(small(load_line("en50318_2002")), boundary=boundary, local_compliance=True)
    force = 150.0 + 50.0 * np.sin(0.1 * np.arange(300))
    assert catenary_phases.same_bits(config, force)
    spent = catenary_phases.stages(Catenary(config), force)
    assert spent.shape == (force.size, len(PHASES))
    assert (spent > 0.0).all()


def test_every_phase_has_one_group() -> None:
    assert sorted(index for group in GROUPS.values() for index in group) == list(range(len(PHASES)))


def test_regression_over_spans() -> None:
    assert per_span({2: 7.0, 4: 11.0, 8: 19.0}) == pytest.approx((2.0, 3.0))


@pytest.mark.slow
def test_quick_bench_fills_every_table(monkeypatch: pytest.MonkeyPatch, tmp_path, capsys) -> None:
    target, pictures = tmp_path / "figures.json", tmp_path / "pictures"
    given = ["bench", "catenary", "--quick", "--json", str(target), "--out", str(pictures)]
    monkeypatch.setattr(sys, "argv", given)
    assert entry.main() == 0
    document = json.loads(target.read_text())
    names = [row["name"] for row in document["rows"]]
    assert [f"{spans} spans" for spans in SPANS] == names[: len(SPANS)]
    assert all(0.0 < row["median_ms"] <= row["p99_ms"] <= row["max_ms"] for row in document["rows"])
    assert [row["spans"] for row in document["spans"]] == list(SPANS)
    assert len(document["goals"]) == 6
    assert {row["boundary"] for row in document["boundaries"]} == set(BOUNDARIES)
    phases = {row["phase"]: row["us"] for row in document["phases"]}
    assert sum(phases[name] for name in GROUPS) == pytest.approx(phases["sum of the phases"])
    contests = document["competitors"]
    assert len({(row["mesh"], row["per"], row["way"]) for row in contests}) == len(contests) == 2 * 2 * 3
    assert all(row["us"] > 0.0 and row["ratio"] > 0.0 for row in contests)
    assert all(row["slack_equal"] for row in document["agreement"])
    assert len(list(pictures.glob("bench-catenary*.png"))) == 5
    said = capsys.readouterr().out
    for text in ("cost over spans", "share by phase", "against other ways", "load average", "SCHED_FIFO"):
        assert text in said
