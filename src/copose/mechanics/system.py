"""All arms of a cell and the object they hold, as CasADi expressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import TypeVar

import casadi as ca
import numpy as np

from copose.mechanics.chain import Chain, Frame, constant, multiply_quaternions
from copose.mechanics.dynamics import gravity_torques, inverse_dynamics, mass_matrix
from copose.mechanics.held_object import HeldObject
from copose.poses import Array
from copose.problem import Space
from copose.robots import Arm, finite_range

Built = TypeVar("Built")


@dataclass(frozen=True, eq=False)
class Goal:
    """The target pose of a tip in the arm's root frame."""

    position: ca.SX  # m, (3,)
    quaternion: ca.SX  # unit, [w, x, y, z]


@dataclass(frozen=True, eq=False)
class Coupling:
    """The coupling of an arm to the object and to gravity, in the arm's root axes.

    Attributes:
        motion: X_i with a_i = X_i a_o, the acceleration of the contact, (m, m): W_iᵀ turned.
        share: the contact's part of a wrench on the object by W⁺, (m, m): (W⁺)_i turned.
        load: Y_i with h_i = Y_i a_o, its part of the object's inertial wrench, (m, m): (W⁺)_i M_o
            turned.
        balance: P_i, the effect of a wrench at the contact on the object, world axes, (b, m): see
            `HeldObject.balance`.
        fall: acceleration of free fall, m/s², (3,).
    """

    motion: ca.SX
    share: ca.SX
    load: ca.SX
    balance: ca.SX
    fall: ca.SX

    @classmethod
    def symbols(cls, space: Space) -> Coupling:
        """A coupling with a symbol for every entry."""
        m, b = space.m, len(space.balance)
        shapes = {
            "motion": (m, m), "share": (m, m), "load": (m, m), "balance": (b, m), "fall": (3, 1),
        }  # fmt: skip
        return cls(**{name: ca.SX.sym(name, *shape) for name, shape in shapes.items()})

    def stacked(self, names: Sequence[str]) -> ca.SX:
        """The entries of the named parts as one vector, column by column."""
        stack: ca.SX = ca.vertcat(*(ca.vec(ca.densify(getattr(self, name))) for name in names))
        return stack


