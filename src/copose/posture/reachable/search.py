"""The search among postures that arms can reach from where they are without letting go.

The object stands still, so each arm stays in its component of the closed postures: samples are
taken from there, and an optimum counts only where it is in the component too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np

from copose.constraints.clearance import Blocked, in_the_way
from copose.poses import Array, Indices, Mask
from copose.posture.local.multistart import LocalSearches
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.reachable.components import Component, component
from copose.posture.reachable.coordination import CoordinationGrid, CurveNodes
from copose.posture.reachable.reachability import reachable
from copose.posture.search.clear_samples import (
    ArmPostures,
    alone_clear,
    clear_postures,
    in_each_others_way,
)
from copose.posture.search.combinations import Combinations
from copose.posture.search.effort import Effort
from copose.posture.search.outcome import SearchOutcome
from copose.posture.setting import Setting
from copose.progress import over, sheltered, stage
from copose.self_motion.curves.curve import TracingOptions
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSample, ArmSampler, neighbours


@dataclass(frozen=True)
class ReachOptions:
    """Effort of the search among postures that can be reached."""

    optima: int = 24  # confirmed at most, best first
    hurried_optima: int = 2  # confirmed where the call has to end
    turns: int = 64  # combinations of whole turns of joints in which an optimum is looked for
    drawn: int = 512  # postures of which the first that keeps clear is a start not given
    usual_loop: int = 240  # postures along a curve from which on it need not be finer


@dataclass(frozen=True, eq=False)
class ReachableSet:
    """The set of postures that arms can reach from a start.

    Attributes:
        model: the posture model.
        setting: where the object is; joints have their limits even where they reach every angle.
        start: posture of the arms, by arm (n_i,).
        samples: postures that each arm can reach by itself; the first is the start where limits
            and margins allow it.
        components: by arm.
        grid: coordination diagram, where there are bodies and at most two arms move, on curves.
        nodes: of the grid, by arm.
        too_near: bodies that come too near at the start.
        options: effort of the search.
    """

    model: PostureModel
    setting: Setting
    start: tuple[Array, ...]
    samples: tuple[ArmSample, ...]
    components: tuple[Component, ...]
    grid: CoordinationGrid | None
    nodes: tuple[CurveNodes, ...]
    too_near: Blocked | None
    options: ReachOptions = ReachOptions()

    @classmethod
    def of(
        cls,
        model: PostureModel,
        setting: Setting,
        starts: Sequence[Array | None],
        seed: int,
        effort: Effort,
        options: ReachOptions = ReachOptions(),
    ) -> ReachableSet | tuple[ArmSample, ...]:
        """The set of postures that can be reached from closed ones, by arm; None for the first that
        the seed gives. Samples alone where an arm that needs one has no closed posture.
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
        samples_at_start = [
            _only(cell.arms[i].n, start) if sample is None else sample
            for i, (sample, start) in enumerate(zip(drawn, starts, strict=True))
        ]
        if any(not len(sample.closed) for sample in samples_at_start):
            return tuple(samples_at_start)
        present, too_near = _standing(model, setting, starts, samples_at_start, seed, options.drawn)
        spacing = TracingOptions.longest / 2 * min(1.0, options.usual_loop / effort.loops)
        components, samples = [], []
        for i, (start, sample) in enumerate(zip(present, samples_at_start, strict=True)):
            reached = component(model, setting, i, start, sample.closed, spacing)
            components.append(reached)
            samples.append(ArmSample(
                closed=reached.postures,
                neighbours=neighbours(cell, model.arms[i], i, reached.postures),
                tried=sample.tried,
                branches=None if reached.manifold.spare > 1 else 1,
                missed=sample.missed,
            ))  # fmt: skip
        grid, nodes = None, tuple[CurveNodes, ...]()
        if setting.bodies is not None and too_near is None:
            grid, nodes = _gridded(setting, present, components)
        return cls(
            model, setting, tuple(present), tuple(samples), tuple(components), grid, nodes,
            too_near, options,
        )  # fmt: skip

    @property
    def single(self) -> bool:
        """True if no arm can leave its start."""
        return all(self.setting.cell.spare(i) <= 0 for i in range(len(self.start)))

    @property
    def stuck(self) -> tuple[str, bool]:
        """The reason why an arm can reach nothing, and whether its component is known entirely."""
        arms = zip(self.setting.cell.arms, self.components, self.samples, strict=True)
        stuck = [
            (arm.name, component.complete)
            for arm, component, sample in arms
            if not len(sample.closed)
        ]
        names = ", ".join(f"arm {name!r}" for name, _ in stuck)
        reason = f"{names} cannot leave the joint_margin that the start is in"
        return reason, any(complete for _, complete in stuck)

    def search(self, seed: int, effort: Effort) -> SearchOutcome:
        """Find local optima among the postures that can be reached, best first."""
        model, setting = self.model, self.setting
        cell, samples = setting.cell, self.samples
        if not all(len(sample.closed) for sample in samples):
            return SearchOutcome(samples)
        climbs = LocalSearches(model, setting, effort.polished, effort.climbing)
        arms = ArmPostures.of(samples)
        if setting.bodies is None:
            return self.confirmed(Combinations(climbs, arms, seed, effort).search(samples))
        if self.grid is not None:
            q = [nodes.q for nodes in self.nodes]
            near = [neighbours(cell, model.arms[i], i, each) for i, each in enumerate(q)]
            combinations = Combinations(climbs, ArmPostures(q, near), seed, effort, self._allowed)
            return self.confirmed(combinations.search(samples))
        cleared = clear_postures(model, setting, arms.postures)
        if cleared.blocked:
            return SearchOutcome(samples, blocked=cleared.blocked)
        outcome = Combinations(climbs, cleared, seed, effort).search(samples)
        if not (outcome.optima or outcome.failures):
            blocked = in_each_others_way(setting, cleared.postures, seed)
            return SearchOutcome(samples, blocked=blocked)
        return self.confirmed(outcome)

    def confirmed(self, outcome: SearchOutcome) -> SearchOutcome:
        """A search's outcome with those of its optima that can be reached.

        Its best combination before polishing is added where it is better, or no optimum is left.
        Where the call has to end, only a few optima are confirmed, and only if that is quick.
        """
        if not over():
            return self._confirmed(outcome)
        hurried = self.options.hurried_optima if self.setting.bodies is None else 0
        with sheltered():
            quick = replace(outcome, optima=outcome.optima[:hurried], best=None)
            return self._confirmed(quick)

    def _confirmed(self, outcome: SearchOutcome) -> SearchOutcome:
        """The outcome of `confirmed` without hurry."""
        kept = []
        for optimum in outcome.optima[: self.options.optima]:
            q = self._reached(optimum.q)
            if q is not None:
                kept.append(replace(optimum, q=q))
        best = max((optimum.objective for optimum in kept), default=-np.inf)
        if outcome.best is not None:
            value = float(self.model.objectives(self.setting, outcome.best[None])[0])
            if value > best and self._reached(outcome.best) is not None:
                kept.insert(0, LocalOptimum(outcome.best, value, 0))
        return replace(outcome, optima=tuple(kept))

    def _allowed(self, chosen: Indices) -> Mask:
        """Mask of combinations of nodes, (count, K), that can be reached, within limits."""
        assert self.grid is not None
        allowed = self.grid.allowed(chosen)
        cell = self.setting.cell
        for i, (nodes, which) in enumerate(zip(self.nodes, chosen.T, strict=True)):
            beyond = np.maximum(cell.lower[i] - nodes.q, nodes.q - cell.upper[i])[which]
            allowed &= beyond.max(axis=1) <= 0
        return allowed

    def _reached(self, q: Array) -> Array | None:
        """A posture, (N,), in the turns of its joints that can be reached; None without any."""
        parts = self.setting.cell.system.split(q)
        turns = [self._turns(i, part) for i, part in enumerate(parts)]
        if self.setting.bodies is None:
            joints = []
            for arm_component, choices in zip(self.components, turns, strict=True):
                choice = next((turned for turned in choices if arm_component.holds(turned)), None)
                if choice is None:
                    return None
                joints.append(choice)
            return np.concatenate(joints)
        for posture in islice(product(*turns), self.options.turns):
            postures = [sample.closed for sample in self.samples]
            if reachable(self.model, self.setting, self.start, posture, postures).whole:
                return np.concatenate(posture)
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
        postures = np.array(list(islice(product(*choices), self.options.turns)))
        if not len(postures):
            return []
        goal = self.setting.placement.goals[i]
        ends, gaps = project(self.model.arms[i], postures, goal, lower, upper)
        order = np.argsort(np.abs(ends - self.start[i]).max(axis=1), kind="stable")
        return [ends[k] for k in order if gaps[k] <= CLOSED]


