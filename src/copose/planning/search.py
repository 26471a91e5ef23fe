"""Where the posture program starts from, and what its local optima are.

With the object held still G is made of sums over the arms, and a term depends on the joints of one
arm alone. So each arm is closed on its own, each closed posture is evaluated once, and arms meet
only in sums of m × m matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from copose.planning.cell import Cell
from copose.planning.closing import CLOSED, Projector
from copose.planning.objectives import Objective
from copose.planning.program import LocalSolve, PostureProgram
from copose.poses import Array
from copose.robots import finite_range

Progress: TypeAlias = Callable[[str, float], None]
"""Called with what is being done and the fraction of the whole that is behind."""

_BATCH = 256
_ENOUGH = 100
_MOST_BATCHES = 16
_COMBINATIONS = 20_000
_POLISHED = 10
_APART = 0.3
_SAME_OBJECTIVE = 1e-6
_SAME_JOINTS = 1e-3


@dataclass(frozen=True, eq=False)
class ArmSample:
    """Postures drawn for one arm.

    Attributes:
        closed: those that hold the object, (count, n).
        missed: those that do not, nearest first, (count, n).
    """

    closed: Array
    missed: Array


def sample_arm(cell: Cell, projector: Projector, i: int) -> ArmSample:
    """Closed postures of arm i, projected from its start and from random ones by the seed."""
    rng = np.random.default_rng([cell.problem.search.seed, i])
    lower, upper = cell.lower[i], cell.upper[i]
    low, high = finite_range(lower, upper)
    closed, missed, gaps = [], [], []
    found = 0
    for batch in range(_MOST_BATCHES):
        drawn = rng.uniform(low, high, (_BATCH, len(low)))
        start = cell.arms[i].start
        if batch == 0 and start is not None:
            drawn[0] = start
        q, gap = projector.project(drawn, cell.parameters, lower, upper)
        good = gap < CLOSED
        closed.append(cell.wrapped(i, q[good]))
        missed.append(q[~good])
        gaps.append(gap[~good])
        found += int(good.sum())
        if found >= _ENOUGH:
            break
    nearest = np.argsort(np.concatenate(gaps), kind="stable")
    return ArmSample(np.concatenate(closed)[:_ENOUGH], np.concatenate(missed)[nearest])


class Screen:
    """Evaluates the objective on combinations of the arms' closed postures."""

    def __init__(self, cell: Cell, objective: Objective) -> None:
        """Build each arm's terms and the Gram matrix of their sums."""
        system, resolution = cell.system, cell.resolution
        m, axes = system.space.m, list(cell.problem.axes)
        parameters = system.object.parameters
        terms = [resolution.arm_terms(system, i, scale) for i, scale in enumerate(cell.scales)]
        self._arms = [
            ca.Function("terms", [arm.q, parameters], [ca.vertcat(*map(ca.vec, mine))])
            for arm, mine in zip(system.arms, terms, strict=True)
        ]
        sums = [ca.SX.sym("sum", m, m) for _ in terms[0]]
        G = resolution.gram(sums, system.object.M_o)[axes, axes]
        self._gram = ca.Function("gram", [ca.vertcat(*map(ca.vec, sums)), parameters], [ca.vec(G)])
        self._a = len(axes)
        self._objective = objective

    def best_first(
        self, samples: Sequence[Array], parameters: Array, rng: np.random.Generator
    ) -> Array:
        """Combinations of samples, best objective first, as indices (count, K).

        All of them where they are few, else as many drawn at random.
        """
        counts = [len(sample) for sample in samples]
        if np.prod(np.array(counts, dtype=float)) <= _COMBINATIONS:
            grids = np.meshgrid(*(np.arange(count) for count in counts), indexing="ij")
            chosen = np.column_stack([grid.ravel() for grid in grids])
        else:
            chosen = rng.integers(0, counts, (_COMBINATIONS, len(counts)))
        total = np.zeros(())
        for k, (function, sample) in enumerate(zip(self._arms, samples, strict=True)):
            total = total + np.array(function(sample.T, parameters))[:, chosen[:, k]]
        grams = np.array(self._gram(total, parameters)).T.reshape(-1, self._a, self._a)
        sound = np.all(np.isfinite(grams), axis=(1, 2))
        chosen, grams = chosen[sound], grams[sound]
        values = self._objective.of_grams((grams + grams.transpose(0, 2, 1)) / 2)
        usable = np.isfinite(values)
        order = np.argsort(-values[usable], kind="stable")
        return np.asarray(chosen[usable][order])


def distinct_starts(cell: Cell, samples: Sequence[Array], ranked: Array) -> list[Array]:
    """The best combinations that differ from one another in some joint, stacked, (N,) each."""
    starts: list[Array] = []
    for row in ranked:
        q = np.concatenate([sample[k] for sample, k in zip(samples, row, strict=True)])
        if all(_distance(cell, q, other) > _APART for other in starts):
            starts.append(q)
        if len(starts) == _POLISHED:
            break
    return starts


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """A distinct end of the polishing: stacked joints, objective, how many starts ended there."""

    q: Array
    objective: float
    count: int


@dataclass(frozen=True, eq=False)
class Polished:
    """What became of the starts.

    Attributes:
        optima: distinct local optima, best first.
        failures: how the runs that did not converge ended.
    """

    optima: tuple[LocalOptimum, ...]
    failures: tuple[LocalSolve, ...]


def polish(
    cell: Cell, program: PostureProgram, starts: Sequence[Array], progress: Progress
) -> Polished:
    """Run the posture program from every start and gather where they end."""
    lower, upper = np.concatenate(cell.lower), np.concatenate(cell.upper)
    system = cell.system
    optima: list[LocalOptimum] = []
    failures = []
    for k, start in enumerate(starts):
        progress("polishing", k / len(starts))
        end = program.solve(start, cell.parameters, lower, upper)
        gram = program.gram_at(end.q, cell.parameters)
        value = (
            float(program.objective.of_grams(gram[None])[0]) if np.isfinite(gram).all() else np.nan
        )
        if not (end.converged and np.isfinite(value)):
            failures.append(end)
            continue
        q = np.concatenate([cell.wrapped(i, part) for i, part in enumerate(system.split(end.q))])
        for j, known in enumerate(optima):
            same = abs(known.objective - value) < _SAME_OBJECTIVE
            if same and _distance(cell, q, known.q) < _SAME_JOINTS:
                kept = known if known.objective >= value else LocalOptimum(q, value, 0)
                optima[j] = LocalOptimum(kept.q, kept.objective, known.count + 1)
                break
        else:
            optima.append(LocalOptimum(q, value, 1))
    optima.sort(key=lambda optimum: -optimum.objective)
    return Polished(tuple(optima), tuple(failures))


def _distance(cell: Cell, a: Array, b: Array) -> float:
    """Largest difference of a joint; a whole turn of a wide joint makes no other posture."""
    parts = zip(cell.system.split(a), cell.system.split(b), strict=True)
    return max(
        float(np.abs(cell.nearest_turn(i, one - other)).max())
        for i, (one, other) in enumerate(parts)
    )
