"""Closed postures at one placement after another, each continued from a placement near it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.setting import Setting
from copose.robots import finite_range
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSample, held_sample, neighbours, thinned


@dataclass(frozen=True)
class ContinuationOptions:
    """Numbers of postures of an arm at each placement."""

    kept: int = 64  # of those of the nearest placement that close, at most
    fresh: int = 16  # drawn beside them, where self-motions may have come into reach
    fewest: int = 32  # closed ones that are enough
    again: int = 192  # drawn where fewer close
    steps: int = 24  # that close them


class NearbyPostures:
    """Samples of the arms' self-motions wherever what is free moves them.

    An arm's postures depend on the goal of its tip alone, in its root frame: those of the nearest
    goal so far are projected onto the closure, with some drawn afresh; a goal that has been there
    before has its postures already.
    """

    def __init__(
        self, model: PostureModel, seed: int, options: ContinuationOptions = ContinuationOptions()
    ) -> None:
        """Nothing is known yet."""
        self._model, self._seed, self._options = model, seed, options
        self._known: list[list[tuple[Array, ArmSample]]] = [[] for _ in model.arms]

    def add(self, setting: Setting, samples: tuple[ArmSample, ...]) -> None:
        """Samples that another search has drawn at a placement."""
        for i, sample in enumerate(samples):
            self._known[i].append((setting.placement.goals[i], sample))

    def at(self, setting: Setting) -> tuple[ArmSample, ...]:
        """Samples of all arms at a placement, up to the first that does not close."""
        samples: list[ArmSample] = []
        for i in range(len(self._model.arms)):
            samples.append(self._of_arm(setting, i))
            if not len(samples[-1].closed):
                break
        return tuple(samples)

    def _of_arm(self, setting: Setting, i: int) -> ArmSample:
        goal, known, cell = setting.placement.goals[i], self._known[i], setting.cell
        if cell.arms[i].fixed:
            return held_sample(cell, self._model.arms[i], i, goal)
        distances = _distances([there for there, _ in known], goal)
        nearest = int(np.argmin(distances)) if known else None
        if nearest is not None and np.array_equal(known[nearest][0], goal):
            return known[nearest][1]
        options = self._options
        rng = np.random.default_rng([self._seed, i, len(known)])
        starts = self._drawn(setting, i, rng, options.fresh)
        if nearest is not None:
            starts = np.vstack([thinned(known[nearest][1].closed, options.kept), starts])
        closed, tried = self._projected(setting, i, starts), len(starts)
        if len(closed) < options.fewest:
            more = self._drawn(setting, i, rng, options.again)
            closed, tried = (
                np.vstack([closed, self._projected(setting, i, more)]),
                tried + len(more),
            )
        closed = thinned(closed, options.kept)
        near = neighbours(cell, self._model.arms[i], i, closed)
        sample = ArmSample(closed, near, tried, None, closed[:0])
        known.append((goal, sample))
        return sample

    @staticmethod
    def _drawn(setting: Setting, i: int, rng: np.random.Generator, count: int) -> Array:
        low, high = finite_range(setting.cell.lower[i], setting.cell.upper[i])
        return rng.uniform(low, high, (count, len(low)))

    def _projected(self, setting: Setting, i: int, q: Array) -> Array:
        """Projections that close, without repetition, (k, n)."""
        lower, upper = setting.cell.lower[i], setting.cell.upper[i]
        ends, gaps = project(
            self._model.arms[i], q, setting.placement.goals[i], lower, upper,
            steps=self._options.steps, closed=1e-11,
        )  # fmt: skip
        ends = ends[gaps < CLOSED]
        once = np.unique(ends.round(3), axis=0, return_index=True)[1]
        return np.asarray(ends[np.sort(once)])


def _distances(known: Sequence[Array], goal: Array) -> Array:
    """Distances of goals, position and quaternion, to one: m and half radians, (count,)."""
    goals = np.array(known).reshape(-1, 7)
    turned = np.minimum(*(np.linalg.norm(goals[:, 3:] - s * goal[3:], axis=1) for s in (1, -1)))
    return np.asarray(np.linalg.norm(goals[:, :3] - goal[:3], axis=1) + turned)
