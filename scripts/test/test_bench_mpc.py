"""The controller's bench: recorded problems are the ride's own, solvers agree on them, all its tables are filled."""

import dataclasses
import json
import sys

import numpy as np
import pytest

from bench import __main__ as entry
from bench import mpc, mpc_contest, mpc_split, mpc_tables
from bench.mpc_contest import Entry, accuracy, certificate, contest, run_through
from bench.mpc_problems import Sequence, distance, excess, residuals, violation
from bench.mpc_record import controller_of, record
from bench.mpc_solvers import CONTROLLER, PROXIMAL, SOLVERS, Known, version
from phil_loop import ClosedLoop, Moment

CYCLES = 150
EXACT = 1e-8
"""mm, N: two exact methods differ by rounding, 1e-11 is seen; the longest entries of z are 200."""
FIRST_MOVE_UM, FIRST_MOVE_N = 2.0, 0.01
"""What the tolerances of the iterative solvers are set for, doubled: far below what a load cell and an encoder resolve
and far above rounding. A wrongly stated problem (a bound lost, a soft row taken for hard) shows at 10 um and more."""


@pytest.fixture(scope="module")
def sequences() -> dict[str, Sequence]:
    """Both recorded sequences, short."""
    return mpc.recorded(CYCLES)


@pytest.fixture(scope="module")
def reference(sequences: dict[str, Sequence]) -> dict[str, np.ndarray]:
    return {key: run_through(CONTROLLER, sequence)[1] for key, sequence in sequences.items()}


def test_recorded_problems_are_those_of_the_ride() -> None:
    plans = []

    def note(moment: Moment) -> None:
        moves, correction = controller_of(moment.loop).plan
        plans.append((*moves, *correction))

    loop = ClosedLoop(mpc.settings((20.0, 10, 5)), observers=[note], limits=False)
    sequence = record(loop, 40)
    _, solutions, solved = run_through(CONTROLLER, sequence)
    assert solved.all()
    # the controller clips what a solution's tolerance leaves beyond the box
    sent = np.clip(solutions, sequence.box_lower, sequence.box_upper)
    sent[:, : sequence.correction] *= 1e-3
    assert np.array_equal(sent, np.array(plans))


@pytest.mark.slow
def test_sequences_are_hard_enough(sequences: dict[str, Sequence], reference: dict[str, np.ndarray]) -> None:
    """The correction force is at its bounds, and soft rows of the drive are broken."""
    ride, limits = sequences[mpc.RIDE], sequences[mpc.AT_LIMITS]
    for key, sequence in sequences.items():
        first = reference[key][:, sequence.correction]
        lower, upper = (box[:, sequence.correction] for box in (sequence.box_lower, sequence.box_upper))
        assert np.mean((first <= lower + 1e-9) | (first >= upper - 1e-9)) > 0.2
    assert ride.softness is not None
    rows, _ = excess(limits, np.ones(limits.count, dtype=bool), reference[mpc.AT_LIMITS])
    assert np.mean((np.abs(rows) > 1e-9).sum(axis=1) >= 3) > 0.5


@pytest.mark.slow
def test_controllers_solutions_fulfil_the_conditions(
    sequences: dict[str, Sequence], reference: dict[str, np.ndarray]
) -> None:
    """Checked without any solver."""
    for key, sequence in sequences.items():
        beyond, away = certificate(sequence, reference[key], 5)
        assert beyond < mpc.EXACT
        assert away < EXACT


@pytest.mark.parametrize("entry_of_z", [0, 7, 25])
def test_conditions_notice_a_wrong_solution(
    sequences: dict[str, Sequence], reference: dict[str, np.ndarray], entry_of_z: int
) -> None:
    """One entry off by 1 um or 1 mN: by as much off the solution, or beyond a hard bound."""
    for key, sequence in sequences.items():
        for k in (3, 70, 140):
            wrong = reference[key].copy()
            wrong[k, entry_of_z] += 1e-3
            beyond = violation(sequence, np.ones(sequence.count, dtype=bool), wrong)
            assert max(beyond, distance(sequence, k, wrong[k])) > 0.3e-3


def test_soft_rows_written_with_variables_are_the_same_program(
    sequences: dict[str, Sequence], reference: dict[str, np.ndarray]
) -> None:
    for key, sequence in sequences.items():
        hard = sequence.hardened()
        assert hard.softness is None
        assert hard.hessian.shape[0] == sequence.hessian.shape[0] + int((sequence.softness > 0.0).sum())
        _, solutions, solved = run_through("DAQP", sequence)
        assert solved.all()
        assert np.abs(solutions - reference[key]).max() < EXACT


