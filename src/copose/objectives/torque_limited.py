"""Objectives that torque limits decide: the least of the farthest t of some demands, see `Demand`.

Linear programs at a given posture; in a program more variables and constraints, without any
pseudoinverse.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import casadi as ca
import numpy as np

from copose.capability import Sums, TorqueReach
from copose.capability.torque_limits import Demand, Dynamics, JointMotion
from copose.cell.context import PostureContext
from copose.cell.dynamics import CellDynamics, Holding
from copose.constraints.constraint import Constraint
from copose.constraints.torque import demand_term
from copose.mechanics import System
from copose.objectives.objective import Cuts, Objective, Term
from copose.poses import Array
from copose.problem import Space


class TorqueLimited(Objective):
    """The least t that some demands reach.

    Attributes:
        programmed: demands that a program has.
        space: the task space.
        balanced: whether moments balance in the linear spaces too, and limits of contact wrenches
            count.
    """

    torque_limited = piecewise = True
    balanced = True
    joints: JointMotion = JointMotion.FREE
    """Joint accelerations that its demands have."""

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
        """The demands on arms that hold an object."""

    def parameters(self, holding: Holding | None) -> Array:
        """All demands as numbers."""
        assert holding is not None
        return self.numbers(self.demands(holding))

    def program_size(self, holding: Holding | None) -> int:
        """The count of numbers of as many demands as a program has."""
        assert holding is not None
        return len(self.numbers(self.demands(holding)[: self.programmed]))

    def program_numbers(self, context: PostureContext, cuts: Cuts) -> Array:
        """Its demands as numbers."""
        return self.numbers(cuts)

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
        """The acceleration that M_o multiplies in the load of a demand with this motion, (m, 2)."""
        return motion

    def score(self, sums: ca.SX, M_o: ca.SX, numbers: ca.SX, axes: Sequence[int]) -> ca.SX:
        """The least reach, with the box of torques taken for an ellipsoid."""
        total = sum(len(scale) for scale in self.scales)
        b = len(self.space.balance)
        least = ca.SX(np.inf)
        for motion, load in self.parted(numbers):
            least = ca.fmin(least, TorqueReach.farthest(sums, b, motion, load, total))
        return least

    def estimates(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """The least of the farthest t, NaN where there is none."""
        return least(self._dynamics(context, q), self.demands(context.loaded[1]))

    def values(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """The least of the farthest t, which is exact with finitely many demands."""
        return self.estimates(context, q)

    def cuts(self, context: PostureContext, q: Sequence[Array]) -> list[Cuts]:
        """All demands at every posture."""
        return [self.demands(context.loaded[1])] * len(q[0])

    def starts(self, context: PostureContext, q: Sequence[Array], cuts: Sequence[Cuts]) -> Array:
        """Starts inside the torque limits where that can be, for an interior-point method; each
        over a typical size, see `term`.
        """
        capacity, _ = context.loaded
        count, many = len(cuts), len(cuts[0])
        dynamics = self._dynamics(context, q)
        every = dynamics.taken(np.repeat(np.arange(count), many))
        demand = Demand.each([demand for demands in cuts for demand in demands])
        # With a tenth of the torque limits left, or else with all of them used.
        inside = np.column_stack(every.inside(demand, 0.9))
        lost = ~np.isfinite(inside[:, 0])
        if lost.any():
            inside[lost] = np.column_stack(every.inside(demand, 1.0))[lost]
        t, accelerations, wrenches = np.split(inside, [1, 1 + dynamics.n_joints], axis=1)
        if self.joints is JointMotion.LEAST_NORM:
            accelerations = every.pulls(accelerations)
        elif self.joints is JointMotion.REST:
            accelerations = accelerations[:, :0]
        fast, strong = capacity.sizes
        counts = [len(T) for T in capacity.limits]
        if self.joints is not JointMotion.FREE:
            counts = [accelerations.shape[1] // len(counts)] * len(counts)
        scaled = np.hstack(
            [
                t / self.size(capacity),
                accelerations / np.repeat(fast, counts),
                wrenches / np.repeat(strong, self.space.m),
            ]
        ).reshape(count, many, -1)
        stacked = scaled.reshape(count, -1)
        lowest = scaled[:, :, 0].min(axis=1, keepdims=True)
        return np.hstack([stacked, lowest]) if many > 1 else stacked

    def term(
        self,
        system: System,
        axes: Sequence[int],
        numbers: ca.SX,
        capacity: CellDynamics | None,
        inertia: ca.SX | None = None,
    ) -> Term:
        """The least t of the demands.

        Variables are those of each demand, t first, see `demand_term`; with several demands the
        last variable is the least t. All are over typical sizes.
        """
        assert capacity is not None
        bounds = capacity.bounds if self.balanced else capacity.bounds.none
        size = self.size(capacity)
        turned = None if inertia is None else system.object.M_o - inertia
        reached: list[ca.SX] = []
        variables: list[ca.SX] = []
        constraints: list[Constraint] = []
        for k, (motion, load) in enumerate(self.parted(numbers)):
            name = "" if self.programmed == 1 else f" of demand {k + 1}"
            t = ca.SX.sym("t")
            if turned is not None:
                added = turned @ self.carried(motion, system.object.mass)
                load += ca.vertcat(added, ca.SX(load.shape[0] - added.shape[0], 2))
            given = ca.vertcat(1, size * t)
            own, rows = demand_term(
                system, motion @ given, load @ given, self.joints, capacity, bounds, name
            )
            reached.append(t)
            variables += [t, *own]
            constraints += rows
        lowest = reached[0]
        if self.programmed > 1:
            lowest = ca.SX.sym("least")
            ahead = ca.vertcat(*(t - lowest for t in reached))
            zero, endless = np.zeros(len(reached)), np.full(len(reached), np.inf)
            constraints.append(Constraint("least of the demands", ahead, zero, endless, "1"))
            variables.append(lowest)
        natural = size * lowest
        return Term(
            natural / size, natural, ca.vertcat(*variables), tuple(constraints), exact_hessian=True
        )

    def _dynamics(self, context: PostureContext, q: Sequence[Array]) -> Dynamics:
        return context.dynamics(q, moments=self.balanced)


def least(dynamics: Dynamics, demands: Sequence[Demand]) -> Array:
    """The least of the farthest t of some demands at each posture, NaN where one has none,
    (count,).
    """
    count, many = len(dynamics.M[0]), len(demands)
    if count == 0:
        return np.zeros(0)
    every = dynamics.taken(np.repeat(np.arange(count), many))
    reached = every.farthest(Demand.each([*demands] * count))
    return np.asarray(reached.reshape(count, many).min(axis=1))
