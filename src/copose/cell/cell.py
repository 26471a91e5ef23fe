"""A problem made ready to compute with: numbers, expressions, limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from copose.capability import RESOLUTIONS, Resolution
from copose.errors import InputError, arm_key, blamed_on, nearest, together
from copose.mechanics import System, object_parameters
from copose.poses import Array, Mask
from copose.problem import Problem, case_problems, moved
from copose.robots import Arm, load_arms


@dataclass(frozen=True, eq=False)
class Cell:
    """A problem with its robots read and its mechanics written down.

    Attributes:
        problem: as asked.
        arms: as plain numbers, in file order.
        system: as expressions.
        parameters: numbers that `System.parameters` stand for.
        lower: by arm, lowest joint positions, margin kept.
        upper: alike.
        resolution: whose ellipsoid is asked for.
        scales: by arm, the torques T that the ball is measured in.
        weightless: by the name of an arm, why its inertia is not known; nothing that depends on
            it is told then.
    """

    problem: Problem
    arms: tuple[Arm, ...]
    system: System
    parameters: Array
    lower: tuple[Array, ...]
    upper: tuple[Array, ...]
    resolution: Resolution
    scales: tuple[Array, ...]
    weightless: Mapping[str, str]

    @classmethod
    def of(cls, problem: Problem, *, movable: bool = False) -> Cell:
        """Read the robots of a problem and write down its mechanics.

        Args:
            problem: as asked.
            movable: whether the poses of all bases and grasps are parameters.

        Raises:
            InputError: a robot cannot be used.
        """
        arms = load_arms(problem)
        if movable:
            arms = tuple(replace(arm, free=("base", "grasp")) for arm in arms)
        with blamed_on(problem.source):
            fall = np.array([*problem.world.gravity, 0.0])[:3]
            system = System.of(problem.space, arms, problem.ellipsoid.load_distribution, fall)
            scales = _torque_scales(problem, arms)
            _check_limits(problem, arms)
            weightless = _weightless(problem, system)
        margin = problem.constraints.joint_margin
        return cls(
            problem=problem,
            arms=arms,
            system=system,
            parameters=_parameters(system, problem, arms),
            lower=tuple(_kept(arm, arm.lower + margin) for arm in arms),
            upper=tuple(_kept(arm, arm.upper - margin) for arm in arms),
            resolution=RESOLUTIONS[problem.ellipsoid.resolution],
            scales=scales,
            weightless=weightless,
        )

    @property
    def gravity(self) -> Array:
        """Acceleration of free fall that the ellipsoid's centre counts, world axes, (3,)."""
        if not self.problem.ellipsoid.gravity:
            return np.zeros(3)
        return self.system.gravity

    @property
    def velocity(self) -> Array:
        """Velocity of the object, (m,)."""
        given = self.problem.object.velocity
        return np.zeros(self.problem.space.m) if given is None else np.array(given)

    @cached_property
    def torque_limits(self) -> tuple[Array, ...] | None:
        """The torque limits by arm, (n_i,); None where a joint has none, or an arm no inertia."""
        if self.weightless:
            return None
        try:
            return _torque_limits(self.arms, "")
        except InputError:
            return None

    @cached_property
    def efforts(self) -> tuple[Array, ...]:
        """Torque limits by arm, (n_i,); ∞ of a joint that has none."""
        return tuple(np.array([joint.effort for joint in arm.joints]) for arm in self.arms)

    @cached_property
    def counted_limits(self) -> tuple[Array, ...]:
        """Torque limits by arm, (n_i,), for programs of torques over their limits, which have to be
        bounded: a joint that has none counts with one that it never comes near.
        """
        every = np.concatenate(self.efforts)
        largest = every[np.isfinite(every)].max(initial=0.0)
        # N·m at least, and as many times the largest limit that there is.
        endless = max(1e5, 1e4 * largest)
        return tuple(np.where(np.isfinite(T), T, endless) for T in self.efforts)

    def joint(self, column: int) -> tuple[int, int]:
        """The arm, and which of its joints, that has a place among the joints of all."""
        edges = np.cumsum([0, *(arm.n for arm in self.arms)])
        arm = int(np.searchsorted(edges, column, side="right")) - 1
        return arm, int(column - edges[arm])

    def spare(self, i: int) -> int:
        """Degrees of freedom that arm i has to spare; with none its postures are finitely many."""
        return 0 if self.arms[i].fixed else self.arms[i].n - self.system.space.m

    @cached_property
    def dynamic_torque(self) -> bool:
        """True where torques keep their limits along the path."""
        return dynamic_torque(self.problem, self.arms)

    def held_knots(self, count: int) -> Mask:
        """A mask of so many knots of the path, (count,), at which torques have to hold the object
        at rest: also at both ends of the shortest motion, which would throw what nothing holds.
        """
        path = self.problem.path
        held = np.full(count, self.problem.constraints.static_torque)
        if self.dynamic_torque and path is not None and path.duration == "shortest":
            held[[0, -1]] = True
        return held

    def folded(self, i: int, q: Array) -> Array:
        """Positions of arm i, (..., n), moved by whole turns into the limits, or near them.

        Of several positions within the limits it is the one in (−π, π], else that nearest to it.
        """
        lower, upper = self.lower[i], self.upper[i]
        q = self.nearest_turn(i, q)
        turn = 2 * np.pi
        for sign, limit, other in ((1.0, lower, upper), (-1.0, upper, lower)):
            beyond = sign * (limit - q)
            out = (beyond > 0) & self._revolute[i]
            if out.any():
                back = q + sign * turn * np.ceil(np.where(out, beyond, 0.0) / turn)
                # Where no turn helps, the end of the range that is nearer.
                helps = out & (np.maximum(sign * (back - other), 0.0) <= beyond)
                q = np.where(helps, back, q)
        return q

    def all_folded(self, q: Array) -> Array:
        """Stacked positions of all arms, (..., N), each arm's `folded`."""
        parts = enumerate(self.system.split(q))
        return np.concatenate([self.folded(i, part) for i, part in parts], axis=-1)

    def beyond(self, i: int, q: Array) -> Array:
        """The distance of the worst joint of arm i beyond its limits, rad or m, at q, (count, n).

        It is below zero inside the limits, (count,); a whole turn changes nothing.
        """
        middle, half = self._ranges[i]
        return np.asarray((np.abs(self.nearest_turn(i, q - middle)) - half).max(axis=1))

    def given(self, joints: Mapping[str, ArrayLike]) -> list[Array]:
        """Joint positions by name as arrays in the order of the arms, (n_i,) each.

        Raises:
            InputError: they do not fit the arms.
        """
        if not isinstance(joints, Mapping):
            raise InputError("a mapping from arms to positions is needed", key="joints")
        names = [arm.name for arm in self.arms]
        for name in joints:
            if name not in names:
                raise InputError(f"no arm is called {name!r}{nearest(name, names)}", key="joints")
        given = []
        for arm in self.arms:
            try:
                q = np.array(joints.get(arm.name, ()), dtype=float)
            except (TypeError, ValueError):
                q = np.zeros(0)
            if q.shape != (arm.n,) or not np.all(np.isfinite(q)):
                raise InputError(
                    f"{arm.n} finite numbers are needed, for {', '.join(arm.joint_names)}",
                    key=f"joints.{arm.name}",
                )
            given.append(q)
        return given

    def turns(self, i: int) -> Mask:
        """A mask of the joints of arm i that reach every angle, as if they had no limits, (n,)."""
        return self._revolute[i] & (self.upper[i] - self.lower[i] >= 2 * np.pi)

    def moved(self, place: Mapping[str, object]) -> Cell:
        """This cell with the object elsewhere.

        Args:
            place: ``position`` and ``rpy``, in the plane ``angle``, as in ``[object]``; what it
                leaves out stays.

        Raises:
            InputError: it is no place.
        """
        return self.with_places(moved(self.problem, place), self.arms)

    def at(self, problem: Problem) -> Cell:
        """This cell for a problem of its structure, see `same_structure`."""
        arms = []
        for arm, old, new in zip(self.arms, self.problem.arms, problem.arms, strict=True):
            places = {what: getattr(new, what) for what in ("base", "grasp")}
            if any(place != getattr(old, what) for what, place in places.items()):
                arm = replace(arm, **{what: place.pose for what, place in places.items()})
            arms.append(arm)
        return self.with_places(problem, tuple(arms))

    def with_places(self, problem: Problem, arms: tuple[Arm, ...]) -> Cell:
        """This cell for a problem, and arms, that differ in places and masses alone."""
        parameters = _parameters(self.system, problem, arms)
        return replace(self, problem=problem, arms=arms, parameters=parameters)

    @cached_property
    def cases(self) -> tuple[Cell, ...]:
        """A cell for every case of the problem; itself where it has none."""
        if not self.problem.cases:
            return (self,)
        return tuple(self.with_places(each, self.arms) for each in case_problems(self.problem))

    def unlimited(self, i: int) -> tuple[str, ...]:
        """Names of the revolute joints of arm i that have no limits."""
        return tuple(
            joint.name
            for joint in self.arms[i].joints
            if joint.kind == "revolute" and joint.lower == -np.inf and joint.upper == np.inf
        )

    def nearest_turn(self, i: int, q: Array) -> Array:
        """Positions or differences of arm i, (..., n), with every revolute joint in (−π, π]."""
        return _within_half_a_turn(q, self._revolute[i])

    def distances(self, many: Array, q: Array) -> Array:
        """Largest difference of a joint, rad or m, of postures (..., N) to q, (..., N): (...,).

        A whole turn makes no other posture.
        """
        turn, apart = 2 * np.pi, many - q
        # Which of two turns that are as near makes no difference here: rint is fast, mod slow.
        apart -= np.where(self._all_revolute, turn * np.rint(apart / turn), 0.0)
        return np.asarray(np.abs(apart).max(axis=-1))

    def embedded(self, i: int, q: Array) -> Array:
        """Positions of arm i, (count, n), as points whose distance no whole turn changes.

        Revolute joints are points of unit circles, whose chords are nearly the angles where these
        are small; (count, 2n).
        """
        revolute = self._revolute[i]
        return np.hstack([np.where(revolute, np.cos(q), q), np.where(revolute, np.sin(q), 0.0)])

    @cached_property
    def _revolute(self) -> tuple[Mask, ...]:
        return tuple(
            np.array([joint.kind == "revolute" for joint in arm.joints]) for arm in self.arms
        )

    @cached_property
    def _ranges(self) -> list[tuple[Array, Array]]:
        """Middle and half width of the limits by arm, zero and infinite where there are none."""
        ranges = []
        for lower, upper in zip(self.lower, self.upper, strict=True):
            limited = np.isfinite(lower) & np.isfinite(upper)
            low, high = np.where(limited, lower, 0.0), np.where(limited, upper, 0.0)
            ranges.append(((low + high) / 2, np.where(limited, (high - low) / 2, np.inf)))
        return ranges

    @cached_property
    def _all_revolute(self) -> Mask:
        return np.concatenate(self._revolute)


