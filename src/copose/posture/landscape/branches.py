"""Branches: all self-motions of arms with one degree of freedom to spare, at one object pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.errors import InputError, arm_key
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.reachable.components import manifold_of
from copose.posture.search.effort import EFFORTS
from copose.posture.setting import Setting
from copose.self_motion.curves.arc_length import Track
from copose.self_motion.curves.curve import Curve, TracingOptions
from copose.self_motion.curves.joint_range import JointRange
from copose.self_motion.curves.limited_curve import LimitedCurve
from copose.self_motion.curves.loops import Loops
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve
from copose.self_motion.curves.tracing import follow
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSampler


@dataclass(frozen=True, eq=False)
class Branches:
    """Self-motions of one arm that are somewhere within limits, in an order that they alone decide.

    Attributes:
        courses: the self-motions.
        present: number of the one that the arm is on.
        position: arc length of the arm's posture there, rad (or m).
        limits: of the arm's joints.
    """

    courses: tuple[LimitedCurve, ...]
    present: int
    position: float
    limits: JointRange

    @classmethod
    def again(cls, known: SelfMotionCurve, setting: Setting, i: int, q: Array) -> Branches | None:
        """The branches of arm i as known before, with its posture q, (n,), on one of them.

        None where the posture is on none of them, or limits or grasp have changed.
        """
        limits, goal = JointRange.of(setting.cell, i), setting.placement.goals[i]
        alike = [np.array_equal(limits.lower, known.limits.lower)]
        alike += [np.array_equal(limits.upper, known.limits.upper)]
        alike += [np.array_equal(goal, known.track.manifold.goals[0])]
        if not all(alike):
            return None
        curves = sorted((known, *known.others), key=lambda curve: curve.branch)
        for k, curve in enumerate(curves):
            position = curve.track.place(q)
            away = curve.track.manifold.wrapped(q - curve.track.closed(np.array([position])))
            if np.abs(away).max() < 1e-6:
                courses = [LimitedCurve(known.track, known.cuts, known.pieces) for known in curves]
                courses[k], position = courses[k].holding(q)
                return cls(tuple(courses), k, position, limits)
        return None


def held_postures(
    model: PostureModel, setting: Setting, joints: Sequence[Array], near: float = 1e-3
) -> tuple[Array, ...]:
    """A posture, by arm (n_i,), projected onto the closure.

    An arm whose gap is at most ``near``, m or rad, counts as holding the object.

    Raises:
        InputError: an arm does not hold the object.
    """
    closed = []
    for i, (arm, q) in enumerate(zip(setting.cell.arms, joints, strict=True)):
        lower, upper = np.minimum(setting.lower[i], q), np.maximum(setting.upper[i], q)
        kernels, goal = model.arms[i], setting.placement.goals[i]
        off = np.abs(kernels.residual(q[None], goal)[0]).max()
        end, gap = project(kernels, q[None], goal, lower, upper)
        if not (gap[0] <= CLOSED and off <= near):
            raise InputError(
                f"arm {arm.name!r} does not hold the object there", key=arm_key(i, arm.name)
            )
        closed.append(end[0])
    return tuple(closed)


def traced_branches(
    model: PostureModel, setting: Setting, joints: Sequence[Array], arms: Sequence[int], seed: int
) -> list[Branches]:
    """The self-motions of some arms, by number, each with one degree of freedom to spare.

    They are traced from random postures; those of ``joints``, by arm (n_i,), are closed.
    """
    seeds = {i: _seeds(model, setting, i, joints[i], seed) for i in arms}
    curves: dict[int, list[Curve]] = {}
    for arm_kernels in dict.fromkeys(model.arms[i] for i in arms):
        members = [i for i in arms if model.arms[i] is arm_kernels]
        rows = np.repeat(np.arange(len(members)), [len(seeds[i]) for i in members])
        manifold = _freed(model, setting, members).taken(rows)
        options = TracingOptions(longest=0.3)
        traced = follow(manifold, np.vstack([seeds[i] for i in members]), options=options)
        for k, i in enumerate(members):
            curves[i] = [traced[row] for row in np.flatnonzero(rows == k)]
    return [_sorted(setting, i, joints[i], seeds[i], curves[i]) for i in arms]


def _freed(model: PostureModel, setting: Setting, arms: Sequence[int]) -> ClosureManifold:
    """Closure of arms of one model, without the limits of revolute joints."""
    limits = [JointRange.of(setting.cell, i) for i in arms]
    return replace(
        manifold_of(model, setting, arms),
        lower=np.array([limit.freed[0] for limit in limits]),
        upper=np.array([limit.freed[1] for limit in limits]),
        unlimited=np.array([limit.revolute for limit in limits]),
    )


def _seeds(model: PostureModel, setting: Setting, i: int, q: Array, seed: int) -> Array:
    """The posture of arm i, and one on each self-motion that may be somewhere within limits."""
    effort, goal = EFFORTS["normal"], setting.placement.goals[i]
    sampler = ArmSampler(setting.cell, model.arms[i], i, goal)
    loops = Loops(setting.cell, model.arms[i], [i], goal[None])
    rng = np.random.default_rng([seed, i])
    for _ in range(effort.batches):
        drawn = sampler.draw(rng, effort.batch)
        if not loops.add(*loops.closed(drawn, np.zeros(len(drawn), dtype=np.intp)))[0]:
            break
    inner = loops.innermost(loops.options.spacing)
    return np.vstack([q[None], loops.closed(inner, np.zeros(len(inner), dtype=np.intp))[0]])


def _sorted(setting: Setting, i: int, q: Array, seeds: Array, curves: Sequence[Curve]) -> Branches:
    """Branches of arm i from traced curves, each self-motion once, by `LimitedCurve.mark`."""
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
    courses = [LimitedCurve.of(Track.of(curve, rigid), limits) for curve in once]
    courses[0], position = courses[0].holding(q)
    left = [k for k, course in enumerate(courses) if k == 0 or course.pieces]
    order = sorted(left, key=lambda k: courses[k].mark)
    return Branches(tuple(courses[k] for k in order), order.index(0), position, limits)
