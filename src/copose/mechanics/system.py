"""All arms of a cell and the object they hold, as CasADi expressions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.errors import InputError
from copose.mechanics.chain import Chain, constant, multiply_quaternions
from copose.mechanics.dynamics import gravity_torques, mass_matrix
from copose.mechanics.held_object import HeldObject
from copose.poses import Array
from copose.problem import Space
from copose.robots import Arm, finite_range


@dataclass(frozen=True, eq=False)
class ArmMechanics:
    """Expressions of one arm's joint positions, world axes.

    Attributes:
        arm: the numbers.
        q: joint positions, (n,).
        chain: frames in the root frame.
        position: tip origin in the world.
        rotation: R_world_tip.
        quaternion: the same, multiplied along the chain.
        J: task rows of the geometric Jacobian of the tip's origin, (m, n).
        M: joint inertia, (n, n).
    """

    arm: Arm
    q: ca.SX
    chain: Chain
    position: ca.SX
    rotation: ca.SX
    quaternion: ca.SX
    J: ca.SX
    M: ca.SX

    @classmethod
    def of(cls, arm: Arm, space: Space) -> ArmMechanics:
        """The expressions of an arm."""
        q = ca.SX.sym(f"q_{arm.name}", arm.n)
        chain = Chain.of(arm, q)
        R_world_root = constant(arm.base.rotation)
        J = ca.diagcat(R_world_root, R_world_root) @ chain.jacobian()
        return cls(
            arm=arm,
            q=q,
            chain=chain,
            position=_in_world(arm, chain.tip.position),
            rotation=R_world_root @ chain.tip.rotation,
            quaternion=multiply_quaternions(
                ca.SX(ca.DM(arm.base.quaternion)), chain.tip.quaternion
            ),
            J=J[list(space.rows), :],
            M=mass_matrix(chain),
        )

    def gravity_torques(self, gravity: Array | ca.SX) -> ca.SX:
        """Torques that hold the arm, (n,); gravity in world axes, m/s²."""
        return gravity_torques(self.chain, constant(self.arm.base.rotation.T) @ gravity)

    def velocity_torques(self, speed: ca.SX) -> ca.SX:
        """Coriolis and centrifugal torques Ṁq̇ − ½ ∂(q̇ᵀMq̇)/∂q at joint speeds q̇, (n,)."""
        # A symbol of its own: speeds that depend on q must not be differentiated with it.
        rate = ca.SX.sym("rate", self.arm.n)
        momentum = self.M @ rate
        energy = ca.dot(rate, momentum) / 2
        torques = ca.jtimes(momentum, self.q, rate) - ca.gradient(energy, self.q)
        return ca.substitute(torques, rate, speed)

    def velocity_acceleration(self, speed: ca.SX) -> ca.SX:
        """J̇q̇, the tip's acceleration at joint speeds q̇ without joint accelerations, (m,)."""
        rate = ca.SX.sym("rate", self.arm.n)
        return ca.substitute(ca.jtimes(self.J @ rate, self.q, rate), rate, speed)

    @property
    def skeleton(self) -> ca.SX:
        """Points to draw the arm by: root, joint origins, tip; (3, n + 2), world."""
        points = [ca.SX(3, 1), *(f.position for f in self.chain.frames), self.chain.tip.position]
        return ca.horzcat(*(_in_world(self.arm, point) for point in points))


def _in_world(arm: Arm, point: ca.SX) -> ca.SX:
    return constant(arm.base.position) + constant(arm.base.rotation) @ point


@dataclass(frozen=True, eq=False)
class System:
    """K arms and one object.

    Attributes:
        space: the task space.
        arms: one arm's expressions each, in file order.
        object: the object's.
    """

    space: Space
    arms: tuple[ArmMechanics, ...]
    object: HeldObject

    @classmethod
    def of(
        cls, space: Space, arms: Sequence[Arm], load_distribution: str = "moore-penrose"
    ) -> System:
        """The system of these arms in a task space, see `HeldObject.held_at`.

        Raises:
            InputError: an arm's mass matrix is not positive definite; the joint is named.
        """
        expressions = tuple(ArmMechanics.of(arm, space) for arm in arms)
        for i, expression in enumerate(expressions):
            _check_mass_matrix(expression, f"arms[{i}]")
        grasps = [arm.grasp for arm in arms]
        return cls(space, expressions, HeldObject.held_at(space, grasps, load_distribution))

    @property
    def q(self) -> ca.SX:
        """Joint positions of all arms, stacked, (N,)."""
        return ca.vertcat(*(arm.q for arm in self.arms))

    def split(self, q: Array) -> list[Array]:
        """Stacked joint positions, arm by arm."""
        return np.split(q, np.cumsum([arm.arm.n for arm in self.arms])[:-1])

    def pose_error(self, i: int) -> tuple[ca.SX, ca.SX]:
        """p_tip − p_goal, m, (3,), and the quaternion q_goal⁻¹ ⊗ q_tip, (4,), of arm i."""
        arm, held = self.arms[i], self.object
        grasp = arm.arm.grasp
        goal = held.position + held.rotation @ constant(grasp.position)
        turn = multiply_quaternions(held.quaternion, ca.SX(ca.DM(grasp.quaternion)))
        back = ca.vertcat(turn[0], -turn[1:])
        return arm.position - goal, multiply_quaternions(back, arm.quaternion)

    def closure(self, i: int) -> ca.SX:
        """How far arm i is from its grasp; zero at the goal and nowhere else.

        Position error, m, over twice the vector part of the quaternion error where contacts are
        rigid: 2 sin(θ/2)·axis, rad near the goal, and 2, not 0, for a hand flipped by 180°. Task
        rows only, (m,).
        """
        position, quaternion = self.pose_error(i)
        return ca.vertcat(position, 2 * quaternion[1:])[list(self.space.rows)]


def _check_mass_matrix(mechanics: ArmMechanics, key: str) -> None:
    arm = mechanics.arm
    mass_at = ca.Function("M", [mechanics.q], [mechanics.M])
    rng = np.random.default_rng(0)
    low, high = finite_range(arm.lower, arm.upper)
    for _ in range(8):
        M = np.array(mass_at(rng.uniform(low, high)))
        if not np.all(np.isfinite(M)):
            raise InputError("has masses or inertias that are not finite", key=key)
        values, vectors = np.linalg.eigh(M)
        if values[0] <= 1e-12 * abs(values[-1]):
            worst = arm.joints[int(np.argmax(np.abs(vectors[:, 0])))]
            why = "its link has no inertials" if worst.body.mass == 0 else "see its inertials"
            raise InputError(
                f"the mass matrix is not positive definite to working precision (eigenvalues "
                f"{values[0]:.1e} … {values[-1]:.1e}): joint {worst.name!r} moves next to no "
                f"inertia; {why}, or give armature",
                key=key,
            )