def dynamic_torque(problem: Problem, arms: Sequence[Arm]) -> bool:
    """True where torques keep their limits along a path: as the file says; where it says nothing,
    if the shortest duration is sought and some joint has a limit.
    """
    asked, path = problem.constraints.dynamic_torque, problem.path
    if asked is not None or path is None:
        return bool(asked)
    limited = any(np.isfinite(joint.effort) for arm in arms for joint in arm.joints)
    return limited and path.duration == "shortest"


def _within_half_a_turn(q: Array, revolute: Mask) -> Array:
    turned = np.pi - np.mod(np.pi - q, 2 * np.pi)
    return turned if revolute.all() else np.where(revolute, turned, q)


def _parameters(system: System, problem: Problem, arms: Sequence[Arm]) -> Array:
    thing = problem.object
    inertia = thing.inertia if thing.inertia is not None else 0.0
    return system.numbers(object_parameters(thing.pose, thing.mass, inertia), arms)


def _kept(arm: Arm, limits: Array) -> Array:
    """Limits of an arm; its start is all that a fixed one has."""
    return limits if not arm.fixed or arm.start is None else arm.start


def _torque_scales(problem: Problem, arms: Sequence[Arm]) -> tuple[Array, ...]:
    """T by arm: ones, or the torque limits."""
    if problem.ellipsoid.torque_scaling == "unit":
        return tuple(np.ones(arm.n) for arm in arms)
    return _torque_limits(arms, "torque_scaling = 'limits'")