@dataclass(frozen=True, eq=False)
class ArmMechanics:
    """Kinematics and dynamics of one arm as expressions of its joint positions.

    They are in its root frame, so that arms of one model share them wherever they stand.
    """

    arm: Arm  # the numbers
    space: Space  # the task space
    base: Frame  # its root frame in the world
    q: ca.SX  # joint positions, (n,)
    chain: Chain  # frames in the root frame
    J_root: ca.SX  # task rows of the geometric Jacobian of the tip's origin, root axes, (m, n)
    M: ca.SX  # joint inertia, (n, n)

    @classmethod
    def of(cls, arm: Arm, space: Space, base: Frame | None = None) -> ArmMechanics:
        """The expressions of an arm, on its own base or another."""
        base = Frame.at(arm.base) if base is None else base
        q = ca.SX.sym(f"q_{arm.name}", arm.n)
        chain = Chain.of(arm, q)
        J_root = chain.jacobian()[list(space.rows), :]
        return cls(arm, space, base, q, chain, J_root, mass_matrix(chain))

    @property
    def halved(self) -> ArmMechanics:
        """The arm by sines of half its angles alone: quicker to evaluate, longer to differentiate
        twice.
        """
        return replace(self, chain=Chain.of(self.arm, self.q, halved=True))

    @property
    def R_world_root(self) -> ca.SX:
        """The rotation of task vectors from root axes to world axes, (m, m)."""
        R, rows = self.base.rotation, list(self.space.rows)
        return ca.diagcat(R, R)[rows, rows]

    @property
    def J(self) -> ca.SX:
        """Task rows of the geometric Jacobian of the tip's origin, world axes, (m, n)."""
        return self.R_world_root @ self.J_root

    @property
    def tip(self) -> Frame:
        """Tip frame in the world."""
        base, tip = self.base, self.chain.tip
        return Frame(
            self._in_world(tip.position),
            base.rotation @ tip.rotation,
            multiply_quaternions(base.quaternion, tip.quaternion),
        )

    def _in_world(self, point: ca.SX) -> ca.SX:
        """A point of the root frame in the world, m, (3,)."""
        return self.base.position + self.base.rotation @ point

    def pose_error(self, goal: Goal) -> tuple[ca.SX, ca.SX]:
        """The errors p_tip − p_goal, root axes, m, (3,), and q_goal⁻¹ ⊗ q_tip, quaternion, (4,)."""
        back = ca.vertcat(goal.quaternion[0], -goal.quaternion[1:])
        tip = self.chain.tip
        return tip.position - goal.position, multiply_quaternions(back, tip.quaternion)

    def closure(self, goal: Goal) -> ca.SX:
        """The closure residual of a goal: zero where the tip is there, and nowhere else.

        Position error, m, over twice the vector part of the quaternion error where contacts are
        rigid: 2 sin(θ/2)·axis, rad near the goal, and 2, not 0, for a hand flipped by 180°. Task
        rows only, (m,).
        """
        position, quaternion = self.pose_error(goal)
        return ca.vertcat(position, 2 * quaternion[1:])[list(self.space.rows)]

    def gravity_torques(self, gravity: Array | ca.SX) -> ca.SX:
        """Torques that hold the arm against gravity, (n,); free fall in world axes, m/s²."""
        return self.weight_torques(self.base.rotation.T @ gravity)

    def weight_torques(self, fall: ca.SX) -> ca.SX:
        """Torques that hold the arm for a free fall in root axes, see `Coupling`, (n,)."""
        return gravity_torques(self.chain, fall)

    def driven(
        self, accelerations: ca.SX, fall: ca.SX, wrench: ca.SX, rates: ca.SX | None = None
    ) -> tuple[ca.SX, ca.SX]:
        """Torques M q̈ + C q̇ + g + Jᵀh, (n,), and J q̈ + J̇ q̇, (m,), see `inverse_dynamics`.

        Fall and the tip's wrench, (m,), in root axes; at rest without joint rates.
        """
        rows = list(self.space.rows)
        whole = ca.SX(6, 1)
        whole[rows] = wrench
        torques, reached = inverse_dynamics(self.chain, accelerations, fall, whole, rates)
        return torques, reached[rows]

    def velocity_torques(self, speed: ca.SX) -> ca.SX:
        """Coriolis and centrifugal torques Ṁq̇ − ½ ∂(q̇ᵀMq̇)/∂q at joint speeds q̇, (n,)."""
        # A symbol of its own: speeds that depend on q must not be differentiated with it.
        rate = ca.SX.sym("rate", self.arm.n)
        momentum = self.M @ rate
        energy = ca.dot(rate, momentum) / 2
        torques = ca.jtimes(momentum, self.q, rate) - ca.gradient(energy, self.q)
        return ca.substitute(torques, rate, speed)

    def velocity_acceleration(self, speed: ca.SX) -> ca.SX:
        """Acceleration J̇q̇ of the tip at joint speeds q̇ without joint accelerations, (m,)."""
        rate = ca.SX.sym("rate", self.arm.n)
        return ca.substitute(ca.jtimes(self.J @ rate, self.q, rate), rate, speed)

    def mass_fault(self) -> str:
        """The reason why M cannot be used, with the joint at fault; empty where it can."""
        arm = self.arm
        mass_at = ca.Function("M", [self.q], [self.M])
        rng = np.random.default_rng(0)
        low, high = finite_range(arm.lower, arm.upper)
        for _ in range(8):
            M = np.array(mass_at(rng.uniform(low, high)))
            if not np.all(np.isfinite(M)):
                return "has masses or inertias that are not finite"
            values, vectors = np.linalg.eigh(M)
            if values[0] <= 1e-12 * abs(values[-1]):
                worst = arm.joints[int(np.argmax(np.abs(vectors[:, 0])))]
                why = "its link has no inertials" if worst.body.mass == 0 else "see its inertials"
                return (
                    f"the mass matrix is not positive definite to working precision (eigenvalues "
                    f"{values[0]:.1e} … {values[-1]:.1e}): joint {worst.name!r} moves next to no "
                    f"inertia; {why}, or give armature"
                )
        return ""

    @property
    def placements(self) -> ca.SX:
        """Positions and quaternions in the world of root, joints and tip, (7, n + 2)."""
        base, columns = self.base, [ca.vertcat(self.base.position, self.base.quaternion)]
        for frame in (*self.chain.frames, self.chain.tip):
            turn = multiply_quaternions(base.quaternion, frame.quaternion)
            columns.append(ca.vertcat(self._in_world(frame.position), turn))
        return ca.horzcat(*columns)


