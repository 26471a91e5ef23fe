"""What combinations of the arms' postures are worth along a course."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from copose.capability.torque_limits import Demand, Dynamics
from copose.cell.dynamics import CellDynamics
from copose.constraints.clearance import in_the_way
from copose.motion.graph.roadmap import Roadmap
from copose.motion.path.knots import Course
from copose.poses import Array, Indices, Mask
from copose.posture.model import PostureModel
from copose.posture.search.clear_samples import alone_clear, kept_apart

_UNHELD = -1e299
# What it costs to hold the object with more than the torque limits, by the excess squared: routes
# through such combinations come after all others, and the program may mend them.
_TOO_HEAVY = 1e4
# How well shares of limits are known.
_ABOUT = 1e-3


class NodeValues:
    """The objective of combinations of postures, layer by layer, or what stands in for it; −∞ where
    it has none, the object cannot be held, or bodies come too near.

    Attributes:
        combinations: how many were evaluated.
        shares: by layer, the least of the largest shares of a torque limit that hold the object at
            rest, of all combinations that were looked at; 0 where that is not asked.
        object_in_the_way: the first layer where bodies that no arm moves come too near, and which.
    """

    def __init__(
        self,
        model: PostureModel,
        course: Course,
        roadmaps: Sequence[Roadmap],
    ) -> None:
        """Evaluate what each arm adds to the sums."""
        self._model, self._course, self._roadmaps = model, course, roadmaps
        self._terms = [
            [model.terms(setting, i, roadmap.layers[k].q) for i, roadmap in enumerate(roadmaps)]
            for k, setting in enumerate(course.settings)
        ]
        self.combinations = 0
        self.shares = np.zeros(len(course))
        self._holding: list[tuple[Dynamics, Demand]] = []
        self._pairs: dict[int, Array] = {}
        self.object_in_the_way: tuple[int, str] | None = None
        self._clear = [] if model.bodies is None else self._alone()

    def within(self, capacity: CellDynamics) -> NodeValues:
        """The same less what it costs to hold the object with more than the torque limits."""
        other = copy(self)
        other.shares = np.full(len(self._course), np.inf)
        other._holding = self._held(capacity)
        return other

    def _held(self, capacity: CellDynamics) -> list[tuple[Dynamics, Demand]]:
        """By layer, the equations of motion of each arm's postures and what holds the object."""
        found = []
        for k, setting in enumerate(self._course.settings):
            holding = capacity.holding(setting.cell)
            q = [roadmap.layers[k].q for roadmap in self._roadmaps]
            found.append((capacity.dynamics(holding, q), holding.hold))
        return found

    def _alone(self) -> list[list[Mask]]:
        """By layer and arm, which postures keep clear of all but the other arms."""
        found = []
        for k, setting in enumerate(self._course.settings):
            bodies = setting.bodies
            assert bodies is not None
            here = setting.configurations([None] * len(self._roadmaps))
            still = bool(bodies.clear(here, bodies.still)[0])
            if not still and self.object_in_the_way is None:
                reason = in_the_way(bodies, here, bodies.still, every=True).reason
                self.object_in_the_way = k, f"whatever the arms do {reason}"
            masks = [alone_clear(setting, i, roadmap.layers[k].q) & still
                     for i, roadmap in enumerate(self._roadmaps)]  # fmt: skip
            found.append(masks)
        return found

    def pairs(self, k: int) -> Array:
        """Of all combinations of two arms' postures, (count, count'), of one arm (count, 1)."""
        nothing, arms = np.zeros(len(self._roadmaps), dtype=np.intp), range(len(self._roadmaps))
        if k not in self._pairs:
            self._pairs[k] = self._light(k, tuple(arms), nothing)
        return self._weighed(k, tuple(arms), nothing, self._pairs[k].copy())

    def beside(self, k: int, arms: tuple[int, ...], nodes: Indices) -> Array:
        """Of all combinations of one or two arms' postures beside some of the others', (count,
        count'), of one arm (count, 1).
        """
        return self._weighed(k, arms, nodes, self._light(k, arms, nodes))

    def _light(self, k: int, arms: tuple[int, ...], nodes: Indices) -> Array:
        """As if the object weighed nothing."""
        terms = self._terms[k]
        one, *other = [
            np.flatnonzero(self._clear[k][i]) if self._clear else np.arange(len(terms[i]))
            for i in arms
        ]
        sums = terms[arms[0]][one][:, None]
        for j, mine in enumerate(terms):
            if j not in arms:
                sums = sums + mine[nodes[j]]
        columns = other[0] if other else np.zeros(1, dtype=np.intp)
        if other:
            sums = sums + terms[arms[1]][columns][None]
        counts = [len(terms[i]) for i in arms]
        values = np.full((counts[0], counts[1] if other else 1), -np.inf)
        found = self._of(k, sums.reshape(-1, sums.shape[2]))
        values[np.ix_(one, columns)] = found.reshape(sums.shape[:2])
        if self._clear and len(terms) > 1:
            self._keep_apart(k, arms, nodes, values)
        return values

    def _weighed(self, k: int, arms: tuple[int, ...], nodes: Indices, values: Array) -> Array:
        """Less what it costs to hold the object with more than the torque limits."""
        if self._holding:
            usable = np.isfinite(values)
            values[usable] -= self._heavy(k, _chosen(arms, nodes, usable))
        return values

    def _heavy(self, k: int, chosen: Indices) -> Array:
        """What it costs that combinations, (count, K), hold the object with more than they have."""
        if not len(chosen):
            return np.zeros(0)
        alone, hold = self._holding[k]
        dynamics = alone.combined(list(chosen.T))
        shares = dynamics.quick_shares(hold)
        over = np.flatnonzero(~(shares <= 1.0))
        if len(over):
            shares[over] = dynamics.taken(over).shares(hold, _ABOUT)
        shares[np.isnan(shares)] = np.inf
        self.shares[k] = min(self.shares[k], shares.min())
        return np.asarray(_TOO_HEAVY * np.maximum(shares - 1.0, 0.0) ** 2)

    def _keep_apart(self, k: int, arms: tuple[int, ...], nodes: Indices, values: Array) -> None:
        """Rule out combinations that are too near each other."""
        usable = np.isfinite(values)
        chosen = _chosen(arms, nodes, usable)
        if not len(chosen):
            return
        q = [roadmap.layers[k].q for roadmap in self._roadmaps]
        clear = kept_apart(self._course.settings[k], q)(chosen)
        values[usable] = np.where(clear, values[usable], -np.inf)

    def _of(self, k: int, sums: Array) -> Array:
        model, setting = self._model, self._course.settings[k]
        self.combinations += len(sums)
        values = model.score.value(sums, setting.given)[:, 0]
        values = np.where(np.isfinite(values) & (values > _UNHELD), values, -np.inf)
        if setting.objective.summable and setting.objective.non_smooth:
            # The stand-in without kinks has another scale.
            held = np.isfinite(values)
            own = setting.objective.sums.size(setting.cell.system.space)
            values[held] = setting.objective.values_of_sums(setting, sums[held, :own])
        return values


def _chosen(arms: tuple[int, ...], nodes: Indices, usable: Mask) -> Indices:
    """Combinations, (count, K), of one or two arms' postures beside the others'."""
    found = np.argwhere(usable)
    chosen = np.tile(nodes, (len(found), 1))
    chosen[:, list(arms)] = found[:, : len(arms)]
    return chosen
