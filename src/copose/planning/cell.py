"""A problem made ready to compute with: numbers, expressions, limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
    """

    problem: Problem
    arms: tuple[Arm, ...]
    system: System
    parameters: Array
    lower: tuple[Array, ...]
    upper: tuple[Array, ...]

    @classmethod
    def of(cls, problem: Problem) -> Cell:
        """Read the robots of a problem and write down its mechanics.

        Raises:
            InputError: a robot cannot be used.
        """
        arms = load_arms(problem)
        try:
            system = System.of(problem.space, arms)
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
        )

    def wrapped(self, i: int, q: Array) -> Array:
        """Positions of arm i, (..., n), with unlimited revolute joints in (−π, π]."""
        turns = np.array([joint.kind == "revolute" for joint in self.arms[i].joints])
        turns &= np.isinf(self.arms[i].lower) & np.isinf(self.arms[i].upper)
        return np.where(turns, np.pi - np.mod(np.pi - q, 2 * np.pi), q)
