"""The search among postures that arms can come to from where they are without letting go.

The object stands still, so each arm stays in its component of the closed postures: its samples are
taken from there, and what polishing ends in counts only where it is in the component too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np

from copose.constraints.clearance import Blocked, in_the_way
from copose.poses import Array, Indices, Mask
from copose.posture.local.climb import LocalSearches
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.reachable.coordination import CoordinationGrid, CurveNodes
from copose.posture.reachable.reachability import Component, component, reachable
from copose.posture.search.clear_samples import alone_clear, clear_postures, in_each_others_way
from copose.posture.search.global_search import Effort, Found, compared
from copose.posture.setting import Setting
from copose.progress import over, sheltered, stage
from copose.self_motion.curves.tracing import SPACING
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSample, ArmSampler, neighbours

# Optima that are followed from the start, and the turns of joints in which each is.
_FOLLOWED, _TURNS = 24, 64
# The same where the call has to end.
_ASKED = 2
# Where bodies are in the way a start that the file does not give is the first of so many that keep
# clear.
_DRAWN = 512
# From so many postures along a curve on, a finer one tells no more.
_USUAL = 240


@dataclass(frozen=True, eq=False)
class ReachableSet:
    """What arms can come to from a posture.

    Attributes:
        model: what is built.
        setting: where the object is; joints have their limits even where they reach every angle.
        start: where the arms are, by arm (n_i,).
        samples: of what each arm can come to by itself; the first is the start where limits and
            margins allow it.
        components: of each arm.
        grid: what arms can come to side by side, where bodies are in the way of at most two that
            move on curves.
        nodes: of the grid, by arm.
        too_near: what comes too near at the start.
    """

    model: PostureModel
    setting: Setting
    start: tuple[Array, ...]
    samples: tuple[ArmSample, ...]
    components: tuple[Component, ...]
    grid: CoordinationGrid | None
    nodes: tuple[CurveNodes, ...]
    too_near: Blocked | None

    @classmethod
    def of(
        cls,
        model: PostureModel,
        setting: Setting,
        starts: Sequence[Array | None],
        seed: int,
        effort: Effort,
    ) -> ReachableSet | tuple[ArmSample, ...]:
        """What arms can come to.

        Args:
            model: what is built.
            setting: where the object is.
            starts: closed postures, by arm; None for the first that the seed gives.
            seed: of what is drawn.
            effort: how much is.

        Returns:
            Samples where one that is needed has no closed posture.
        """
        cell = setting.cell
        setting = replace(setting, lower=cell.lower, upper=cell.upper)
        drawn: list[ArmSample | None] = []
        for i, (kernels, start) in enumerate(zip(model.arms, starts, strict=True)):
            stage(f"closing arm {cell.arms[i].name}", i, len(starts))
            spare = 0 if cell.arms[i].fixed else kernels.n - kernels.m
            if start is not None and spare <= 1:
                drawn.append(None)
                continue
            sampler = ArmSampler(cell, kernels, i, setting.placement.goals[i])
            rng = np.random.default_rng([seed, i])
            most = effort.loops if spare <= 1 else effort.surfaces
            drawn.append(sampler.sample(rng, effort.batch, effort.batches, most, effort.insistence))
        known = [
            _only(cell.arms[i].n, start) if sample is None else sample
            for i, (sample, start) in enumerate(zip(drawn, starts, strict=True))
        ]
        if any(not len(sample.closed) for sample in known):
            return tuple(known)
        here, too_near = _standing(model, setting, starts, known, seed)
        spacing = SPACING / 2 * min(1.0, _USUAL / effort.loops)
        components, samples = [], []
        for i, (start, sample) in enumerate(zip(here, known, strict=True)):
            found = component(model, setting, i, start, sample.closed, spacing)
            components.append(found)
            samples.append(ArmSample(
                closed=found.postures,
                neighbours=neighbours(cell, model.arms[i], i, found.postures),
                tried=sample.tried,
                branches=None if found.rails.spare > 1 else 1,
                missed=sample.missed,
            ))  # fmt: skip
        grid, nodes = None, tuple[CurveNodes, ...]()
        if setting.bodies is not None and too_near is None:
            grid, nodes = _gridded(setting, here, components)
        return cls(
            model, setting, tuple(here), tuple(samples), tuple(components), grid, nodes,
            too_near,
        )  # fmt: skip

    @property
    def single(self) -> bool:
        """Whether no arm can leave its start."""
        return all(self.setting.cell.spare(i) <= 0 for i in range(len(self.start)))

    @property
    def stuck(self) -> tuple[str, bool]:
        """Why an arm can come to nothing, and whether all that it can come to is known."""
        arms = zip(self.setting.cell.arms, self.components, self.samples, strict=True)
        stuck = [(arm.name, each.complete) for arm, each, some in arms if not len(some.closed)]
        names = ", ".join(f"arm {name!r}" for name, _ in stuck)
        reason = f"{names} cannot leave the joint_margin that the start is in"
        return reason, any(complete for _, complete in stuck)

    def search(self, seed: int, effort: Effort) -> Found:
        """Find local optima among what the arms can come to, the best of them first."""
        model, setting = self.model, self.setting
        cell, samples = setting.cell, self.samples
        if not all(len(sample.closed) for sample in samples):
            return Found(samples)
        climbs = LocalSearches(model, setting, effort.polished)
        postures = [sample.closed for sample in samples]
        near = [sample.neighbours for sample in samples]
        if setting.bodies is None:
            return self.confirmed(compared(climbs, samples, postures, near, seed, effort))
        if self.grid is not None:
            postures = [nodes.q for nodes in self.nodes]
            near = [neighbours(cell, model.arms[i], i, q) for i, q in enumerate(postures)]
            return self.confirmed(
                compared(climbs, samples, postures, near, seed, effort, self._allowed)
            )
        cleared = clear_postures(model, setting, postures)
        if cleared.blocked:
            return Found(samples, blocked=cleared.blocked)
        found = compared(climbs, samples, cleared.postures, cleared.neighbours, seed, effort)
        if not (found.optima or found.failures):
            return Found(samples, blocked=in_each_others_way(setting, cleared.postures, seed))
        return self.confirmed(found)

    def confirmed(self, found: Found) -> Found:
        """A search with those of its optima that can be come to; where its best combination before
        polishing is better, or there is none, with that. Where the call has to end, of a few that
        are quick to tell.
        """
        if not over():
            return self._confirmed(found)
        quick = found.optima[:_ASKED] if self.setting.bodies is None else ()
        with sheltered():
            return self._confirmed(replace(found, optima=quick, best=None))

    def _confirmed(self, found: Found) -> Found:
        kept = []
        for optimum in found.optima[:_FOLLOWED]:
            q = self._come_to(optimum.q)
            if q is not None:
                kept.append(replace(optimum, q=q))
        best = max((optimum.objective for optimum in kept), default=-np.inf)
        if found.best is not None:
            value = float(self.model.objectives(self.setting, found.best[None])[0])
            if value > best and self._come_to(found.best) is not None:
                kept.insert(0, LocalOptimum(found.best, value, 1))
        return replace(found, optima=tuple(kept))

    def _allowed(self, chosen: Indices) -> Mask:
        """Which combinations of nodes can be come to, within limits and margins."""
        assert self.grid is not None
        allowed = self.grid.allowed(chosen)
        cell = self.setting.cell
        for i, (nodes, which) in enumerate(zip(self.nodes, chosen.T, strict=True)):
            beyond = np.maximum(cell.lower[i] - nodes.q, nodes.q - cell.upper[i])[which]
            allowed &= beyond.max(axis=1) <= 0
        return allowed

    def _come_to(self, q: Array) -> Array | None:
        """A posture, (N,), with its joints in the turn in which they can be come to, or None."""
        parts = self.setting.cell.system.split(q)
        turns = [self._turns(i, part) for i, part in enumerate(parts)]
        if self.setting.bodies is None:
            found = []
            for mine, some in zip(self.components, turns, strict=True):
                there = next((each for each in some if mine.holds(each)), None)
                if there is None:
                    return None
                found.append(there)
            return np.concatenate(found)
        for each in islice(product(*turns), _TURNS):
            postures = [sample.closed for sample in self.samples]
            if reachable(self.model, self.setting, self.start, each, postures).whole:
                return np.concatenate(each)
        return None

    def _turns(self, i: int, q: Array) -> list[Array]:
        """Postures of arm i that differ by whole turns within its limits, closed."""
        cell = self.setting.cell
        lower, upper = cell.lower[i], cell.upper[i]
        choices = []
        for value, low, high, turns in zip(q, lower, upper, cell.turns(i), strict=True):
            many = turns and np.isfinite(high - low)
            choices.append(
                [value + 2 * np.pi * k
                 for k in range(int(np.ceil((low - value) / (2 * np.pi) - CLOSED)),
                                int(np.floor((high - value) / (2 * np.pi) + CLOSED)) + 1)]
                if many else [value]
            )  # fmt: skip
        postures = np.array(list(islice(product(*choices), _TURNS)))
        if not len(postures):
            return []
        goal = self.setting.placement.goals[i]
        ends, gaps = project(self.model.arms[i], postures, goal, lower, upper)
        order = np.argsort(np.abs(ends - self.start[i]).max(axis=1), kind="stable")
        return [ends[k] for k in order if gaps[k] <= CLOSED]


def _only(n: int, start: Array | None) -> ArmSample:
    """The sample of an arm of which no more than the start need be known."""
    closed = np.zeros((0, n)) if start is None else start[None]
    return ArmSample(closed, np.zeros((len(closed), 0), dtype=np.intp), 1, None, closed[:0])


def _standing(
    model: PostureModel,
    setting: Setting,
    starts: Sequence[Array | None],
    known: Sequence[ArmSample],
    seed: int,
) -> tuple[list[Array], Blocked | None]:
    """Where the arms are, and what comes too near there.

    An arm whose start the file does not give is where the seed's first closed posture is; or, where
    that comes too near to something, at another of its postures.
    """
    here = [sample.closed[0] if start is None else start
            for sample, start in zip(known, starts, strict=True)]  # fmt: skip
    bodies = setting.bodies
    if bodies is None or model.clear(setting, np.concatenate(here)[None])[0]:
        return here, None
    some = [sample.closed[alone_clear(setting, i, sample.closed)] if start is None else start[None]
            for i, (sample, start) in enumerate(zip(known, starts, strict=True))]  # fmt: skip
    if all(len(each) for each in some) and any(s is None for s in starts):
        rng = np.random.default_rng([seed, len(some), 2])
        q = np.hstack([each[rng.integers(0, len(each), _DRAWN)] for each in some])
        clear = np.flatnonzero(model.clear(setting, q))
        if len(clear):
            return [np.asarray(part) for part in setting.cell.system.split(q[clear[0]])], None
    given = all(start is not None for start in starts)
    blocked = in_the_way(bodies, setting.configurations(here), bodies.every, every=given)
    return here, blocked


def _gridded(
    setting: Setting,
    start: Sequence[Array],
    components: Sequence[Component],
) -> tuple[CoordinationGrid | None, tuple[CurveNodes, ...]]:
    """Nodes of arms of which at most two move, on curves, and which of them can be come to."""
    nodes = []
    for here, mine in zip(start, components, strict=True):
        if mine.curve is not None:
            nodes.append(CurveNodes.along(mine.curve, here, None))
        elif mine.rails.spare <= 0 or setting.cell.arms[len(nodes)].fixed:
            nodes.append(CurveNodes.still(here))
        else:
            return None, ()
    if sum(len(each.q) > 1 for each in nodes) > 2:
        return None, ()
    grid = CoordinationGrid(setting, nodes)
    return grid, tuple(nodes)