@pytest.mark.parametrize("name", [name for name in SOLVERS if name not in (CONTROLLER, "DAQP", "ProxQP, AVX2")])
@pytest.mark.slow
def test_other_solvers_agree(name: str, sequences: dict[str, Sequence], reference: dict[str, np.ndarray]) -> None:
    if version(name) is None:
        pytest.skip(f"{SOLVERS[name].package} is not installed: python -m pip install --group bench")
    for key, sequence in sequences.items():
        _, solutions, solved = run_through(name, sequence)
        # An augmented Lagrangian or an interior point may give up on one problem of a hard sequence.
        assert np.mean(solved) > 0.98
        good = accuracy(sequence, reference[key], Entry(solutions=solutions, solved=solved))
        assert good.reference < FIRST_MOVE_UM
        assert good.correction < FIRST_MOVE_N


@pytest.mark.parametrize("name", [name for name in SOLVERS if name != "ProxQP, AVX2"])
@pytest.mark.parametrize("row", [True, False], ids=["row", "box"])
@pytest.mark.slow
def test_contradictory_bounds_are_not_solved(name: str, row: bool, sequences: dict[str, Sequence]) -> None:
    """By no solver's own word, and the problems after them are solved as if nothing had been."""
    if version(name) is None:
        pytest.skip(f"{SOLVERS[name].package} is not installed: python -m pip install --group bench")
    sequence = sequences[mpc.RIDE].part(slice(100, 110))
    sequence = dataclasses.replace(sequence, lower=sequence.lower.copy(), box_lower=sequence.box_lower.copy())
    for k, by in ((3, 2e-6), (6, 1.0)):
        if row:
            sequence.lower[k, 5] = sequence.upper[k, 5] + by
        else:
            sequence.box_lower[k, 3] = sequence.box_upper[k, 3] + by
    wanted = [k not in (3, 6) for k in range(10)]
    assert mpc_contest.answers(name, sequence)[2].tolist() == wanted
    assert run_through(name, sequence)[2].tolist() == wanted


def test_solved_is_judged_alike_for_all(
    monkeypatch: pytest.MonkeyPatch, sequences: dict[str, Sequence], reference: dict[str, np.ndarray]
) -> None:
    """A solver that hands out its old solution as solved is found out; the residual is how far a solution is off."""
    sequence, truth = sequences[mpc.AT_LIMITS], reference[mpc.AT_LIMITS]
    assert residuals(sequence, truth).max() < EXACT

    class Lazy:
        def __init__(self, sequence: Sequence) -> None:
            self.z = truth[0]

        def solve(self, *problem: np.ndarray) -> bool:
            return True

    monkeypatch.setitem(SOLVERS, "lazy", Known("none", Lazy, "none", soft_rows=True))
    assert mpc_contest.answers("lazy", sequence)[2].all()
    assert run_through("lazy", sequence)[2].tolist() == [True, *[False] * (sequence.count - 1)]
    chance = np.random.default_rng(2)
    for size in (1e-5, 1e-4):
        wrong = truth[::10] + size * chance.normal(size=truth[::10].shape)
        found = residuals(sequence.part(slice(None, None, 10)), wrong)
        assert (found > 0.3 * size).all() and (found < 100.0 * size).all()
    wrong = truth[:3].copy()
    wrong[1, 4] = np.nan
    assert np.isfinite(residuals(sequence.part(slice(0, 3)), wrong)).tolist() == [True, False, True]


def test_accuracy_finds_planted_differences(sequences: dict[str, Sequence], reference: dict[str, np.ndarray]) -> None:
    sequence, truth = sequences[mpc.RIDE], reference[mpc.RIDE]
    solutions, solved = truth.copy(), np.ones(sequence.count, dtype=bool)
    solutions[10, 0] += 5e-3
    solutions[11, sequence.correction] -= 0.25
    solutions[12], solved[12] = np.nan, False
    good = accuracy(sequence, truth, Entry(solutions=solutions, solved=solved))
    assert good.reference == pytest.approx(5.0)
    assert good.correction == pytest.approx(0.25)
    assert good.gap > 0.0


def test_same_numbers_elsewhere_in_memory(sequences: dict[str, Sequence]) -> None:
    sequence = sequences[mpc.RIDE].part(slice(0, 60))
    moved = sequence.shifted()
    for name in ("hessian", "rows", "gradient", "upper"):
        assert np.array_equal(getattr(moved, name), getattr(sequence, name))
        assert getattr(moved, name).ctypes.data % 16 == 8
    assert np.array_equal(run_through(CONTROLLER, moved)[1], run_through(CONTROLLER, sequence)[1])