@dataclass(frozen=True, eq=False)
class System:
    """K arms and one object."""

    space: Space  # the task space
    arms: tuple[ArmMechanics, ...]  # one arm's expressions each, in file order
    grasps: tuple[Frame, ...]  # tip frames in the object frame, alike
    object: HeldObject
    gravity: Array  # acceleration of free fall, world axes, m/s², (3,)
    # The object's, see `object_parameters`; then position and quaternion of the base of every arm
    # that may be moved, and of every grasp that may, see `Arm.free`.
    parameters: ca.SX

    @classmethod
    def of(
        cls,
        space: Space,
        arms: Sequence[Arm],
        load_distribution: str = "moore-penrose",
        gravity: Array | None = None,
    ) -> System:
        """The system of these arms in a task space, see `HeldObject.held_at`."""
        places: dict[str, list[ca.SX]] = {"base": [], "grasp": []}

        def frame(arm: Arm, what: str) -> Frame:
            if what not in arm.free:
                return Frame.at(getattr(arm, what))
            moved, numbers = Frame.free(f"{what}_{arm.name}")
            places[what].append(numbers)
            return moved

        expressions = tuple(ArmMechanics.of(arm, space, frame(arm, "base")) for arm in arms)
        grasps = tuple(frame(arm, "grasp") for arm in arms)
        held = HeldObject.held_at(space, grasps, load_distribution)
        fall = np.zeros(3) if gravity is None else gravity
        parameters = ca.vertcat(held.parameters, *places["base"], *places["grasp"])
        return cls(space, expressions, grasps, held, fall, parameters)

    def by_model(self, build: Callable[[ArmMechanics], Built]) -> tuple[Built, ...]:
        """A thing built of each arm, once for those that move alike; by arm."""
        built: dict[bytes, Built] = {}
        models = [mechanics.arm.fingerprint for mechanics in self.arms]
        for model, mechanics in zip(models, self.arms, strict=True):
            if model not in built:
                built[model] = build(mechanics)
        return tuple(built[model] for model in models)

    def numbers(self, thing: Array, arms: Sequence[Arm]) -> Array:
        """The values of `parameters` for an object, see `object_parameters`, and arms."""
        poses = [getattr(arm, what) for what in ("base", "grasp") for arm in arms
                 if what in arm.free]  # fmt: skip
        placed = [part for pose in poses for part in (pose.position, pose.quaternion)]
        return np.concatenate([thing, *placed])

    @property
    def q(self) -> ca.SX:
        """Joint positions of all arms, stacked, (N,)."""
        return ca.vertcat(*(arm.q for arm in self.arms))

    @cached_property
    def _edges(self) -> list[int]:
        """Places of the arms' first joints among all of them, and their number, (K + 1,)."""
        return [*accumulate((arm.arm.n for arm in self.arms), initial=0)]

    def split(self, q: Array) -> list[Array]:
        """Stacked joint positions, (N,) or (count, N), arm by arm."""
        # A tenth of the time that np.split takes.
        return [q[..., first:last] for first, last in pairwise(self._edges)]

    def goal(self, i: int) -> Goal:
        """The target pose of the tip of arm i: its grasp on the object."""
        base, grasp, held = self.arms[i].base, self.grasps[i], self.object
        position = held.position + held.rotation @ grasp.position
        quaternion = multiply_quaternions(held.quaternion, grasp.quaternion)
        return Goal(
            base.rotation.T @ (position - base.position),
            multiply_quaternions(base.inverse_quaternion, quaternion),
        )

    def coupling(self, i: int) -> Coupling:
        """The coupling of arm i to the object and to gravity."""
        arm, held = self.arms[i], self.object
        turn = arm.R_world_root.T
        return Coupling(
            motion=turn @ held.W[i].T,
            share=turn @ held.W_pinv[i],
            load=turn @ held.W_pinv[i] @ held.M_o,
            balance=held.balance[i] @ turn.T,
            fall=arm.base.rotation.T @ constant(self.gravity),
        )

    def pose_error(self, i: int) -> tuple[ca.SX, ca.SX]:
        """`ArmMechanics.pose_error` of arm i at its grasp."""
        return self.arms[i].pose_error(self.goal(i))

    def closure(self, i: int) -> ca.SX:
        """`ArmMechanics.closure` of arm i at its grasp."""
        return self.arms[i].closure(self.goal(i))
