"""Global search for postures: self-motions, their combinations, local searches, the evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from copose.poses import Array
from copose.posture.local.multistart import LocalSearches, gathered
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.search.clear_samples import ArmPostures, clear_postures, in_each_others_way
from copose.posture.search.combinations import Combinations
from copose.posture.search.effort import Effort
from copose.posture.search.outcome import SearchOutcome
from copose.posture.setting import Setting
from copose.progress import StoppedError, over, sheltered, stage
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.sampling import ArmSample, ArmSampler, held_sample, sample_together


def search(
    model: PostureModel,
    setting: Setting,
    seed: int,
    effort: Effort,
    samples: tuple[ArmSample, ...] | None = None,
) -> SearchOutcome:
    """Find the local optima of a cell, the best of them first.

    Where the call has to end the outcome is what is known, once every arm's postures are. Without
    samples of the arms' self-motions these are drawn.

    Raises:
        StoppedError: the call has to end, and nothing is known.
    """
    samples = sampled(model, setting, seed, effort) if samples is None else samples
    if len(samples) < len(model.arms) or not all(len(sample.closed) for sample in samples):
        return SearchOutcome(samples)
    arms = ArmPostures.of(samples)
    climbs = LocalSearches(model, replace(setting, bodies=None), effort.polished, effort.climbing)
    outcome = Combinations(climbs, arms, seed, effort).search(samples)
    if setting.bodies is None:
        return outcome
    return _among_bodies(model, setting, outcome, arms, seed, effort)


def sampled(
    model: PostureModel, setting: Setting, seed: int, effort: Effort
) -> tuple[ArmSample, ...]:
    """Samples of the arms' self-motions."""
    cell, goals = setting.cell, setting.placement.goals
    samplers = [
        ArmSampler(cell, kernels, i, goals[i], effort.complete)
        for i, kernels in enumerate(model.arms)
    ]
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
    batches = 1 if missed else effort.batches
    samples, models = dict(held), dict[ArmKernels, list[int]]()
    for i, sampler in enumerate(samplers):
        if i not in held:
            models.setdefault(sampler.kernels, []).append(i)
    for kernels, arms in models.items():
        for i in arms:
            stage(f"closing arm {cell.arms[i].name}", i, len(samplers))
        most = effort.loops if kernels.n - kernels.m <= 1 else effort.surfaces
        own, rngs = [samplers[i] for i in arms], [np.random.default_rng([seed, i]) for i in arms]
        drawn = sample_together(own, rngs, effort.batch, batches, most, effort.insistence)
        samples |= zip(arms, drawn, strict=True)
    return tuple(samples[i] for i in range(len(samplers)))


def _among_bodies(
    model: PostureModel,
    setting: Setting,
    outcome: SearchOutcome,
    arms: ArmPostures,
    seed: int,
    effort: Effort,
) -> SearchOutcome:
    """The outcome where bodies must keep a clearance.

    With them in the way nothing is worth more than the best without, so the search without comes
    first, and only where its best is not clear are clear postures combined.
    """
    if over():
        with sheltered():
            known = model.feasibility.first_apart(setting, outcome.optima[: effort.measured])
            if known is None:
                known = model.feasibility.first_apart(
                    setting, _drawn(model, setting, arms.postures, seed, effort)
                )
        return replace(outcome, optima=() if known is None else (known,))
    known = model.feasibility.first_apart(setting, outcome.optima)
    if known is not None and known is outcome.optima[0]:
        return replace(outcome, optima=(known,))
    optima = () if known is None else (known,)
    try:
        cleared = clear_postures(model, setting, arms.postures)
    except StoppedError:
        return replace(outcome, optima=optima)
    if cleared.blocked:
        return replace(outcome, optima=optima, blocked=() if optima else cleared.blocked)
    climbs = LocalSearches(model, setting, effort.polished, effort.climbing, known=optima)
    outcome = Combinations(climbs, cleared, seed, effort).search(outcome.samples)
    if outcome.optima or outcome.failures or over():
        return outcome
    return replace(outcome, blocked=in_each_others_way(setting, cleared.postures, seed))


def _drawn(
    model: PostureModel, setting: Setting, postures: Sequence[Array], seed: int, effort: Effort
) -> list[LocalOptimum]:
    """The best of some random combinations of the arms' postures that are allowed."""
    rng = np.random.default_rng([seed, len(postures), 3])
    count = effort.combining.random
    q = np.hstack([q_i[rng.integers(0, len(q_i), count)] for q_i in postures])
    q = q[model.feasibility.allowed(setting, q)]
    values = model.estimates(setting, q) if len(q) else np.zeros(0)
    best = np.argsort(-values, kind="stable")[: effort.measured]
    values = model.objectives(setting, q[best]) if len(q) else values
    return [LocalOptimum(q[k], float(v), 1) for k, v in zip(best, values, strict=True)]


def climbed(
    model: PostureModel, setting: Setting, outcome: SearchOutcome, q: Array
) -> SearchOutcome:
    """Outcome of a search that had nothing to climb from, with climbs from postures, (count, N)."""
    climbs = LocalSearches(model, setting)
    climbs.add(q)
    optima = gathered(setting.cell, climbs.ends, climbs.options.same)
    return replace(
        outcome,
        starts=climbs.starts,
        optima=tuple(optima),
        met=tuple(optimum.count for optimum in optima),
        failures=tuple(climbs.failures),
    )
