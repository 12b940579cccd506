"""The contest of the solvers: each in a process of its own, in turns, over the same recorded sequences of problems."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.mpc_problems import GOOD, Sequence, distance, objective, residuals, violation
from bench.mpc_solvers import SOLVERS
from bench.turns import first

Array = NDArray[np.float64]
BLOCK = 0.1
"""Time after which a worker lets the processor go, s; about."""


def run_through(name: str, sequence: Sequence) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Solve a sequence from a fresh start; give times (N,) in s, solutions (N, nz), and what was solved (N,).

    Solved is what its solver says is, and what fulfils the conditions of optimality: the same measure for all.
    """
    times, solutions, claimed = answers(name, sequence)
    return times, solutions, claimed & (residuals(sequence, solutions) <= GOOD)


def answers(name: str, sequence: Sequence) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Like :func:`run_through`, but what was solved is the solver's own word."""
    known = SOLVERS[name]
    count, size = sequence.gradient.shape
    sequence = sequence if known.soft_rows else sequence.hardened()
    solver = known.make(sequence)
    times, solutions, solved = np.zeros(count), np.zeros((count, size)), np.zeros(count, dtype=np.bool_)
    k = 0
    while k < count:
        with first():
            ends = perf_counter_ns() + BLOCK * 1e9
            while k < count and perf_counter_ns() < ends:
                problem = sequence.problem(k)
                begun = perf_counter_ns()
                solved[k] = solver.solve(*problem)
                times[k] = perf_counter_ns() - begun
                solutions[k] = solver.z[:size]
                k += 1
    return times * 1e-9, solutions, solved


def _work(connection: Connection, name: str, sequences: dict[str, Sequence], odd: bool) -> None:
    """Serve one solver: for each name of a sequence that comes in, solve it and send back what came out."""
    kept = []
    judged: dict[str, tuple[Array, NDArray[np.bool_]]] = {}
    if odd:
        # Another heap: blocks of odd sizes, every other one given back, and all data 8 bytes off.
        kept = [np.empty(17 + 13 * (i % 29)) for i in range(4000)][::2]
        sequences = {key: sequence.shifted() for key, sequence in sequences.items()}
    try:
        connection.send(None)
        while (wanted := connection.recv()) is not None:
            times, solutions, claimed = answers(name, sequences[wanted])
            # The same answers as in the round before need not be judged again.
            if wanted not in judged or not np.array_equal(judged[wanted][0], solutions, equal_nan=True):
                judged[wanted] = solutions, residuals(sequences[wanted], solutions) <= GOOD
            connection.send((times, solutions, claimed & judged[wanted][1]))
    except EOFError:
        pass
    except Exception as error:
        connection.send(f"{type(error).__name__}: {error}")
    finally:
        del kept
        connection.close()


class WorkerError(RuntimeError):
    """A solver's process raised or died; what it said."""


class Worker:
    """One solver in a process of its own."""

    def __init__(self, name: str, sequences: dict[str, Sequence], odd: bool = False) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, far = context.Pipe()
        self._process = context.Process(target=_work, args=(far, name, sequences, odd), daemon=True)
        self._process.start()
        far.close()

    def ready(self) -> None:
        """Wait until it has loaded all that it needs."""
        self._receive()

    def _receive(self) -> Any:
        try:
            got = self._connection.recv()
        except (EOFError, ConnectionResetError) as error:
            raise WorkerError("its process ended") from error
        if isinstance(got, str):
            raise WorkerError(got)
        return got

    def run(self, sequence: str) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Have it solve a sequence; see :func:`run_through`."""
        self._connection.send(sequence)
        times, solutions, solved = self._receive()
        return times, solutions, solved

    def close(self) -> None:
        """End the process."""
        with suppress(OSError):
            self._connection.send(None)
        self._process.join(5.0)
        if self._process.is_alive():
            self._process.terminate()
        self._connection.close()


@dataclass
class Entry:
    """What one solver did on one sequence."""

    rounds: list[Array] = field(default_factory=list)
    """Times in s, (N,) a round; the first of each is with the set-up."""
    solutions: Array = field(default_factory=lambda: np.zeros((0, 0)))
    solved: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    same_again: bool = True
    """The same to the last bit in all rounds."""
    same_elsewhere: bool = True
    """The same in a second process whose heap and data lie otherwise."""

    @property
    def times(self) -> Array:
        """All times but those of the first problem, s."""
        return np.concatenate([times[1:] for times in self.rounds])

    @property
    def first(self) -> float:
        """Median over the rounds of the first problem's time, set-up of the solver included, s."""
        return float(np.median([times[0] for times in self.rounds]))

    @property
    def best(self) -> Array:
        """Times of the round with the smallest median, s."""
        return min((times[1:] for times in self.rounds), key=lambda times: float(np.median(times)))

    @property
    def failures(self) -> int:
        """Problems that the solver did not solve, by its own account or by the conditions of optimality."""
        return int(np.count_nonzero(~self.solved))


