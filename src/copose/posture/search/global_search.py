"""The global search: self-motions, combinations, polishing, and the evidence for its answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from copose.cell.cell import Cell
from copose.constraints.clearance import Blocked
from copose.poses import Array, Indices, Mask
from copose.posture.local.climb import SAME_OBJECTIVE, LocalSearches, gathered
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.search.clear_samples import (
    alone_clear,
    clear_postures,
    in_each_others_way,
    kept_apart,
)
from copose.posture.search.ranking import judged
from copose.posture.search.screening import Screened, screen
from copose.posture.setting import Setting
from copose.posture.solvers.nlp import LocalSolve
from copose.progress import StoppedError, over, sheltered, stage
from copose.selection import far_apart_rows
from copose.self_motion.sampling import ArmSample, ArmSampler, held_sample

Allowed: TypeAlias = Callable[[Indices], Mask]
"""Says of combinations of the arms' postures, by their indices, (count, K), which are allowed."""

_APART = 0.3
# Degrees of freedom to spare, of all arms, up to which the full number of starts is polished; and
# the number that is polished however many there are.
_PLAIN, _FEWEST = 8, 4
# Combinations that are looked through for one that differs from those before.
_AMONG = 64
# Where torque limits decide, and a climb is not dear, more may be polished: gains differ where a
# sample is beside a kink.
_UNLIKE = 2
# So many times fewer where bodies are in the way of what linear programs judge.
_BLOCKED = 3
# Best ends of which all pairs can be judged by linear programs.
_RECOMBINED = 16
# Of what is known when a search has to end, so many are asked whether they are an answer.
_ASKED = 4
# Where bodies leave none of them, so many combinations are looked at.
_DRAWN = 64


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
        insistence: random postures of an arm that are drawn before it is said to miss its grasp.
    """

    batch: int
    batches: int
    loops: int
    surfaces: int
    starts: int
    polished: int
    rounds: int
    blind: int
    insistence: int = 4096

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
class Found:
    """What a search found.

    Attributes:
        samples: of every arm.
        combinations: that were evaluated.
        best_sample: the objective of the best combination before polishing.
        starts: combinations that were polished.
        optima: distinct local optima, best first.
        failures: how polishing failed, and how often.
        best: the best combination before polishing, (N,); None where there is none.
        blocked: what comes too near in all postures of an arm.
    """

    samples: tuple[ArmSample, ...]
    combinations: int = 0
    best_sample: float | None = None
    starts: int = 0
    optima: tuple[LocalOptimum, ...] = ()
    failures: tuple[LocalSolve, ...] = ()
    best: Array | None = None
    blocked: tuple[Blocked, ...] = ()


def search(model: PostureModel, setting: Setting, seed: int, effort: Effort) -> Found:
    """Find the local optima of a cell, the best of them first.

    What is known where the call has to end is what is found, once every arm's postures are.

    Args:
        model: what is built.
        setting: where the object is.
        seed: of everything that is drawn.
        effort: how much is tried.

    Raises:
        StoppedError: the call has to end, and nothing is known.
    """
    cell = setting.cell
    K = len(cell.arms)
    goals = setting.placement.goals
    samplers = [ArmSampler(cell, kernels, i, goals[i]) for i, kernels in enumerate(model.arms)]
    held = {
        i: held_sample(cell, sampler.kernels, i, goals[i])
        for i, sampler in enumerate(samplers)
        if cell.arms[i].fixed
    }
    # Beside an arm that surely misses one posture of the others is all that is told.
    missed = any(
        not len(held[i].closed) if i in held else sampler.proved
        for i, sampler in enumerate(samplers)
    )
    samples = []
    for i, sampler in enumerate(samplers):
        stage(f"closing arm {cell.arms[i].name}", i, K)
        if i in held:
            samples.append(held[i])
            continue
        most = effort.loops if sampler.kernels.n - sampler.kernels.m <= 1 else effort.surfaces
        batches = 1 if missed else effort.batches
        rng = np.random.default_rng([seed, i])
        samples.append(sampler.sample(rng, effort.batch, batches, most, effort.insistence))
    if any(len(sample.closed) == 0 for sample in samples):
        return Found(tuple(samples))
    postures = [sample.closed for sample in samples]
    near = [sample.neighbours for sample in samples]
    blind = replace(setting, bodies=None)
    polished = LocalSearches(model, blind, effort.polished)
    found = compared(polished, samples, postures, near, seed, effort)
    if setting.bodies is None:
        return found
    # What bodies in the way leave is worth no more than what there is without them.
    if over():
        with sheltered():
            known = model.feasibility.first_apart(setting, found.optima[:_ASKED])
            if known is None:
                known = model.feasibility.first_apart(
                    setting, _drawn(model, setting, postures, seed)
                )
        return replace(found, optima=() if known is None else (known,))
    known = model.feasibility.first_apart(setting, found.optima)
    if known is not None and known is found.optima[0]:
        return replace(found, optima=(known,))
    optima = () if known is None else (known,)
    try:
        cleared = clear_postures(model, setting, postures)
    except StoppedError:
        return replace(found, optima=optima)
    if cleared.blocked:
        return replace(found, optima=optima, blocked=() if optima else cleared.blocked)
    polished = LocalSearches(model, setting, effort.polished)
    polished.ends += optima
    found = compared(polished, samples, cleared.postures, cleared.neighbours, seed, effort)
    if found.optima or found.failures or over():
        return found
    return replace(found, blocked=in_each_others_way(setting, cleared.postures, seed))


def _drawn(
    model: PostureModel, setting: Setting, postures: Sequence[Array], seed: int
) -> list[LocalOptimum]:
    """The best of some random combinations of the arms' postures that are allowed."""
    rng = np.random.default_rng([seed, len(postures), 3])
    q = np.hstack([mine[rng.integers(0, len(mine), _DRAWN)] for mine in postures])
    q = q[model.allowed(setting, q)]
    values = model.estimates(setting, q) if len(q) else np.zeros(0)
    best = np.argsort(-values, kind="stable")[:_ASKED]
    values = model.objectives(setting, q[best]) if len(q) else values
    return [LocalOptimum(q[k], float(v), 1) for k, v in zip(best, values, strict=True)]