def _only(n: int, start: Array | None) -> ArmSample:
    """The sample of an arm that needs no closed postures but its start."""
    closed = np.zeros((0, n)) if start is None else start[None]
    return ArmSample(closed, np.zeros((len(closed), 0), dtype=np.intp), 1, None, closed[:0])


def _standing(
    model: PostureModel,
    setting: Setting,
    starts: Sequence[Array | None],
    samples: Sequence[ArmSample],
    seed: int,
    drawn: int,
) -> tuple[list[Array], Blocked | None]:
    """The arms' posture at the start, and the bodies that come too near there.

    An arm whose start the file does not give is at the seed's first closed posture; or, where that
    comes too near to something, at another of its postures, of so many combinations drawn.
    """
    present = [sample.closed[0] if start is None else start
               for sample, start in zip(samples, starts, strict=True)]  # fmt: skip
    bodies = setting.bodies
    if bodies is None or model.feasibility.clear(setting, np.concatenate(present)[None])[0]:
        return present, None
    clear_alone = [
        sample.closed[alone_clear(setting, i, sample.closed)] if start is None else start[None]
        for i, (sample, start) in enumerate(zip(samples, starts, strict=True))
    ]
    if all(len(q) for q in clear_alone) and any(start is None for start in starts):
        rng = np.random.default_rng([seed, len(clear_alone), 2])
        q = np.hstack([rows[rng.integers(0, len(rows), drawn)] for rows in clear_alone])
        clear = np.flatnonzero(model.feasibility.clear(setting, q))
        if len(clear):
            return [np.asarray(part) for part in setting.cell.system.split(q[clear[0]])], None
    given = all(start is not None for start in starts)
    blocked = in_the_way(bodies, setting.configurations(present), bodies.every, every=given)
    return present, blocked


def _gridded(
    setting: Setting,
    start: Sequence[Array],
    components: Sequence[Component],
) -> tuple[CoordinationGrid | None, tuple[CurveNodes, ...]]:
    """Coordination diagram and nodes of arms of which at most two move, on curves; else nothing."""
    nodes = []
    for q, arm_component in zip(start, components, strict=True):
        if arm_component.curve is not None:
            nodes.append(CurveNodes.along(arm_component.curve, q, None))
        elif arm_component.manifold.spare <= 0 or setting.cell.arms[len(nodes)].fixed:
            nodes.append(CurveNodes.still(q))
        else:
            return None, ()
    if sum(len(arm_nodes.q) > 1 for arm_nodes in nodes) > 2:
        return None, ()
    grid = CoordinationGrid(setting, nodes)
    return grid, tuple(nodes)
