"""The radius of the largest ball of accelerations around rest, as an objective."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from copose.capability import ExactSet
from copose.capability.residual_balls import ResidualBalls, row_by_row
from copose.capability.torque_limits import Demand
from copose.cell.context import PostureContext
from copose.cell.dynamics import Holding
from copose.objectives.ball_table import ranked
from copose.objectives.facet_ascent import FacetAscent
from copose.objectives.objective import Cuts, LimitReport, Ranked
from copose.objectives.torque_limited import TorqueLimited, least
from copose.poses import Array, Indices, Mask
from copose.problem import Space
from copose.selection import far_apart
from copose.self_motion.manifold import ClosureManifold


@dataclass(frozen=True)
class AllRoundOptions:
    """Numbers of directions that stand in for all of them."""

    compared: int = 8  # directions by which postures are compared at first
    programmed: int = 6  # directions that a program has
    same_normal: float = 0.99  # cosine from which on two facets face the same way
    nearer: float = 1e-9  # by how much a facet is nearer than every demand to be one, relative


class AllRound(TorqueLimited):
    """The radius of the largest ball of accelerations around rest in the exact set's slice.

    Of all directions the worst counts. They are infinitely many: postures are compared by a few of
    them, and a program takes those that are worst where it starts.
    """

    balanced = False
    costly = True

    def __init__(
        self,
        unit: str,
        limits: Sequence[Array],
        axes: Sequence[int],
        space: Space,
        options: AllRoundOptions = AllRoundOptions(),
    ) -> None:
        """On axes of one kind."""
        self.axes, self._options = tuple(axes), options
        a = len(axes)
        corners = [np.array(corner, dtype=float) for corner in product((-1, 1), repeat=a)]
        sides = [sign * e for e in np.eye(a) for sign in (1.0, -1.0)] if a > 1 else []
        self._many = np.array([*(c / np.sqrt(a) for c in corners), *sides])
        self.few = self._many[: options.compared]
        super().__init__("all-round", unit, limits, min(len(self.few), options.programmed), space)

    def demands(self, holding: Holding) -> tuple[Demand, ...]:
        """Along a few directions."""
        return self.along(holding, self.few)

    def values(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """The distance of the nearest facet of the exact set, 0 where rest is outside.

        All facets are enumerated where they are few enough; else `ExactSet` looks for the nearest.
        """
        if self._enumerable:
            radii = self._balls(context, q).facets(row_by_row(len(q[0]), len(q))).radii
            return np.maximum(radii[:, 0], 0.0)
        exact = [self._exact_set(context, row) for row in zip(*q, strict=True)]
        return np.array([np.nan if each is None else each.residual_radius for each in exact])

    def estimates(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """Values, or a bound from above: the least reach in more directions than programs have."""
        if self._enumerable:
            return self.values(context, q)
        return least(self._dynamics(context, q), self.along(context.loaded[1], self._many))

    def ranked(
        self,
        context: PostureContext,
        q: Sequence[Array],
        allowed: Callable[[Indices], Mask] | None,
    ) -> Ranked | None:
        """By bounds of the whole table of one or two arms' postures, see `ball_table`."""
        if len(q) > 2 or not self._enumerable:
            return None
        return ranked(self._balls(context, q), allowed)

    def ascended(
        self,
        context: PostureContext,
        arms: Sequence[ClosureManifold],
        q: Sequence[Array],
        *,
        race: bool,
    ) -> list[Array] | None:
        """Along curves on which the arms can move, see `FacetAscent`."""
        fixed = [arm.fixed for arm in context.cell.arms]
        moving = [None if still else arm for still, arm in zip(fixed, arms, strict=True)]
        ascent = FacetAscent(partial(self._balls, context), moving)
        return ascent.ends(q, race=race) if self._enumerable else None

    def cuts(self, context: PostureContext, q: Sequence[Array]) -> list[Cuts]:
        """Along the normals of the facets next to rest, as many as the program has demands."""
        cuts = []
        for k in range(len(q[0])):
            normals, _ = self._facets(context, [q_arm[k] for q_arm in q])
            distinct = _distinct(normals, self.programmed, self._options.same_normal)
            directions = np.array([*distinct, *self.few][: self.programmed])
            cuts.append(self.along(context.loaded[1], directions))
        return cuts

    def more_cuts(self, context: PostureContext, q: Sequence[Array], cuts: Cuts) -> Cuts | None:
        """The demands with normals of facets that came nearer than all of them, for the loosest."""
        dynamics = self._dynamics(context, q)
        same = dynamics.taken(np.zeros(len(cuts), dtype=np.intp))
        reached = same.farthest(Demand.each(cuts))
        lowest = reached.min()
        normals, depths = self._facets(context, [q_arm[0] for q_arm in q])
        nearer = depths < lowest - self._options.nearer * (1 + abs(lowest))
        if not np.isfinite(lowest) or not nearer.any():
            return None
        added = _distinct(normals[nearer], self.programmed // 2, 1 - 1e-9)
        kept = np.argsort(reached, kind="stable")[: self.programmed - len(added)]
        return (*(cuts[k] for k in kept), *self.along(context.loaded[1], np.array(added)))

    def report(self, limits: LimitReport) -> float | None:
        """The radius as it is stated."""
        return limits.radius(self.axes)

    def _facets(self, context: PostureContext, q: Sequence[Array]) -> tuple[Array, Array]:
        """Normals of the exact set's facets and their distances, nearest first."""
        exact = self._exact_set(context, q)
        facets = None if exact is None else exact.half_spaces
        if facets is None:
            return np.zeros((0, len(self.axes))), np.zeros(0)
        order = np.argsort(facets[1], kind="stable")
        return facets[0][order], facets[1][order]

    @property
    def _enumerable(self) -> bool:
        """True where all facets can be looked at."""
        n_joints = sum(len(scale) for scale in self.scales)
        return ResidualBalls.enumerable(self.space.m, n_joints)

    def _balls(self, context: PostureContext, q: Sequence[Array]) -> ResidualBalls:
        """The largest balls of postures by arm, (count_i, n_i)."""
        holding = context.loaded[1].forces_alone
        dynamics = context.dynamics(q, moments=False)
        return ResidualBalls.of(dynamics, holding.inertia, holding.weight, self.axes)

    def _exact_set(self, context: PostureContext, q: Sequence[Array]) -> ExactSet | None:
        return context.loaded[0].exact_set(context.cell, q, self.axes)

    def along(self, holding: Holding, directions: Array) -> tuple[Demand, ...]:
        """Along unit directions on the axes, (k, a)."""
        whole = np.zeros((len(directions), self.space.m))
        whole[:, list(self.axes)] = directions
        return tuple(holding.forces_alone.acceleration(u) for u in whole)


def _distinct(directions: Array, most: int, alike: float) -> list[Array]:
    """The first unit directions of which no two have such a cosine between them."""
    return far_apart(directions, lambda u, taken: all(u @ other < alike for other in taken), most)