def test_differences_in_the_last_bit_are_seen(sequences: dict[str, Sequence], reference: dict[str, np.ndarray]) -> None:
    solutions = reference[mpc.RIDE]
    solved, times = np.ones(len(solutions), dtype=bool), np.ones(len(solutions))
    entry, other = Entry(), solutions.copy()
    other[5, 3] = np.nextafter(other[5, 3], np.inf)
    for found, same in ((solutions, True), (solutions, True), (other, False), (other, False)):
        mpc_contest._note(entry, times, found, solved)
        assert entry.same_again is same


@pytest.mark.slow
def test_a_solver_that_cannot_work_takes_no_part(sequences: dict[str, Sequence]) -> None:
    short = {mpc.RIDE: sequences[mpc.RIDE].part(slice(0, 10))}
    entries, failed = contest([CONTROLLER, "nobody's"], short, 1)
    assert list(entries[mpc.RIDE]) == [CONTROLLER]
    assert "nobody's" in failed["nobody's"]


def test_clocks_in_the_parts_change_nothing_of_the_ride() -> None:
    splitting = mpc_split.Splitting(mpc.settings((20.0, 10, 5)), 10)
    splitting.block(20, 5)
    splitting.block(20, 5)
    split = splitting.split
    assert {len(split.spent[part]) for part in mpc_split.PARTS} == {len(split.whole)} == {30}
    assert all(min(split.spent[part]) > 0.0 for part in mpc_split.PARTS)
    plain, inside = (controller_of(loop) for loop in (splitting.plain, splitting.inside))
    assert np.array_equal(plain.plan[0], inside.plan[0])
    assert plain.books == mpc_split.Books(**dataclasses.asdict(inside.books))


@pytest.mark.slow
def test_quick_bench_fills_every_table(monkeypatch: pytest.MonkeyPatch, tmp_path, capsys) -> None:
    """With those solvers only that every set-up has, so that it says what is missing."""
    present = (CONTROLLER, PROXIMAL, "DAQP")
    for module in (mpc, mpc_tables):
        monkeypatch.setattr(module, "version", lambda name: version(name) if name in present else None)
    monkeypatch.setattr(mpc, "CASES", mpc.CASES[:2])
    target, pictures = tmp_path / "figures.json", tmp_path / "pictures"
    monkeypatch.setattr(sys, "argv", ["bench", "mpc", "--quick", "--json", str(target), "--out", str(pictures)])
    assert entry.main() == 0
    document = json.loads(target.read_text())
    assert all(0.0 < row["median_ms"] <= row["p99_ms"] <= row["max_ms"] for row in document["rows"])
    assert len(document["rows"]) == len(document["cases"]) == 2
    assert {row["name"].split(",")[0] for row in document["goals"]} == {"median", "p99"}
    parts = {row["part"]: row["us"] for row in document["parts"]}
    whole = parts.pop("whole cycle")
    assert sum(parts.values()) == pytest.approx(whole)
    for key in (mpc.RIDE, mpc.AT_LIMITS):
        assert [row["solver"] for row in document[f"solvers_{key}"]] == list(present)
        for row in document[f"agreement_{key}"]:
            assert row["same_again"] == row["same_elsewhere"] == "same"
            assert row["u_um"] < EXACT * 1e3
    assert {row["solver"] for row in document["solver_kinds"]} == set(SOLVERS)
    assert len(list(pictures.glob("bench-mpc*.png"))) == 4
    said = capsys.readouterr().out
    for text in ("goals", "parts of a cycle", "Not installed: ProxQP", "pip install --group bench", "load average"):
        assert text in said


@pytest.mark.slow
def test_same_matrices_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits that change more than bounds would not be the same solver's sequence."""
    monkeypatch.setattr(mpc, "LIMITS", {"qp_tolerance": 1e-7, "rig_damping_ratio": 0.7})
    with pytest.raises(RuntimeError, match="more than the bounds"):
        mpc.recorded(5)


def test_parts_of_a_sequence(sequences: dict[str, Sequence]) -> None:
    sequence = sequences[mpc.RIDE]
    part = sequence.part(slice(20, 25))
    assert part.count == 5
    assert np.array_equal(part.problem(0)[0], sequence.problem(20)[0])
    assert dataclasses.replace(sequence, softness=None).hardened().hessian is sequence.hessian
