"""The global search: self-motions, combinations, polishing, and the evidence for its answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from copose.planning.cell import Cell
from copose.planning.judging import judged
from copose.planning.machinery import Machinery, Setting
from copose.planning.polishing import Polished
from copose.planning.program import LocalSolve
from copose.planning.screening import Screened, screen
from copose.planning.self_motion import ArmSample, ArmSampler
from copose.poses import Array, Indices, Mask

Progress: TypeAlias = Callable[[str, float], None]
"""Called with what is being done and the fraction of the whole that is behind."""

_APART = 0.3
_SAME_OBJECTIVE = 1e-6
_SAME_JOINTS = 1e-3
# Optima that differ by less are of equal worth; symmetric cells have some.
_TIE = 1e-8
# Ends that did not converge matter where they come near the best.
_NEAR_BEST = 1e-2
_KINKED = 10
# Degrees of freedom to spare, of all arms, up to which the full number of starts is polished; and
# the number that is polished however many there are.
_PLAIN, _FEWEST = 8, 4
# Combinations that are looked through for one that differs from those before.
_AMONG = 64
# Where a climb is dear fewer are polished.
_DEAR = 2
# Where torque limits decide more may be polished: gains differ where a sample is beside a kink.
_UNLIKE = 2
# Best ends of which all pairs can be judged by linear programs.
_RECOMBINED = 16
# Starts that are polished at a time, and how many times the largest gain so far the next may hope
# for.
_AT_ONCE, _HOPE = 8, 10.0
# Where each takes a program by itself: at first, for gains differ more there, and then.
_FIRST, _FEW_AT_ONCE = 12, 4


@dataclass(frozen=True)
class Effort:
    """How much is tried.

    Attributes:
        batch: random postures drawn at a time for an arm.
        batches: of them, at most.
        loops: postures kept of an arm with one degree of freedom to spare, at most.
        surfaces: postures kept of an arm with more.
        starts: random combinations that exchange improves where there are more than two arms.
        polished: combinations that are polished.
        rounds: of combining anew what was polished, at most.
        blind: combinations drawn at random that are polished where an arm has more than one degree
            of freedom to spare, for a sample tells little about what is near it there.
    """

    batch: int
    batches: int
    loops: int
    surfaces: int
    starts: int
    polished: int
    rounds: int
    blind: int

    def doubled(self) -> Effort:
        """Twice as much of everything but for the size of a batch."""
        return replace(
            self,
            batches=2 * self.batches,
            loops=2 * self.loops,
            surfaces=2 * self.surfaces,
            starts=2 * self.starts,
            polished=2 * self.polished,
            rounds=2 * self.rounds,
            blind=2 * self.blind,
        )


EFFORTS = {
    "low": Effort(
        batch=64, batches=4, loops=120, surfaces=150, starts=32, polished=8, rounds=0, blind=0
    ),
    "normal": Effort(
        batch=96, batches=8, loops=240, surfaces=300, starts=96, polished=24, rounds=2, blind=16
    ),
    "high": Effort(
        batch=256,
        batches=16,
        loops=480,
        surfaces=1200,
        starts=384,
        polished=160,
        rounds=6,
        blind=800,
    ),
}


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """A distinct end of the polishing: stacked joints, objective, how many starts ended there."""

    q: Array
    objective: float
    count: int


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found.

    Attributes:
        samples: of every arm.
        combinations: that were evaluated.
        best_sample: the objective of the best combination before polishing.
        starts: combinations that were polished.
        optima: distinct local optima, best first.
        failures: how polishing failed, and how often.
    """

    samples: tuple[ArmSample, ...]
    combinations: int = 0
    best_sample: float | None = None
    starts: int = 0
    optima: tuple[LocalOptimum, ...] = ()
    failures: tuple[LocalSolve, ...] = ()


