"""All self-motions of arms with one degree of freedom to spare, at one pose of the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.errors import InputError, arm_key
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.reachable.reachability import rails_of
from copose.posture.search.global_search import EFFORTS
from copose.posture.setting import Setting
from copose.self_motion.curves.arc_length import Track
from copose.self_motion.curves.joint_range import JointRange
from copose.self_motion.curves.limited_curve import Course
from copose.self_motion.curves.loops import Loops
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve
from copose.self_motion.curves.tracing import Curve, follow
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSampler

# The longest step along a self-motion, rad (or m).
_STRIDE = 0.3
# Joints that differ by less are the same, rad (or m).
_SAME = 1e-6
# What a posture that holds the object may be off it, m or rad.
_NEAR = 1e-3


@dataclass(frozen=True, eq=False)
class Branches:
    """The self-motions of one arm that limits leave something of, in an order of their own.

    Attributes:
        courses: of them.
        present: which of them the arm is on.
        position: its arc length there, rad (or m).
        limits: of the arm's joints.
    """

    courses: tuple[Course, ...]
    present: int
    position: float
    limits: JointRange

    @classmethod
    def again(cls, known: SelfMotionCurve, setting: Setting, i: int, q: Array) -> Branches | None:
        """Those of arm i found before, with the arm at another posture on one of them, (n,); None
        if it is on none, or its limits or its grasp were others.
        """
        limits, goal = JointRange.of(setting.cell, i), setting.placement.goals[i]
        alike = [np.array_equal(limits.lower, known.limits.lower)]
        alike += [np.array_equal(limits.upper, known.limits.upper)]
        alike += [np.array_equal(goal, known.track.rails.goals[0])]
        if not all(alike):
            return None
        curves = sorted((known, *known.others), key=lambda curve: curve.branch)
        for k, curve in enumerate(curves):
            position = curve.track.place(q)
            away = curve.track.rails.wrapped(q - curve.track.closed(np.array([position])))
            if np.abs(away).max() < _SAME:
                courses = [Course(each.track, each.cuts, each.pieces) for each in curves]
                courses[k], position = courses[k].holding(q)
                return cls(tuple(courses), k, position, limits)
        return None


def held_postures(
    model: PostureModel, setting: Setting, joints: Sequence[Array]
) -> tuple[Array, ...]:
    """A posture closed to the last digit, by arm (n_i,).

    Raises:
        InputError: an arm does not hold the object, by 1e-3 m or rad.
    """
    found = []
    for i, (arm, q) in enumerate(zip(setting.cell.arms, joints, strict=True)):
        lower, upper = np.minimum(setting.lower[i], q), np.maximum(setting.upper[i], q)
        kernels, goal = model.arms[i], setting.placement.goals[i]
        off = np.abs(kernels.residual(q[None], goal)[0]).max()
        end, gap = project(kernels, q[None], goal, lower, upper)
        if not (gap[0] <= CLOSED and off <= _NEAR):
            raise InputError(
                f"arm {arm.name!r} does not hold the object there", key=arm_key(i, arm.name)
            )
        found.append(end[0])
    return tuple(found)


def branches(
    model: PostureModel, setting: Setting, joints: Sequence[Array], arms: Sequence[int], seed: int
) -> list[Branches]:
    """The self-motions of some arms, each with one degree of freedom to spare.

    Args:
        model: what is built.
        setting: where the object is.
        joints: closed postures by arm, (n_i,).
        arms: numbers of those asked for.
        seed: of the random postures by which self-motions are met.
    """
    seeds = {i: _seeds(model, setting, i, joints[i], seed) for i in arms}
    curves: dict[int, list[Curve]] = {}
    for arm_kernels in dict.fromkeys(model.arms[i] for i in arms):
        mates = [i for i in arms if model.arms[i] is arm_kernels]
        rows = np.repeat(np.arange(len(mates)), [len(seeds[i]) for i in mates])
        rails = _freed(model, setting, mates).taken(rows)
        found = follow(rails, np.vstack([seeds[i] for i in mates]), stride=_STRIDE)
        for k, i in enumerate(mates):
            curves[i] = [found[row] for row in np.flatnonzero(rows == k)]
    return [_sorted(setting, i, joints[i], seeds[i], curves[i]) for i in arms]


def _freed(model: PostureModel, setting: Setting, arms: Sequence[int]) -> ClosureManifold:
    """What arms of one model move on, without the limits of revolute joints."""
    limits = [JointRange.of(setting.cell, i) for i in arms]
    return replace(
        rails_of(model, setting, arms),
        lower=np.array([each.freed[0] for each in limits]),
        upper=np.array([each.freed[1] for each in limits]),
        unlimited=np.array([each.revolute for each in limits]),
    )


def _seeds(model: PostureModel, setting: Setting, i: int, q: Array, seed: int) -> Array:
    """The posture of arm i, and one on each self-motion that limits may leave something of."""
    effort, goal = EFFORTS["normal"], setting.placement.goals[i]
    sampler = ArmSampler(setting.cell, model.arms[i], i, goal)
    loops = Loops(setting.cell, model.arms[i], i, goal)
    rng = np.random.default_rng([seed, i])
    for _ in range(effort.batches):
        if not loops.add(loops.closed(sampler.draw(rng, effort.batch))):
            break
    return np.vstack([q[None], loops.closed(loops.innermost(loops.spacing))])


def _sorted(setting: Setting, i: int, q: Array, seeds: Array, curves: Sequence[Curve]) -> Branches:
    """Each curve once, in the order of the postures in the middle of what limits leave."""
    once: list[Curve] = []
    for place, curve in zip(seeds, curves, strict=True):
        if len(curve.points) > 1 and all(other.place(place) is None for other in once):
            once.append(curve)
    if not once or once[0] is not curves[0]:
        arm = setting.cell.arms[i]
        raise InputError(
            f"arm {arm.name!r} is at a singular posture, where self-motions meet",
            key=arm_key(i, arm.name),
        )
    limits = JointRange.of(setting.cell, i)
    rigid = setting.cell.system.space.rigid
    courses = [Course.of(Track.of(curve, rigid), limits) for curve in once]
    courses[0], position = courses[0].holding(q)
    left = [k for k, course in enumerate(courses) if k == 0 or course.pieces]
    order = sorted(left, key=lambda k: courses[k].mark)
    return Branches(tuple(courses[k] for k in order), order.index(0), position, limits)
