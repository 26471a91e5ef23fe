"""Values of combinations of the arms' postures in the layers of their roadmaps."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from copose.capability.torque_limits import Demand, Dynamics
from copose.cell.dynamics import CellDynamics
from copose.constraints.clearance import in_the_way
from copose.motion.graph.roadmap import Roadmap
from copose.motion.path.knots import Course
from copose.poses import Array, Indices, Mask
from copose.posture.model import PostureModel
from copose.posture.search.clear_samples import alone_clear, kept_apart


@dataclass(frozen=True)
class ValueOptions:
    """Options of the values of combinations."""

    # Cost of holding the object with more than the torque limits, by the excess squared: routes
    # through such combinations come after all others, and the program may mend them.
    overload: float = 1e4
    accuracy: float = 1e-3  # of shares of torque limits
    least: float = -1e299  # value below which there is none


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
        options: ValueOptions = ValueOptions(),
    ) -> None:
        """Evaluate what each arm adds to the sums."""
        self._model, self._course, self._roadmaps = model, course, roadmaps
        self._options = options
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
        """Values less what it costs to hold the object with more than the torque limits."""
        limited = copy(self)
        limited.shares = np.full(len(self._course), np.inf)
        limited._holding = self._held(capacity)
        return limited

    def _held(self, capacity: CellDynamics) -> list[tuple[Dynamics, Demand]]:
        """Equations of motion of the arms' postures and the demand of the hold, by layer."""
        layers = []
        for k, setting in enumerate(self._course.settings):
            holding = capacity.holding(setting.cell)
            q = [roadmap.layers[k].q for roadmap in self._roadmaps]
            layers.append((capacity.dynamics(holding, q), holding.hold))
        return layers

    def _alone(self) -> list[list[Mask]]:
        """Postures that keep clear of all but the other arms, by layer and arm."""
        layers = []
        for k, setting in enumerate(self._course.settings):
            bodies = setting.bodies
            assert bodies is not None
            armless = setting.configurations([None] * len(self._roadmaps))
            still = bool(bodies.clear(armless, bodies.still)[0])
            if not still and self.object_in_the_way is None:
                reason = in_the_way(bodies, armless, bodies.still, every=True).reason
                self.object_in_the_way = k, f"whatever the arms do {reason}"
            masks = [alone_clear(setting, i, roadmap.layers[k].q) & still
                     for i, roadmap in enumerate(self._roadmaps)]  # fmt: skip
            layers.append(masks)
        return layers

    def pairs(self, k: int) -> Array:
        """Values of all combinations of two arms, (count, count'), or of one arm, (count, 1)."""
        nothing, arms = np.zeros(len(self._roadmaps), dtype=np.intp), range(len(self._roadmaps))
        if k not in self._pairs:
            self._pairs[k] = self._light(k, tuple(arms), nothing)
        return self._weighed(k, tuple(arms), nothing, self._pairs[k].copy())

    def partial(self, k: int, arms: tuple[int, ...], nodes: Indices) -> Array:
        """Values of all combinations of two arms with certain postures of the others, (count,
        count'), or of one arm, (count, 1).
        """
        return self._weighed(k, arms, nodes, self._light(k, arms, nodes))

    def _light(self, k: int, arms: tuple[int, ...], nodes: Indices) -> Array:
        """Values as if the object weighed nothing."""
        terms = self._terms[k]
        rows, *second = [
            np.flatnonzero(self._clear[k][i]) if self._clear else np.arange(len(terms[i]))
            for i in arms
        ]
        sums = terms[arms[0]][rows][:, None]
        for j, own in enumerate(terms):
            if j not in arms:
                sums = sums + own[nodes[j]]
        columns = second[0] if second else np.zeros(1, dtype=np.intp)
        if second:
            sums = sums + terms[arms[1]][columns][None]
        counts = [len(terms[i]) for i in arms]
        values = np.full((counts[0], counts[1] if second else 1), -np.inf)
        known = self._of(k, sums.reshape(-1, sums.shape[2]))
        values[np.ix_(rows, columns)] = known.reshape(sums.shape[:2])
        if self._clear and len(terms) > 1:
            self._keep_apart(k, arms, nodes, values)
        return values

    def _weighed(self, k: int, arms: tuple[int, ...], nodes: Indices, values: Array) -> Array:
        """Values less what it costs to hold the object with more than the torque limits."""
        if self._holding:
            usable = np.isfinite(values)
            values[usable] -= self._heavy(k, _chosen(arms, nodes, usable))
        return values

    def _heavy(self, k: int, chosen: Indices) -> Array:
        """Costs of combinations, (count, K), that cannot hold the object within torque limits."""
        if not len(chosen):
            return np.zeros(0)
        alone, hold = self._holding[k]
        shares = alone.quick_shares(hold, list(chosen.T))
        over = np.flatnonzero(~(shares <= 1.0))
        if len(over):
            dynamics = alone.combined(list(chosen[over].T))
            shares[over] = dynamics.shares(hold, self._options.accuracy)
        shares[np.isnan(shares)] = np.inf
        self.shares[k] = min(self.shares[k], shares.min())
        return np.asarray(self._options.overload * np.maximum(shares - 1.0, 0.0) ** 2)

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
        values = np.where(np.isfinite(values) & (values > self._options.least), values, -np.inf)
        if setting.objective.summable and setting.objective.non_smooth:
            # The stand-in without kinks has another scale.
            held = np.isfinite(values)
            own = setting.objective.sums.size(setting.cell.system.space)
            values[held] = setting.objective.values_of_sums(setting, sums[held, :own])
        return values


def _chosen(arms: tuple[int, ...], nodes: Indices, usable: Mask) -> Indices:
    """Combinations, (count, K), of usable postures of one or two arms with those of the others."""
    pairs = np.argwhere(usable)
    chosen = np.tile(nodes, (len(pairs), 1))
    chosen[:, list(arms)] = pairs[:, : len(arms)]
    return chosen