def search(
    machinery: Machinery, setting: Setting, seed: int, effort: Effort, progress: Progress
) -> Found:
    """Find the local optima of a cell, the best of them first.

    Args:
        machinery: what is built.
        setting: where the object is.
        seed: of everything that is drawn.
        effort: how much is tried.
        progress: is told.
    """
    cell = setting.cell
    K = len(cell.arms)
    samples = []
    for i, kernels in enumerate(machinery.arms):
        progress(f"closing arm {cell.arms[i].name}", 0.5 * i / K)
        most = effort.loops if kernels.n - kernels.m <= 1 else effort.surfaces
        sampler = ArmSampler(cell, kernels, i, setting.placement.goals[i])
        rng = np.random.default_rng([seed, i])
        samples.append(sampler.sample(rng, effort.batch, effort.batches, most))
    if any(len(sample.closed) == 0 for sample in samples):
        return Found(tuple(samples))
    progress("comparing postures", 0.5)
    rng = np.random.default_rng([seed, K])
    postures = [sample.closed for sample in samples]
    near = [sample.neighbours for sample in samples]
    screened = _screened(machinery, setting, postures, near, rng, effort.starts)
    # A step in many dimensions takes many evaluations.
    spare = sum(max(0, kernels.n - kernels.m) for kernels in machinery.arms)
    most = max(_FEWEST, int(effort.polished * min(1.0, _PLAIN / max(spare, 1))))
    if machinery.dear:
        most = max(_FEWEST, most // _DEAR)
    elif not machinery.newton:
        most *= _UNLIKE
    screened = judged(machinery, setting, postures, near, screened, most)
    starts, scores = _distinct(cell, postures, screened, most)
    polished = _Polishing(machinery, setting, progress)
    polished.add_promising(starts, scores)
    if spare > K and len(starts) and not machinery.dear:
        counts = [len(mine) for mine in postures]
        drawn = rng.integers(0, counts, (int(effort.blind * min(1.0, _PLAIN / spare)), K))
        picked = [mine[k] for mine, k in zip(postures, drawn.T, strict=True)]
        polished.add(np.hstack(picked))
    combinations = screened.combinations
    dense = K <= 2 and all(kernels.n - kernels.m <= 1 for kernels in machinery.arms)
    # Where another score has compared them the best pair may have looked like many.
    dense = dense and machinery.newton
    rounds = effort.rounds if machinery.newton else min(effort.rounds, 1)
    for _ in range(0 if dense or not polished.ends else rounds):
        # At a good combination every arm's posture is good for what the others add up to, and it
        # was polished for another sum before: so what is polished is combined anew.
        postures = polished.postures(2 * most if machinery.newton else _RECOMBINED)
        for i, kernels in enumerate(machinery.arms if machinery.newton else ()):
            if K > 1 and kernels.n > kernels.m:
                found = polished.responses(i, samples[i].closed, most)
                postures[i] = np.vstack([postures[i], found])
        near = [np.zeros((len(mine), 0), dtype=np.intp) for mine in postures]
        screened = _screened(machinery, setting, postures, near, rng, effort.starts)
        combinations += screened.combinations
        screened = judged(machinery, setting, postures, near, screened, most)
        # Where kinks make what was climbed stand above all that was not, only the latter counts.
        known = None if machinery.newton else polished.known
        again, _ = _distinct(cell, postures, screened, max(1, most // 2), known)
        before = polished.best
        polished.add(polished.unknown(again))
        if not polished.best > before + _SAME_OBJECTIVE:
            break
    return Found(
        samples=tuple(samples),
        combinations=combinations,
        best_sample=float(machinery.objectives(setting, starts[:1])[0]) if len(starts) else None,
        starts=polished.starts,
        optima=tuple(_gathered(cell, polished.ends)),
        failures=tuple(polished.failures),
    )


def local_search(machinery: Machinery, setting: Setting, q: Array, progress: Progress) -> Found:
    """The local optimum that a closed posture, (N,), leads to."""
    return climbed(machinery, setting, Found(()), q[None], progress)


def climbed(
    machinery: Machinery, setting: Setting, found: Found, q: Array, progress: Progress
) -> Found:
    """A search that had nothing to climb from, with closed postures, (count, N), to do so."""
    polished = _Polishing(machinery, setting, progress)
    polished.add(q)
    return replace(
        found,
        starts=polished.starts,
        optima=tuple(_gathered(setting.cell, polished.ends)),
        failures=tuple(polished.failures),
    )


def _screened(
    machinery: Machinery,
    setting: Setting,
    postures: Sequence[Array],
    neighbours: Sequence[Indices],
    rng: np.random.Generator,
    starts: int,
) -> Screened:
    terms = [machinery.terms(setting, i, mine) for i, mine in enumerate(postures)]
    if machinery.static:
        # A combination that cannot be held may stand above a neighbour that can.
        neighbours = [near[:, :0] for near in neighbours]
    return screen(machinery.score, setting.given, terms, neighbours, rng, starts)


def _distinct(
    cell: Cell,
    samples: Sequence[Array],
    screened: Screened,
    most: int,
    known: Array | None = None,
) -> tuple[Array, Array]:
    """The best combinations that differ from one another, and from those known, in some joint.

    Returns:
        Stacked joints, (count, N), and scores, (count,).
    """
    columns = screened.chosen[: _AMONG * most].T
    q = np.hstack([sample[column] for sample, column in zip(samples, columns, strict=True)])
    left = np.arange(len(q))
    for row in () if known is None else known:
        left = left[cell.distances(q[left], row) > _APART]
    chosen: list[int] = []
    while len(left) and len(chosen) < most:
        chosen.append(left[0])
        left = left[cell.distances(q[left], q[left[0]]) > _APART]
    return q[chosen], screened.scores[chosen]


class _Polishing:
    """What polishing has come to so far.

    Newton steps along the self-motions come first. IPOPT solves the posture program where they do
    not meet its tolerance, and where the objective has kinks.
    """

    def __init__(self, machinery: Machinery, setting: Setting, progress: Progress) -> None:
        """Nothing polished yet."""
        self._machinery, self._setting, self._progress = machinery, setting, progress
        self.starts = 0
        self.ends: list[LocalOptimum] = []
        self.failures: list[LocalSolve] = []

    @property
    def best(self) -> float:
        return max((end.objective for end in self.ends), default=-np.inf)

    @property
    def known(self) -> Array:
        """Where polishing has ended, (count, N)."""
        return np.array([end.q for end in self.ends])

    def postures(self, most: int) -> list[Array]:
        """By arm, where the best ends of polishing are, without repetition."""
        cell = self._setting.cell
        optima = np.array([optimum.q for optimum in _gathered(cell, self.ends)[:most]])
        parts = [part.T for part in cell.system.split(optima.T)] if len(optima) else []
        return [np.unique(part.round(9), axis=0) for part in parts]

    def responses(self, i: int, closed: Array, most: int) -> Array:
        """Local optima of arm i alone beside the others' postures of the best end, (count, n_i).

        Args:
            i: the arm.
            closed: its postures to start from, (count, n_i).
            most: of them that are polished.
        """
        machinery, setting = self._machinery, self._setting
        cell = setting.cell
        best = max(self.ends, key=lambda end: end.objective)
        parts = cell.system.split(best.q)
        terms = [machinery.terms(setting, j, q[None])[0] for j, q in enumerate(parts) if j != i]
        rest = np.asarray(sum(terms))
        scores = machinery.score.value(machinery.terms(setting, i, closed) + rest, setting.given)
        scores = scores[:, 0]
        starts = closed[np.argsort(-scores, kind="stable")[:most]]
        own = machinery.objective.sums.size(cell.system.space)
        ends = machinery.polisher(setting, i, rest[:own]).polish(starts)
        return np.asarray(ends.q[ends.converged])

    def unknown(self, starts: Array) -> Array:
        """Those of the starts that are no end."""
        ends = self.known
        cell = self._setting.cell
        new = [np.all(cell.distances(ends, q) > _SAME_JOINTS) for q in starts]
        return np.asarray(starts[np.array(new, dtype=bool)])

    def add_promising(self, starts: Array, scores: Array) -> None:
        """Polish starts, best first, until the next would have to gain far more than any has."""
        gained, best = 0.0, -np.inf
        first, together = 0, _AT_ONCE if self._machinery.newton else _FIRST
        while first < len(starts):
            rows = slice(first, first + together)
            if not self._machinery.dear and scores[first] + _HOPE * gained < best:
                break
            ends = self.add(starts[rows])
            best = max(best, ends.max(initial=-np.inf))
            gained = max(gained, (ends - scores[rows]).max(initial=0.0))
            first = rows.stop
            together = _AT_ONCE if self._machinery.newton else _FEW_AT_ONCE

    def add(self, starts: Array) -> Array:
        """Polish closed postures, (count, N); the scores where they end, (count,)."""
        machinery, setting = self._machinery, self._setting
        if len(starts) == 0:
            return np.zeros(0)
        self._progress("polishing", 0.6)
        self.starts += len(starts)
        if not machinery.newton:
            return self._solve(starts)
        ends = machinery.polisher(setting).polish(starts)
        held = machinery.held(setting, ends.q)
        solved = ends.converged & machinery.smooth & held
        values = machinery.objectives(setting, ends.q)
        for q, value in zip(ends.q[solved], values[solved], strict=True):
            self.ends.append(LocalOptimum(q, float(value), 1))
        left = _left(setting.cell, ends, solved | ~held, machinery.smooth)
        # Where torque limits end a climb IPOPT climbs with them, from a start that keeps them.
        left = np.vstack([left, starts[~held & machinery.held(setting, starts)]])
        if machinery.smooth:
            stalled = int((~solved).sum()) - len(left)
            self.failures += [LocalSolve(starts[0], False, "Stalled_Far_Below_Best", {})] * stalled
        self._solve(left)
        return np.where(ends.converged, ends.value, -np.inf)

    def _solve(self, q: Array) -> Array:
        """Go on from postures, (count, N), by IPOPT.

        Returns:
            The objective where each ends, −inf where nowhere, (count,).
        """
        machinery, setting, ends = self._machinery, self._setting, []
        if len(q) == 0:
            return np.zeros(0)
        for k, end in enumerate(machinery.solve_programs(setting, q)):
            self._progress("polishing", 0.7 + 0.3 * k / len(q))
            ends.append(end)
        values = machinery.objectives(setting, np.array([end.q for end in ends]))
        good = np.isfinite(values) & np.array([end.converged for end in ends])
        for end, value, fine in zip(ends, values, good, strict=True):
            if fine:
                self.ends.append(LocalOptimum(end.q, float(value), 1))
            else:
                self.failures.append(end)
        return np.where(good, values, -np.inf)


def _left(cell: Cell, ends: Polished, solved: Mask, smooth: bool) -> Array:
    """Ends that IPOPT has to go on from, (count, N)."""
    order = np.argsort(-ends.value, kind="stable")
    order = order[~solved[order] & np.isfinite(ends.value[order])]
    if smooth:
        best = ends.value[solved].max(initial=-np.inf)
        near = order[ends.value[order] > best - _NEAR_BEST]
        return np.asarray(ends.q[near[:_KINKED]])
    chosen: Array = ends.q[:0]
    for row in ends.q[order]:
        if len(chosen) < _KINKED and np.all(cell.distances(chosen, row) > _SAME_JOINTS):
            chosen = np.vstack([chosen, row])
    return chosen


def _gathered(cell: Cell, ending: Sequence[LocalOptimum]) -> list[LocalOptimum]:
    """Distinct optima, best first, with how many ended in each."""
    optima: list[LocalOptimum] = []
    for end in sorted(ending, key=lambda optimum: -optimum.objective):
        q = np.concatenate(
            [cell.folded(i, part) for i, part in enumerate(cell.system.split(end.q))]
        )
        # Best first: those of the same objective stand last.
        for j in range(len(optima) - 1, -1, -1):
            known = optima[j]
            if known.objective - end.objective >= _SAME_OBJECTIVE:
                optima.append(LocalOptimum(q, end.objective, 1))
                break
            if cell.distances(known.q[None], q)[0] < _SAME_JOINTS:
                optima[j] = replace(known, count=known.count + 1)
                break
        else:
            optima.append(LocalOptimum(q, end.objective, 1))
    return _tie_broken(optima)


def _tie_broken(optima: list[LocalOptimum]) -> list[LocalOptimum]:
    """With the first of the best in the order of joints first, so that no seed decides."""
    if not optima:
        return optima
    best = optima[0].objective
    tied = [o for o in optima if o.objective >= best - _TIE * max(1.0, abs(best))]
    rest = optima[len(tied) :]
    first = list(tied)
    for joint in range(len(tied[0].q)):
        least = min(o.q[joint] for o in first)
        first = [o for o in first if o.q[joint] <= least + _SAME_JOINTS]
    return [first[0], *(o for o in tied if o is not first[0]), *rest]