@contextmanager
def _workers(
    names: list[str], sequences: dict[str, Sequence], odd: bool = False
) -> Iterator[tuple[dict[str, Worker], dict[str, str]]]:
    """Start the solvers' processes; give those that came up, and what the others said."""
    started, failed = {name: Worker(name, sequences, odd) for name in names}, {}
    try:
        for name, worker in started.items():
            try:
                worker.ready()
            except WorkerError as error:
                failed[name] = str(error)
        yield {name: worker for name, worker in started.items() if name not in failed}, failed
    finally:
        for worker in started.values():
            worker.close()


def contest(
    names: list[str], sequences: dict[str, Sequence], rounds: int
) -> tuple[dict[str, dict[str, Entry]], dict[str, str]]:
    """Let all take turns over all sequences; give sequence to solver to entry, and what went wrong with whom."""
    entries: dict[str, dict[str, Entry]] = {key: {} for key in sequences}
    with _workers(names, sequences) as (workers, failed):
        for number in range(rounds):
            for key in sequences:
                turn = list(workers)
                turn = turn[number % len(turn) :] + turn[: number % len(turn)]
                for name in turn:
                    if name in failed:
                        continue
                    try:
                        _note(entries[key].setdefault(name, Entry()), *workers[name].run(key))
                    except WorkerError as error:
                        failed[name] = str(error)
    with _workers([name for name in names if name not in failed], sequences, odd=True) as (workers, odd_failed):
        for name, worker in workers.items():
            for key in sequences:
                _, solutions, solved = worker.run(key)
                entry = entries[key][name]
                entry.same_elsewhere = _same(entry, solutions, solved)
    failed |= odd_failed
    for found in entries.values():
        for name in failed:
            found.pop(name, None)
    return entries, failed


def _note(entry: Entry, times: Array, solutions: Array, solved: NDArray[np.bool_]) -> None:
    if entry.rounds:
        entry.same_again = entry.same_again and _same(entry, solutions, solved)
    entry.rounds.append(times)
    entry.solutions, entry.solved = solutions, solved


def _same(entry: Entry, solutions: Array, solved: NDArray[np.bool_]) -> bool:
    return bool(np.array_equal(entry.solutions, solutions, equal_nan=True) and np.array_equal(entry.solved, solved))


@dataclass(frozen=True)
class Accuracy:
    """Largest differences from the reference over the problems that a solver calls solved."""

    reference: float
    """u_tr(k), um."""
    correction: float
    """F_cor(k), N."""
    violation: float
    """Of a hard bound, mm, mm/s or N."""
    gap: float
    """Of the objective from the reference's, relative to the latter's size."""


def accuracy(sequence: Sequence, truth: Array, entry: Entry) -> Accuracy:
    """Hold a solver's solutions against the reference ones ``truth`` (N, nz)."""
    chosen = entry.solved & np.isfinite(entry.solutions).all(axis=1)
    if not chosen.any():
        return Accuracy(*[float("nan")] * 4)
    z, best = entry.solutions[chosen], truth[chosen]
    apart = np.abs(z - best)
    least = objective(sequence, chosen, best)
    return Accuracy(
        float(apart[:, 0].max()) * 1e3,
        float(apart[:, sequence.correction].max()),
        violation(sequence, chosen, z),
        float((np.abs(objective(sequence, chosen, z) - least) / np.maximum(np.abs(least), 1.0)).max()),
    )


def certificate(sequence: Sequence, solutions: Array, every: int = 1) -> tuple[float, float]:
    """Give the largest violation of a hard bound (mm, N) and the largest distance from the solution, see `distance`."""
    everything = np.ones(sequence.count, dtype=np.bool_)
    away = max(distance(sequence, k, solutions[k]) for k in range(0, sequence.count, every))
    return violation(sequence, everything, solutions), away
