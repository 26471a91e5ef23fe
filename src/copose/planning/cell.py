"""A problem made ready to compute with: numbers, expressions, limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.capability import RESOLUTIONS, Resolution
from copose.errors import InputError
from copose.mechanics import System, object_parameters
from copose.poses import Array
from copose.problem import Problem
from copose.robots import Arm, load_arms


@dataclass(frozen=True, eq=False)
class Cell:
    """A problem with its robots read and its mechanics written down.

    Attributes:
        problem: as asked.
        arms: as plain numbers, in file order.
        system: as expressions.
        parameters: the object's numbers.
        lower: by arm, lowest joint positions, margin kept.
        upper: alike.
        resolution: whose ellipsoid is asked for.
        scales: by arm, the torques T that the ball is measured in.
    """

    problem: Problem
    arms: tuple[Arm, ...]
    system: System
    parameters: Array
    lower: tuple[Array, ...]
    upper: tuple[Array, ...]
    resolution: Resolution
    scales: tuple[Array, ...]

    @classmethod
    def of(cls, problem: Problem) -> Cell:
        """Read the robots of a problem and write down its mechanics.

        Raises:
            InputError: a robot cannot be used.
        """
        arms = load_arms(problem)
        try:
            system = System.of(problem.space, arms, problem.ellipsoid.load_distribution)
            scales = _torque_scales(problem, arms)
        except InputError as error:
            raise InputError(error.message, key=error.key, file=problem.source) from None
        thing, margin = problem.object, problem.constraints.joint_margin
        inertia = thing.inertia if thing.inertia is not None else 0.0
        return cls(
            problem=problem,
            arms=arms,
            system=system,
            parameters=object_parameters(thing.pose, thing.mass, inertia),
            lower=tuple(arm.lower + margin for arm in arms),
            upper=tuple(arm.upper - margin for arm in arms),
            resolution=RESOLUTIONS[problem.ellipsoid.resolution],
            scales=scales,
        )

    @property
    def gravity(self) -> Array:
        """Acceleration of free fall that the ellipsoid's centre counts, world axes, (3,)."""
        if not self.problem.ellipsoid.gravity:
            return np.zeros(3)
        return np.array([*self.problem.world.gravity, 0.0])[:3]

    @property
    def velocity(self) -> Array:
        """Velocity of the object, (m,)."""
        given = self.problem.object.velocity
        return np.zeros(self.problem.space.m) if given is None else np.array(given)

    @property
    def gram(self) -> ca.SX:
        """G of the ellipsoid that is asked for, its slice by ``axes``, (a, a)."""
        axes = list(self.problem.axes)
        return self.resolution.system_gram(self.system, self.scales)[axes, axes]

    def wrapped(self, i: int, q: Array) -> Array:
        """Positions of arm i, (..., n), with unlimited revolute joints in (−π, π]."""
        unlimited = np.isinf(self.arms[i].lower) & np.isinf(self.arms[i].upper)
        return np.where(unlimited, self.nearest_turn(i, q), q)

    def unlimited(self, i: int) -> tuple[str, ...]:
        """Names of the revolute joints of arm i that have no limits."""
        return tuple(
            joint.name
            for joint in self.arms[i].joints
            if joint.kind == "revolute" and joint.lower == -np.inf and joint.upper == np.inf
        )

    def nearest_turn(self, i: int, q: Array) -> Array:
        """Positions or differences of arm i, (..., n), with every revolute joint in (−π, π]."""
        revolute = np.array([joint.kind == "revolute" for joint in self.arms[i].joints])
        return np.where(revolute, np.pi - np.mod(np.pi - q, 2 * np.pi), q)


def _torque_scales(problem: Problem, arms: Sequence[Arm]) -> tuple[Array, ...]:
    """T by arm: ones, or the torque limits."""
    if problem.ellipsoid.torque_scaling == "unit":
        return tuple(np.ones(arm.n) for arm in arms)
    for i, arm in enumerate(arms):
        for joint in arm.joints:
            if not 0 < joint.effort < np.inf:
                has = "is 0" if joint.effort == 0 else "has none"
                raise InputError(
                    "torque_scaling = 'limits' needs a torque limit on every joint; "
                    f"{joint.name!r} {has}",
                    key=f"arms[{i}].torque_limits",
                )
    return tuple(np.array([joint.effort for joint in arm.joints]) for arm in arms)