def compared(
    polished: LocalSearches,
    samples: Sequence[ArmSample],
    postures: list[Array],
    near: list[Indices],
    seed: int,
    effort: Effort,
    allowed: Allowed | None = None,
) -> Found:
    """Combine the arms' postures, polish the best, and combine anew, for as long as the call may
    go on.

    Args:
        polished: what is known already; grows.
        samples: of the arms.
        postures: of them, by arm, those that count.
        near: indices of the postures next to each, by arm.
        seed: of everything that is drawn.
        effort: how much is tried.
        allowed: says of combinations of these postures which are; without it, where bodies must
            keep a clearance, those are that do.
    """
    model, setting = polished.model, polished.setting
    combined = _Combined(np.zeros((0, sum(arm.n for arm in setting.cell.arms))))
    with suppress(StoppedError):
        _combine(polished, combined, postures, near, seed, effort, allowed)
    with sheltered():
        starts = combined.starts
        if combined.screened is not None and not combined.judged:
            starts, _ = _distinct(setting.cell, postures, combined.screened, _ASKED)
        _stand_in(polished, starts)
        first = model.objectives(setting, starts[:1]) if len(starts) else None
    return Found(
        samples=tuple(samples),
        combinations=combined.count,
        best_sample=None if first is None else float(first[0]),
        starts=polished.starts,
        optima=tuple(gathered(setting.cell, polished.ends)),
        failures=tuple(polished.failures),
        best=starts[0] if len(starts) else None,
    )


@dataclass
class _Combined:
    """Combinations of the arms' postures.

    Attributes:
        count: how many were evaluated.
        screened: the best by a score.
        judged: whether the objective itself has compared them.
        starts: the best that differ, (count, N).
    """

    starts: Array
    count: int = 0
    screened: Screened | None = None
    judged: bool = False


def _stand_in(polished: LocalSearches, starts: Array) -> None:
    """Where bodies are in the way a climb may fail, and where the call has to end there may have
    been none: a sample that is allowed stands in for it.
    """
    model, setting = polished.model, polished.setting
    if not len(starts) or (setting.bodies is None and not over()):
        return
    starts = starts[: _ASKED if over() else None]
    for start, value in zip(starts, model.objectives(setting, starts), strict=True):
        if value <= polished.best:
            break
        if model.allowed(setting, start[None])[0]:
            polished.keep(start, value)
            break