def _torque_limits(arms: Sequence[Arm], what: str) -> tuple[Array, ...]:
    """The torque limits by arm, for something that needs them.

    Raises:
        InputError: a joint has none.
    """
    for i, arm in enumerate(arms):
        without = [repr(joint.name) for joint in arm.joints if joint.effort == np.inf]
        if without:
            have = "has none" if len(without) == 1 else "have none"
            raise InputError(
                f"{what} needs a torque limit on every joint; {', '.join(without)} {have}",
                key=f"{arm_key(i, arm.name)}.torque_limits",
            )
    return tuple(np.array([joint.effort for joint in arm.joints]) for arm in arms)


def _weightless(problem: Problem, system: System) -> dict[str, str]:
    """Why the inertia of an arm is not known, by name.

    Raises:
        InputError: it is needed.
    """
    faults = {}
    for i, mechanics in enumerate(system.arms):
        arm = mechanics.arm
        fault = together(arm.weightless) if arm.weightless else mechanics.mass_fault()
        if fault and not problem.kinematic:
            raise InputError(fault, key=arm_key(i, arm.name))
        if fault:
            faults[arm.name] = fault
    return faults


def _check_limits(problem: Problem, arms: Sequence[Arm]) -> None:
    """Refuse what needs torque limits where there are none."""
    kind = problem.objective.kind
    if problem.objective.torque_limited:
        _torque_limits(arms, f"objective {kind!r}")
    if problem.constraints.static_torque:
        _torque_limits(arms, "static_torque")
    if problem.constraints.dynamic_torque:
        _torque_limits(arms, "dynamic_torque")
