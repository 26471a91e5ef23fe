"""Kernels of an arm: steps that close it, its closure, its share of sums over arms, and slopes.

They are written in the arm's root frame. Where its root stands, where the object is and which share
of it the arm carries are numbers, so arms of one model have the same kernels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.capability import Sums, upper_triangle
from copose.kernels import Kernel
from copose.mechanics import ArmMechanics, Coupling, Goal, System
from copose.poses import Array


@dataclass(frozen=True)
class ClosingOptions:
    """Damped Gauss–Newton steps that close an arm."""

    steps: int = 3  # in one call: enough to close after a Newton step along a self-motion
    corrections: int = 2  # in one call, in the plane across a curve
    longest: float = 0.7  # change of a joint in a step, rad or m
    damping: float = 1e-3  # times the squared residual, up to 1, of the mean diagonal of J Jᵀ
    least_damping: float = 1e-13  # of it, where the chain is closed


@dataclass(frozen=True, eq=False)
class ArmKernels:
    """Kernels of joint positions q, (n,), in the order of rows of a batch."""

    m: int
    n: int
    steps: int  # of one call of `closing`
    # Of (q, lower, upper) and a goal: q after these steps, and the norm of the residual there, (n +
    # 1,).
    closing: Kernel
    # With one degree of freedom to spare, of (q, unit tangent) and a goal: q after Newton steps in
    # the plane across the tangent, the tangent t there, its cosine with that given, the norm of the
    # residual, and det [J; tᵀ], J the derivative of the closure, (2n + 3,).
    correcting: Kernel | None
    # Alike, of q and a goal: a unit tangent, the norm of the residual, det [J; tᵀ] and the norm of
    # J, (n + 3,).
    tangent: Kernel | None
    closure: Kernel  # of q and a goal: residual, (m,), and its derivative row by row, (m·n,)
    gap: Kernel  # of q and a goal: position error, (3,), and quaternion of the angle error, (4,)
    terms: Kernel  # of q and a tie: what the arm adds to the sums, (s,)
    # Of (q, weights), a goal and a tie: the terms, the derivative of the closure row by row, and
    # ∇_q of weightsᵀ terms, (s + m·n + n,).
    local: Kernel
    # With one degree of freedom to spare, of (q, weights, mask of held joints), a goal and a tie:
    # see `ChainTangent`.
    line: Kernel | None

    @classmethod
    def of(
        cls, arm: ArmMechanics, sums: Sums, options: ClosingOptions = ClosingOptions()
    ) -> ArmKernels:
        """The kernels of an arm, for what is summed over the arms."""
        q, m, n = arm.q, arm.space.m, arm.arm.n
        goal = Goal(ca.SX.sym("position", 3), ca.SX.sym("quaternion", 4))
        place = ca.vertcat(goal.position, goal.quaternion)
        # Sines are most of what a closure costs.
        residual = arm.halved.closure(goal)
        J = ca.jacobian(residual, q)
        lower, upper = ca.SX.sym("lower", n), ca.SX.sym("upper", n)
        tied, terms = _terms(arm, sums)
        weights = ca.SX.sym("weights", terms.numel())
        slope = ca.gradient(ca.dot(weights, terms), q)
        limits, held = ca.vertcat(lower, upper), ca.SX.sym("held", n)
        curved = n == m + 1
        look = ca.Function("residual", [q, place], [residual, J])
        end = q
        for _ in range(options.steps):
            residual_there, J_there = look(end, place)
            end = _closing_step(end, lower, upper, residual_there, J_there, options)
        closed = ca.vertcat(end, ca.norm_2(look(end, place)[0]))
        return cls(
            m=m,
            n=n,
            steps=options.steps,
            closing=Kernel(ca.vertcat(q, limits), place, closed),
            correcting=_correcting(q, place, look, options) if curved else None,
            tangent=_curve_kernel(q, place, look) if curved else None,
            closure=Kernel(q, place, ca.vertcat(residual, ca.vec(J.T))),
            gap=Kernel(q, place, ca.vertcat(*arm.pose_error(goal))),
            terms=Kernel(q, tied, terms),
            local=Kernel(
                ca.vertcat(q, weights),
                ca.vertcat(place, tied),
                ca.vertcat(terms, ca.vec(J.T), slope),
            ),
            line=Kernel(
                ca.vertcat(q, weights, held),
                ca.vertcat(place, tied),
                _along_line(q, held, residual, terms, weights),
            )
            if curved
            else None,
        )

    @property
    def all(self) -> tuple[Kernel, ...]:
        """Every kernel, the most used first."""
        kernels = (
            self.closing, self.correcting, self.tangent, self.closure, self.terms, self.line,
            self.local, self.gap,
        )  # fmt: skip
        return tuple(kernel for kernel in kernels if kernel is not None)

    def residual(self, q: Array, goal: Array) -> tuple[Array, Array]:
        """Closure at q, (count, n): residuals, (count, m), and derivatives, (count, m, n)."""
        values = self.closure(q, goal)
        return values[:, : self.m], values[:, self.m :].reshape(-1, self.m, self.n)


def terms_kernel(arm: ArmMechanics, sums: Sums) -> Kernel:
    """The kernel of an arm's share of sums over arms, (s,), of q and a tie."""
    tied, terms = _terms(arm, sums)
    return Kernel(arm.q, tied, terms)


