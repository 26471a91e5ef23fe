"""Local maxima with more free than joints: Newton steps over all cases and placements at once.

What is free moves the goals of the arms, their ties to the object and its inertia; the closures of
all cases tie it to the joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise

import casadi as ca
import numpy as np

from copose.capability import symmetric, upper_triangle
from copose.cell.variables import Places
from copose.kernels import Kernel
from copose.objectives.objective import Objective
from copose.poses import Array, Indices, Mask
from copose.posture.solvers.active_set import ActiveSet, Iterates, ascent
from copose.self_motion.kernels import ArmKernels, placed_kernel
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.tangent_space import Tangent


class PlacedKernels:
    """Kernels of a cell in which more than joints is free.

    Attributes:
        places: what is free.
        arms: see `placed_kernel`, by arm.
        placer: of x, (d,), and `Freedom.numbers`: upper triangle of M_o, then goal and coupling of
            every arm, and the derivative of all that by x, row by row.
        edges: where its parts end.
        sums: the number of sums and entries of M_o.
        score: of sums and M_o, and of the object's weight and the objective's numbers: the value
            and its derivatives by sums and M_o.
    """

    def __init__(self, places: Places, objective: Objective, numbers: int) -> None:
        """Write them down, for an objective with so many parameters."""
        system, sums = places.cell.system, objective.sums
        space, m = system.space, system.space.m
        self.places = places
        self.arms = system.by_model(lambda arm: placed_kernel(arm, sums))
        parts = [upper_triangle(system.object.M_o)]
        for i in range(len(system.arms)):
            goal, coupling = system.goal(i), system.coupling(i)
            parts += [ca.vertcat(goal.position, goal.quaternion), coupling.stacked(sums.uses)]
        self.edges = np.cumsum([part.numel() for part in parts])
        x, given = ca.SX.sym("x", len(places.freedom)), ca.SX.sym("given", places.count)
        moved = ca.substitute(ca.vertcat(*parts), system.parameters, places.moved(x, given))
        self.placer = Kernel(x, given, ca.vertcat(moved, ca.vec(ca.jacobian(moved, x).T)))
        symbols = ca.SX.sym("sums", sums.size(space)), ca.SX.sym("M_o", m * (m + 1) // 2)
        weight, n = ca.SX.sym("weight", len(space.balance)), ca.SX.sym("n", numbers)
        value = objective.score(symbols[0], symmetric(symbols[1], m), n, places.cell.problem.axes)
        self.sums = sums.size(space) + m * (m + 1) // 2
        both, given = ca.vertcat(*symbols), ca.vertcat(weight, n)
        self.score = Kernel(both, given, ca.vertcat(value, ca.gradient(value, both)))

    @property
    def all(self) -> tuple[Kernel, ...]:
        """Every kernel of the cell."""
        return *dict.fromkeys(self.arms), self.placer, self.score

    def place(self, x: Array, numbers: Array) -> tuple[list[Array], list[Array]]:
        """Parts of the placer at x, (count, d), (count, p) each, and derivatives, (count, p, d)."""
        values = self.placer(x, numbers)
        size, edges = self.edges[-1], self.edges[:-1]
        slopes = values[:, size:].reshape(len(x), size, x.shape[1])
        rows = [slice(*ends) for ends in zip([0, *edges], self.edges, strict=True)]
        return [values[:, part] for part in rows], [slopes[:, part] for part in rows]


@dataclass(frozen=True, eq=False)
class PlacedArm:
    """An arm of a cell in which more than joints is free.

    Attributes:
        kernels: of its model.
        placed: alike, see `placed_kernel`.
        scale: its torque scale, the end of its tie, (n,).
    """

    kernels: ArmKernels
    placed: Kernel
    scale: Array

    def tie(self, coupling: Array) -> Array:
        """Ties of couplings, (count, t)."""
        return np.hstack([coupling, np.broadcast_to(self.scale, (len(coupling), len(self.scale)))])


@dataclass(frozen=True, eq=False)
class PlacedCase:
    """A case of such a cell.

    Attributes:
        numbers: its `Freedom.numbers`.
        given: the object's weight and the objective's numbers.
        weight: of its objective.
        columns: of its free coordinates among all variables, (d,).
    """

    numbers: Array
    given: Array
    weight: float
    columns: Indices


@dataclass(frozen=True, eq=False)
class Variables:
    """The variables of all cases as one block, see `Places`: one row each."""

    columns: Indices
    lower: Array
    upper: Array

    @classmethod
    def of(cls, lower: Array, upper: Array) -> Variables:
        """Variables between bounds, (v,)."""
        return cls(np.arange(len(lower))[None], lower[None], upper[None])


@dataclass(frozen=True, eq=False)
class PlacedPolisher(ActiveSet):
    """An active-set method over the joints of all cases and what is free.

    Attributes:
        kernels: of the cell.
        arms: of the cell.
        cases: of the problem.
    """

    kernels: PlacedKernels
    arms: Sequence[PlacedArm]
    cases: Sequence[PlacedCase]

    @cached_property
    def _joints(self) -> list[list[slice]]:
        """Joints of every arm among the variables, by case."""
        sizes = [arm.kernels.n for arm in self.arms]
        edges = np.cumsum([0, *sizes * len(self.cases)])
        rows = [slice(first, last) for first, last in pairwise(edges)]
        return [rows[k : k + len(sizes)] for k in range(0, len(rows), len(sizes))]

    def point(self, q: list[Array], held: list[Mask]) -> Iterates:
        """Evaluate closed variables; known are sums and M_o, and the value's slopes by them."""
        z = q[0][:, 0]
        value, sums, slopes = np.zeros(len(z)), [], []
        for case, joints in zip(self.cases, self._joints, strict=True):
            parts, _ = self.kernels.place(z[:, case.columns], case.numbers)
            terms = sum(
                arm.kernels.terms(z[:, rows], arm.tie(coupling))
                for arm, rows, coupling in zip(self.arms, joints, parts[2::2], strict=True)
            )
            sums.append(np.hstack([np.asarray(terms), parts[0]]))
            both = case.weight * self.kernels.score(sums[-1], case.given)
            value += both[:, 0]
            slopes.append(both[:, 1:])
        return Iterates(q, held, value, [np.stack(sums, axis=1), np.stack(slopes, axis=1)])

    def tangent(self, j: int, point: Iterates, held: Mask) -> Tangent:
        """The tangent spaces of all variables."""
        return Tangent.of(*self.slopes(j, point), held)

    def slopes(self, j: int, point: Iterates) -> tuple[Array, Array]:
        """Derivatives of all closures and of the value by all variables."""
        return self._local(point.q[0][:, 0], point.known[1])[1:]

    def _local(self, z: Array, weights: Array) -> tuple[Array, Array, Array]:
        """Sums and M_o, (count, C, s), derivatives of closures, (count, C·K·m, v), and of the
        weighted sums, (count, v).

        Args:
            z: variables, (count, v).
            weights: of the sums, (count, C, s).
        """
        m, K = self.arms[0].kernels.m, len(self.arms)
        every, slope = [], np.zeros(z.shape)
        J = np.zeros((len(z), len(self.cases) * K * m, z.shape[1]))
        for k, (case, joints) in enumerate(zip(self.cases, self._joints, strict=True)):
            parts, moved = self.kernels.place(z[:, case.columns], case.numbers)
            s = weights.shape[2] - parts[0].shape[1]
            w = weights[:, k, :s]
            by_free = (weights[:, k, None, s:] @ moved[0])[:, 0]
            terms = np.zeros((len(z), s))
            for i, (arm, rows) in enumerate(zip(self.arms, joints, strict=True)):
                goal, coupling, n = parts[1 + 2 * i], parts[2 + 2 * i], rows.stop - rows.start
                y = arm.placed(np.hstack([z[:, rows], w]), np.hstack([goal, arm.tie(coupling)]))
                edges = np.cumsum([s, m * n, 7 * m, n, coupling.shape[1]])
                own, by_q, by_goal, along, by_tie, _ = np.split(y, edges, axis=1)
                terms += own
                slope[:, rows] = along
                by_free += (by_tie[:, None] @ moved[2 + 2 * i])[:, 0]
                first = (k * K + i) * m
                J[:, first : first + m, rows] = by_q.reshape(-1, m, n)
                J[:, first : first + m, case.columns] = by_goal.reshape(-1, m, 7) @ moved[1 + 2 * i]
            slope[:, case.columns] += by_free
            every.append(np.hstack([terms, parts[0]]))
        return np.stack(every, axis=1), J, slope

    @np.errstate(over="ignore", invalid="ignore")
    def direction(self, point: Iterates, tangents: list[Tangent]) -> list[Array]:
        """A Newton step in the tangent spaces that ascends, (count, 1, v)."""
        basis, slope = tangents[0].basis, tangents[0].slope
        gradient = (basis @ slope[:, :, None])[:, :, 0]
        step = ascent(self.hessian(point, tangents[0]), gradient, self.options.flattest)
        return [step[:, None] @ basis]

    def hessian(self, point: Iterates, tangent: Tangent) -> Array:
        """Second derivatives along the basis of what a step is worth once arms are closed again,
        (count, d, d): by differences, of the sums at their slopes and of the score in the sums.
        """
        h, forces = self.options.difference, self._forces(tangent)
        sums, weights = point.known
        count, d, v = tangent.basis.shape
        displaced = point.q[0] + h * tangent.basis
        there, J, slope = self._local(displaced.reshape(-1, v), np.repeat(weights, d, axis=0))
        bend = slope.reshape(count, d, v) - tangent.slope[:, None]
        bend -= (forces[:, None, None] @ (J.reshape(count, d, -1, v) - tangent.J[:, None]))[:, :, 0]
        H = bend @ tangent.basis.transpose(0, 2, 1) / h
        change = there.reshape(count, d, *sums.shape[1:]) - sums[:, None]
        for k, case in enumerate(self.cases):
            shifted = sums[:, None, k] + change[:, :, k]
            both = case.weight * self.kernels.score(shifted.reshape(count * d, -1), case.given)
            bent = both[:, 1:].reshape(count, d, -1) - weights[:, None, k]
            H += bent @ change[:, :, k].transpose(0, 2, 1) / h**2
        return H

    def _forces(self, tangent: Tangent) -> Array:
        """Multipliers of every arm's closure by its own joints alone, (count, C·K·m).

        After a step the arms are closed where what is free is, each by the shortest motion of its
        joints: with these multipliers the Lagrangian is to second order what the step is worth.
        """
        m, parts = self.arms[0].kernels.m, []
        for k, rows in enumerate(rows for joints in self._joints for rows in joints):
            J = tangent.J[:, k * m : (k + 1) * m, rows]
            parts.append(Tangent.of(J, tangent.slope[:, rows], tangent.held[:, rows]).forces)
        return np.hstack(parts)

    def closed(self, j: int, q: Array, lower: Array, upper: Array) -> tuple[Array, Mask]:
        """Postures closed arm by arm where what is free is; where that fails, all at once."""
        ends = q.copy()
        z = ends[:, 0]
        lower, upper = (np.broadcast_to(limit, q.shape)[:, 0] for limit in (lower, upper))
        closes, stuck = np.ones(len(z), dtype=bool), np.zeros(len(z), dtype=bool)
        for case, joints in zip(self.cases, self._joints, strict=True):
            parts, _ = self.kernels.place(z[:, case.columns], case.numbers)
            for arm, rows, goals in zip(self.arms, joints, parts[1::2], strict=True):
                z[:, rows], gaps = project(
                    arm.kernels, z[:, rows], goals, lower[:, rows], upper[:, rows], steps=12,
                    closed=self.options.closed,
                )  # fmt: skip
                closes &= gaps < CLOSED
        # An arm that limits stop in several joints closes only where what is free moves with it.
        stopped = lower == upper
        for arm, rows in zip(list(self.arms) * len(self.cases), chain(*self._joints), strict=True):
            stuck |= stopped[:, rows].sum(axis=1) > arm.kernels.n - arm.kernels.m
        open_ = np.flatnonzero(stuck & ~closes)
        if len(open_):
            z[open_], closes[open_] = self._closed_together(q[open_, 0], lower[open_], upper[open_])
        return ends, closes

    def _closed_together(self, z: Array, lower: Array, upper: Array) -> tuple[Array, Mask]:
        """Projection of all variables onto all closures by Gauss–Newton steps within bounds."""
        nothing = np.zeros((len(z), len(self.cases), self.kernels.sums))
        for _ in range(self.options.closing):
            residual = self._residual(z)
            closes = np.abs(residual).max(axis=1) < self.options.closed
            if closes.all():
                break
            J, free = self._local(z, nothing)[1], lower < upper
            for _ in range(2):
                step = -_shortest(J * free[:, None], residual, self.options.damping)
                free &= ~((z <= lower) & (step < 0) | (z >= upper) & (step > 0))
            z = np.clip(z + np.where(free, step, 0.0), lower, upper)
        return z, np.abs(self._residual(z)).max(axis=1) < CLOSED

    def _residual(self, z: Array) -> Array:
        """Residuals of all closures, (count, C·K·m)."""
        every = []
        for case, joints in zip(self.cases, self._joints, strict=True):
            parts, _ = self.kernels.place(z[:, case.columns], case.numbers)
            every += [
                arm.kernels.residual(z[:, rows], goals)[0]
                for arm, rows, goals in zip(self.arms, joints, parts[1::2], strict=True)
            ]
        return np.hstack(every)


def _shortest(J: Array, residual: Array, damping: float) -> Array:
    """The shortest steps that J takes to residuals, Jᵀ(J Jᵀ + λ I)⁻¹ r, (count, v)."""
    normal = J @ J.swapaxes(1, 2)
    scale = damping * np.trace(normal, axis1=1, axis2=2)
    normal += scale[:, None, None] * np.eye(J.shape[1])
    return np.asarray((np.linalg.solve(normal, residual[:, :, None]).swapaxes(1, 2) @ J)[:, 0])