def _combine(
    polished: LocalSearches,
    combined: _Combined,
    postures: list[Array],
    near: list[Indices],
    seed: int,
    effort: Effort,
    allowed: Allowed | None,
) -> None:
    """See `compared`; tells as it goes what was combined."""
    model, setting = polished.model, polished.setting
    cell = setting.cell
    K = len(cell.arms)
    stage("comparing postures")
    rng = np.random.default_rng([seed, K])
    screened = _screened(model, setting, postures, near, rng, effort.starts, allowed)
    combined.count, combined.screened = screened.combinations, screened
    # A step in many dimensions takes many evaluations.
    spare = sum(max(0, kernels.n - kernels.m) for kernels in model.arms)
    most = max(_FEWEST, int(effort.polished * min(1.0, _PLAIN / max(spare, 1))))
    if not (model.newton or model.dear):
        most *= _UNLIKE
    screened = judged(model, setting, postures, near, screened, most)
    starts, scores = _distinct(cell, postures, screened, most)
    combined.judged, combined.starts = True, starts
    polished.add_promising(starts, scores)
    if spare > K and len(starts) and not model.dear:
        counts = [len(mine) for mine in postures]
        drawn = rng.integers(0, counts, (int(effort.blind * min(1.0, _PLAIN / spare)), K))
        picked = np.hstack([mine[k] for mine, k in zip(postures, drawn.T, strict=True)])
        polished.add(picked[model.clear(setting, picked)])
    postures_of = postures
    dense = K <= 2 and all(kernels.n - kernels.m <= 1 for kernels in model.arms)
    # Where another score has compared them the best pair may have looked like many.
    dense = dense and model.newton
    # Where linear programs judge pairs they judge all of the best ends, once.
    few = not (model.newton or model.dear)
    rounds = min(effort.rounds, 1) if few else effort.rounds
    for _ in range(0 if dense or not polished.ends else rounds):
        # At a good combination every arm's posture is good for what the others add up to, and it
        # was polished for another sum before: so what is polished is combined anew.
        postures = polished.postures(_RECOMBINED if few else 2 * most)
        for i, kernels in enumerate(() if few else model.arms):
            if K > 1 and kernels.n > kernels.m and not cell.arms[i].fixed:
                found = polished.responses(i, postures_of[i], most)
                postures[i] = np.vstack([postures[i], found])
        if setting.bodies is not None:
            postures = [p[alone_clear(setting, i, p)] for i, p in enumerate(postures)]
            if not all(map(len, postures)):
                break
        near = [np.zeros((len(mine), 0), dtype=np.intp) for mine in postures]
        screened = _screened(model, setting, postures, near, rng, effort.starts)
        combined.count += screened.combinations
        screened = judged(model, setting, postures, near, screened, most)
        # Where kinks make what was climbed stand above all that was not, only the latter counts.
        known = None if model.newton else polished.known
        again, _ = _distinct(cell, postures, screened, max(1, most // 2), known)
        before = polished.best
        polished.add(polished.unknown(again))
        if not polished.best > before + SAME_OBJECTIVE:
            break


def local_search(model: PostureModel, setting: Setting, q: Array) -> Found:
    """The local optimum that a closed posture, (N,), leads to."""
    return climbed(model, setting, Found(()), q[None])


def climbed(model: PostureModel, setting: Setting, found: Found, q: Array) -> Found:
    """A search that had nothing to climb from, with closed postures, (count, N), to do so."""
    polished = LocalSearches(model, setting)
    polished.add(q)
    return replace(
        found,
        starts=polished.starts,
        optima=tuple(gathered(setting.cell, polished.ends)),
        failures=tuple(polished.failures),
    )


def _screened(
    model: PostureModel,
    setting: Setting,
    postures: Sequence[Array],
    neighbours: Sequence[Indices],
    rng: np.random.Generator,
    starts: int,
    allowed: Allowed | None = None,
) -> Screened:
    terms = [model.terms(setting, i, mine) for i, mine in enumerate(postures)]
    if setting.bodies is not None and allowed is None:
        allowed = kept_apart(setting, postures)
    if model.feasibility.judged:
        # A combination that cannot be held may stand above a neighbour that can.
        neighbours = [near[:, :0] for near in neighbours]
    return screen(model.score, setting.given, terms, neighbours, rng, starts, allowed)


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

    def near(posture: Array, free: Mask) -> Indices:
        left = np.flatnonzero(free)
        return left[~(cell.distances(q[left], posture) > _APART)]

    free = np.ones(len(q), dtype=bool)
    for posture in () if known is None else known:
        free[near(posture, free)] = False
    chosen = far_apart_rows(free, lambda row, left: near(q[row], left), most)
    return q[chosen], screened.scores[chosen]