def placed_kernel(arm: ArmMechanics, sums: Sums) -> Kernel:
    """The kernel of an arm whose goal and tie move too.

    Of (q, weights), a goal and a tie: the terms, the derivative of the closure by q and by the
    goal, row by row, and the gradients of weightsᵀ terms by q and by the tie,
    (s + m·n + 7m + n + t,).
    """
    goal = Goal(ca.SX.sym("position", 3), ca.SX.sym("quaternion", 4))
    place = ca.vertcat(goal.position, goal.quaternion)
    residual = arm.closure(goal)
    tied, terms = _terms(arm, sums)
    weights = ca.SX.sym("weights", terms.numel())
    total = ca.dot(weights, terms)
    by_q, by_goal = ca.jacobian(residual, arm.q), ca.jacobian(residual, place)
    return Kernel(
        ca.vertcat(arm.q, weights),
        ca.vertcat(place, tied),
        ca.vertcat(
            terms, ca.vec(by_q.T), ca.vec(by_goal.T), ca.gradient(total, arm.q),
            ca.gradient(total, tied),
        ),
    )  # fmt: skip


def _terms(arm: ArmMechanics, sums: Sums) -> tuple[ca.SX, ca.SX]:
    """The tie of an arm, its coupling and torque scale, and its terms of the sums."""
    coupling = Coupling.symbols(arm.space)
    scale = ca.SX.sym("scale", arm.arm.n)
    terms = ca.vertcat(*sums.arm_terms(arm, coupling, scale))
    return ca.vertcat(coupling.stacked(sums.uses), scale), terms


def _closing_step(
    q: ca.SX, lower: ca.SX, upper: ca.SX, residual: ca.SX, J: ca.SX, options: ClosingOptions
) -> ca.SX:
    """A damped Gauss–Newton step within limits.

    Where it would push a joint through its limit, the others take it without that joint.
    """
    step = _damped_step(residual, J, options)
    blocked = ca.logic_or(ca.logic_and(q <= lower, step < 0), ca.logic_and(q >= upper, step > 0))
    open_ = 1 - blocked
    step = _damped_step(residual, J * ca.repmat(open_.T, J.shape[0], 1), options) * open_
    step *= ca.fmin(1, options.longest / ca.fmax(ca.mmax(ca.fabs(step)), 1e-300))
    return ca.fmin(ca.fmax(q + step, lower), upper)


def _correcting(q: ca.SX, place: ca.SX, look: ca.Function, options: ClosingOptions) -> Kernel:
    """The corrector of a curve of closed postures, see `ArmKernels.correcting`."""
    tangent = ca.SX.sym("tangent", q.numel())
    end = q
    for _ in range(options.corrections):
        residual, J = look(end, place)
        end = end + _damped_step(residual, J - (J @ tangent) @ tangent.T, options)
    residual, J = look(end, place)
    ahead, det = _tangent(J)
    way = ca.if_else(ca.dot(ahead, tangent) < 0, -1.0, 1.0)
    cosine = way * ca.dot(ahead, tangent)
    values = ca.vertcat(end, way * ahead, cosine, ca.norm_2(residual), way * det)
    return Kernel(ca.vertcat(q, tangent), place, values)


def _curve_kernel(q: ca.SX, place: ca.SX, look: ca.Function) -> Kernel:
    """See `ArmKernels.tangent`."""
    residual, J = look(q, place)
    t, det = _tangent(J)
    return Kernel(q, place, ca.vertcat(t, ca.norm_2(residual), det, ca.norm_fro(J)))


