"""Objectives that torque limits decide: accelerations, payload, all-round acceleration.

Each is the least of the farthest t of some demands, see `Demand`: linear programs at a given
posture, and in the posture program more variables and constraints, without any pseudoinverse.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from itertools import product
from typing import ClassVar

import casadi as ca
import numpy as np

from copose.capability import HoldingTorque, Sums, TorqueReach
from copose.capability.torque_limits import Demand, Dynamics, JointMotion
from copose.cell.cell import Cell
from copose.cell.dynamics import CellDynamics, Holding
from copose.objectives.ellipsoid_measures import Objective
from copose.poses import Array
from copose.problem import Space

# The part of the torque limits within which programs start, and the cosine from which on two facets
# face the same way.
_INSIDE, _SAME_NORMAL = 0.9, 0.99
# Directions by which postures are compared at first, and that a program has.
_COMPARED, _PROGRAMMED = 8, 6
# m/s², a typical acceleration of free fall.
_FALL = 9.81
# By how much a facet has to be nearer than every demand, relative, to be one itself.
_AS_NEAR = 1e-9


class LimitsMeasure(Objective):
    """The least t that some demands reach.

    Attributes:
        programmed: demands that a program has.
        space: the task space.
        balanced: whether moments balance in the linear spaces too, and limits of contact wrenches
            count.
    """

    balanced = True
    joints: JointMotion = JointMotion.FREE
    """Which joint accelerations its demands have."""
    dear: ClassVar[bool] = False
    """Whether a climb takes many programs."""

    def __init__(
        self,
        kind: str,
        unit: str,
        limits: Sequence[Array],
        count: int,
        space: Space,
        sums: Sums | None = None,
    ) -> None:
        """An objective on torque limits by arm, (n,)."""
        super().__init__(kind, unit, TorqueReach() if sums is None else sums, limits)
        self.programmed, self.space = count, space

    def size(self, capacity: CellDynamics) -> float:
        """A typical t: an acceleration."""
        return float(capacity.sizes[0].max())

    @abstractmethod
    def demands(self, holding: Holding) -> tuple[Demand, ...]:
        """What is demanded of arms that hold an object."""

    def numbers(self, demands: Sequence[Demand]) -> Array:
        """Demands as parameters of expressions."""
        parts = [part for each in demands for part in (each.motion, each.load)]
        return np.concatenate([part.ravel(order="F") for part in parts])

    def parted(self, numbers: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
        """Motion, (m, 2), and load, (b, 2), of each demand from these parameters."""
        m = self.space.m
        b = len(self.space.balance) if self.balanced else m
        demands = numbers.numel() // (2 * m + 2 * b)
        edges = np.cumsum([0] + [2 * m, 2 * b] * demands).tolist()
        parts = ca.vertsplit(numbers, edges)
        pairs = zip(parts[::2], parts[1::2], strict=True)
        return [(ca.reshape(motion, m, 2), ca.reshape(load, b, 2)) for motion, load in pairs]

    def carried(self, motion: ca.SX, mass: ca.SX) -> ca.SX:
        """What M_o multiplies in the load of a demand with this motion, (m, 2)."""
        return motion

    def score(self, sums: ca.SX, M_o: ca.SX, numbers: ca.SX, axes: Sequence[int]) -> ca.SX:
        """The least reach, with the box of torques taken for an ellipsoid."""
        total = sum(len(scale) for scale in self.scales)
        b = len(self.space.balance)
        least = ca.SX(np.inf)
        for motion, load in self.parted(numbers):
            least = ca.fmin(least, TorqueReach.farthest(sums, b, motion, load, total))
        return least

    def estimates(self, capacity: CellDynamics, holding: Holding, q: Sequence[Array]) -> Array:
        """The least of the farthest t, NaN where there is none, of postures (count, n_i)."""
        return self._least(self._dynamics(capacity, holding, q), self.demands(holding))

    @staticmethod
    def _least(dynamics: Dynamics, demands: Sequence[Demand]) -> Array:
        """The least of the farthest t of each posture, (count,)."""
        count, many = len(dynamics.M[0]), len(demands)
        if count == 0:
            return np.zeros(0)
        every = dynamics.taken(np.repeat(np.arange(count), many))
        reached = every.farthest(Demand.each([*demands] * count))
        return np.asarray(reached.reshape(count, many).min(axis=1))

    def exact(
        self, capacity: CellDynamics, cell: Cell, holding: Holding, q: Sequence[Array]
    ) -> Array:
        """The value of postures, by arm (count, n_i); NaN where there is none, (count,)."""
        return self.estimates(capacity, holding, q)

    def nearest(
        self, capacity: CellDynamics, cell: Cell, holding: Holding, q: Sequence[Array]
    ) -> list[tuple[Demand, ...]]:
        """The demands that count at each of some postures, by arm (count, n_i)."""
        return [self.demands(holding)] * len(q[0])

    def tightened(
        self,
        capacity: CellDynamics,
        cell: Cell,
        holding: Holding,
        q: Sequence[Array],
        demands: Sequence[Demand],
    ) -> tuple[Demand, ...] | None:
        """Demands that a program left out and that count where it ended, by arm (1, n_i).

        None where it left out none.
        """
        return None

    def starts(
        self,
        capacity: CellDynamics,
        holding: Holding,
        q: Sequence[Array],
        demands: Sequence[Sequence[Demand]],
    ) -> Array:
        """Where the variables of programs start at postures, by arm (count, n_i); (count, v).

        Inside the torque limits where that can be: an interior-point method starts there. Each
        over a typical size, see `limits_addition`.
        """
        count, many = len(demands), len(demands[0])
        here = self._dynamics(capacity, holding, q)
        every = here.taken(np.repeat(np.arange(count), many))
        each = Demand.each([demand for wanted in demands for demand in wanted])
        found = np.column_stack(every.inside(each, _INSIDE))
        lost = ~np.isfinite(found[:, 0])
        if lost.any():
            found[lost] = np.column_stack(every.inside(each, 1.0))[lost]
        t, accelerations, wrenches = np.split(found, [1, 1 + here.n_joints], axis=1)
        if self.joints is JointMotion.LEAST_NORM:
            accelerations = every.pulls(accelerations)
        elif self.joints is JointMotion.REST:
            accelerations = accelerations[:, :0]
        fast, strong = capacity.sizes
        counts = [len(T) for T in capacity.limits]
        if self.joints is not JointMotion.FREE:
            counts = [accelerations.shape[1] // len(counts)] * len(counts)
        found = np.hstack(
            [
                t / self.size(capacity),
                accelerations / np.repeat(fast, counts),
                wrenches / np.repeat(strong, self.space.m),
            ]
        )
        found = found.reshape(count, many, -1)
        stacked = found.reshape(count, -1)
        least = found[:, :, 0].min(axis=1, keepdims=True)
        return np.hstack([stacked, least]) if many > 1 else stacked

    def _dynamics(self, capacity: CellDynamics, holding: Holding, q: Sequence[Array]) -> Dynamics:
        held = holding if self.balanced else holding.forces_alone
        return capacity.dynamics(held, q, bounded=self.balanced)


class Acceleration(LimitsMeasure):
    """The largest acceleration along a direction, others zero; of several the smallest."""

    def __init__(
        self,
        unit: str,
        limits: Sequence[Array],
        directions: Array,
        space: Space,
    ) -> None:
        """Along unit directions, (k, m)."""
        super().__init__("acceleration", unit, limits, len(directions), space)
        self.directions = directions

    def demands(self, holding: Holding) -> tuple[Demand, ...]:
        """One for each direction."""
        return tuple(holding.acceleration(u) for u in self.directions)


class Payload(LimitsMeasure):
    """The largest mass held with every joint at rest, or accelerated in a certain way with the
    least-norm joint accelerations.
    """

    def __init__(self, limits: Sequence[Array], acceleration: Array, space: Space) -> None:
        """With a_o, (m,)."""
        self.acceleration = acceleration
        self.joints = JointMotion.LEAST_NORM if acceleration.any() else JointMotion.REST
        sums = HoldingTorque(moving=self.joints is JointMotion.LEAST_NORM)
        super().__init__("payload", "kg", limits, 1, space, sums)

    def demands(self, holding: Holding) -> tuple[Demand, ...]:
        """Any mass."""
        return (holding.payload(self.acceleration),)

    def size(self, capacity: CellDynamics) -> float:
        """A mass that weighs as much as an arm can push with."""
        return float(capacity.sizes[1].max() / _FALL)

    def carried(self, motion: ca.SX, mass: ca.SX) -> ca.SX:
        """The acceleration, per kg, in proportion to t."""
        return ca.horzcat(ca.SX(motion.shape[0], 1), motion[:, 0] / mass)

    def score(self, sums: ca.SX, M_o: ca.SX, numbers: ca.SX, axes: Sequence[int]) -> ca.SX:
        """With the box of torques taken for an ellipsoid."""
        ((motion, load),) = self.parted(numbers)
        total = sum(len(scale) for scale in self.scales)
        moving = motion[:, 0] if self.joints is JointMotion.LEAST_NORM else None
        return HoldingTorque.farthest(sums, load, total, moving)


class AllRound(LimitsMeasure):
    """The radius of the largest ball of accelerations around rest in the exact set's slice.

    Of all directions the worst counts. They are infinitely many: postures are compared by a few of
    them, and a program takes those that are worst where it starts.
    """

    balanced = False
    dear = True

    def __init__(
        self, unit: str, limits: Sequence[Array], axes: Sequence[int], space: Space
    ) -> None:
        """On axes of one kind."""
        self.axes = tuple(axes)
        a = len(axes)
        corners = [np.array(corner, dtype=float) for corner in product((-1, 1), repeat=a)]
        sides = [sign * e for e in np.eye(a) for sign in (1.0, -1.0)] if a > 1 else []
        self._many = np.array([*(c / np.sqrt(a) for c in corners), *sides])
        self.few = self._many[:_COMPARED]
        super().__init__("all-round", unit, limits, min(len(self.few), _PROGRAMMED), space)

    def demands(self, holding: Holding) -> tuple[Demand, ...]:
        """Along a few directions."""
        return self.along(holding, self.few)

    def exact(
        self, capacity: CellDynamics, cell: Cell, holding: Holding, q: Sequence[Array]
    ) -> Array:
        """The distance of the nearest facet of the exact set."""
        values = []
        for row in range(len(q[0])):
            found = capacity.exact_set(cell, [mine[row] for mine in q], self.axes)
            values.append(np.nan if found is None else found.residual_radius)
        return np.array(values)

    def nearest(
        self, capacity: CellDynamics, cell: Cell, holding: Holding, q: Sequence[Array]
    ) -> list[tuple[Demand, ...]]:
        """Along the normals of the facets next to rest, as many as the program has demands."""
        wanted = []
        for k in range(len(q[0])):
            normals, _ = self._facets(capacity, cell, [mine[k] for mine in q])
            directions = [*_distinct(normals, self.programmed, _SAME_NORMAL), *self.few]
            wanted.append(self.along(holding, np.array(directions[: self.programmed])))
        return wanted

    def tightened(
        self,
        capacity: CellDynamics,
        cell: Cell,
        holding: Holding,
        q: Sequence[Array],
        demands: Sequence[Demand],
    ) -> tuple[Demand, ...] | None:
        """With the normals of facets that came nearer than all demands, for the loosest of them."""
        dynamics = self._dynamics(capacity, holding, q)
        same = dynamics.taken(np.zeros(len(demands), dtype=np.intp))
        reached = same.farthest(Demand.each(demands))
        least = reached.min()
        normals, depths = self._facets(capacity, cell, [mine[0] for mine in q])
        nearer = depths < least - _AS_NEAR * (1 + abs(least))
        if not np.isfinite(least) or not nearer.any():
            return None
        added = _distinct(normals[nearer], self.programmed // 2, 1 - 1e-9)
        kept = np.argsort(reached, kind="stable")[: self.programmed - len(added)]
        return (*(demands[k] for k in kept), *self.along(holding, np.array(added)))

    def _facets(
        self, capacity: CellDynamics, cell: Cell, q: Sequence[Array]
    ) -> tuple[Array, Array]:
        """Normals of the exact set's facets and their distances, nearest first."""
        found = capacity.exact_set(cell, q, self.axes)
        facets = None if found is None else found.half_spaces
        if facets is None:
            return np.zeros((0, len(self.axes))), np.zeros(0)
        order = np.argsort(facets[1], kind="stable")
        return facets[0][order], facets[1][order]

    def estimates(self, capacity: CellDynamics, holding: Holding, q: Sequence[Array]) -> Array:
        """A bound from above: the least reach in more directions than programs have."""
        dynamics = self._dynamics(capacity, holding, q)
        return self._least(dynamics, self.along(holding, self._many))

    def along(self, holding: Holding, directions: Array) -> tuple[Demand, ...]:
        """Along unit directions on the axes, (k, a)."""
        whole = np.zeros((len(directions), self.space.m))
        whole[:, list(self.axes)] = directions
        return tuple(holding.forces_alone.acceleration(u) for u in whole)


def _distinct(directions: Array, most: int, alike: float) -> list[Array]:
    """The first unit directions of which no two have such a cosine between them."""
    chosen: list[Array] = []
    for u in directions:
        if len(chosen) == most:
            break
        if all(u @ other < alike for other in chosen):
            chosen.append(u)
    return chosen