def _tangent(J: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The unit vector t with J t = 0 of one column more than rows, and det [J; tᵀ]."""
    (m, n), (R, reflections) = J.shape, _triangle(J.T)
    t = ca.SX.eye(n)[:, -1]
    for v in reversed(reflections):
        t -= v * ca.dot(v, t)
    det = ca.SX((-1) ** m)
    for k in range(m):
        det *= R[k, k]
    return t, det


def _triangle(R: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
    """The triangle that Householder reflections x − v vᵀx make of columns, and their v."""
    reflections = list[ca.SX]()
    for k in range(R.shape[1]):
        size, first = ca.norm_2(R[k:, k]), R[k, k]
        v = ca.vertcat(ca.SX(k, 1), first + ca.if_else(first < 0, -size, size), R[k + 1 :, k])
        v *= ca.sqrt(2 / ca.fmax(ca.sumsqr(v), 1e-300))
        R = R - v @ (v.T @ R)
        reflections.append(v)
    return R, reflections


def _along_line(q: ca.SX, held: ca.SX, residual: ca.SX, terms: ca.SX, weights: ca.SX) -> ca.SX:
    """All that a Newton step along a self-motion takes, see `ArmKernels.line`.

    Tangent and multipliers are by Householder reflections of Jᵀ without held joints, the rest by
    derivatives along the tangent.
    """
    m, n = residual.numel(), q.numel()
    J, slope = ca.jacobian(residual, q), ca.gradient(ca.dot(weights, terms), q)
    moving = J * ca.repmat(1 - held.T, m, 1)
    (t, _), (R, reflections), along = _tangent(moving), _triangle(moving.T), slope
    for v in reflections:
        along = along - v * ca.dot(v, along)
    R, size = ca.triu(R[:m, :]), ca.fabs(ca.diag(R[:m, :]))
    t, multipliers = t * (1 - ca.mmax(held)), ca.solve(R, along[:m])
    # Second derivatives along t alone, of the Lagrangian with these multipliers.
    ahead, forces = ca.SX.sym("ahead", n), ca.SX.sym("forces", m)
    change, turn = ca.jtimes(terms, q, ahead), ca.jtimes(residual, q, ahead)
    bend = ca.dot(weights, ca.jtimes(change, q, ahead)) - ca.dot(forces, ca.jtimes(turn, q, ahead))
    there = ca.substitute(
        ca.vertcat(change, bend), ca.vertcat(ahead, forces), ca.vertcat(t, multipliers)
    )
    left = slope - J.T @ multipliers
    return ca.vertcat(
        t, multipliers, left, slope, there, ca.mmin(size) / ca.mmax(size), ca.vec(J.T)
    )


def _damped_step(residual: ca.SX, J: ca.SX, options: ClosingOptions) -> ca.SX:
    """A Gauss–Newton step; its damping falls with the residual: convergence stays quadratic."""
    damping = options.damping * ca.fmin(ca.dot(residual, residual), 1) + options.least_damping
    return _least_norm_step(residual, J, damping)


def _least_norm_step(residual: ca.SX, J: ca.SX, damping: ca.SX | float) -> ca.SX:
    """The step −Jᵀ(J Jᵀ + λI)⁻¹ r, λ so much of the mean diagonal of J Jᵀ."""
    m = residual.shape[0]
    normal = J @ J.T
    normal += (damping * ca.trace(normal) / m + 1e-100) * ca.SX.eye(m)
    D, LT, order = ca.ldl(normal, False)
    return -J.T @ ca.ldl_solve(residual, D, LT, order)


@dataclass(frozen=True, eq=False)
class KernelInputs:
    """Parameters of the kernels for one placement of the object."""

    goals: tuple[Array, ...]  # by arm, tip position and quaternion in its root frame, (7,)
    # By arm, the parts of its coupling that enter the sums, and its torque scale.
    ties: tuple[Array, ...]
    inertia: Array  # upper triangle of M_o


class KernelInputsBuilder:
    """The kernel that turns the object's parameters into those of the arms' kernels."""

    def __init__(self, system: System, sums: Sums, scales: Sequence[Array]) -> None:
        """Build the kernel.

        Args:
            system: arms and object.
            sums: what is summed over the arms.
            scales: torque scale of each arm's joints, (n_i,).
        """
        parts = [upper_triangle(system.object.M_o)]
        for i in range(len(system.arms)):
            goal, coupling = system.goal(i), system.coupling(i)
            parts += [ca.vertcat(goal.position, goal.quaternion), coupling.stacked(sums.uses)]
        self._scales = scales
        self._edges = np.cumsum([part.numel() for part in parts])[:-1]
        self.kernel = Kernel(system.parameters, ca.SX(0, 1), ca.vertcat(*parts))

    def __call__(self, parameters: Array) -> KernelInputs:
        """The kernels' parameters for parameters of the object, see `System.parameters`."""
        inertia, *parts = np.split(self.kernel(parameters[None], np.zeros(0))[0], self._edges)
        ties = zip(parts[1::2], self._scales, strict=True)
        return KernelInputs(
            goals=tuple(parts[::2]),
            ties=tuple(np.concatenate(tie) for tie in ties),
            inertia=inertia,
        )
