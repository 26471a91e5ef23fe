"""Start values of the variables of a motion's program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.cell.context import PostureContext
from copose.constraints.registry import constraints_of
from copose.motion.curve.differences import bends, slopes
from copose.motion.dynamics.rates import JointRates
from copose.motion.nlp.knot import KnotNlp
from copose.motion.path.knots import Course
from copose.objectives.objective import Cuts
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.setting import Setting


@dataclass(frozen=True)
class StartOptions:
    """Options of start values."""

    below: float = 0.01  # part of the least objective by which its level starts below it
    share: float = 2.0  # of torque and acceleration limits, of a motion that spares them


def started(
    model: PostureModel,
    drive: JointRates,
    task: KnotNlp,
    course: Course,
    q: Array,
    duration: float,
    cuts: Sequence[Cuts],
    slack: float,
    options: StartOptions = StartOptions(),
) -> Array:
    """Start values of all variables of a closed motion, (n, ny); not finite where there are none.

    Args:
        model: what is built.
        drive: computes wrenches.
        task: what the program holds at a knot.
        course: at the knots.
        q: the motion, (n, N).
        duration: s.
        cuts: demands of the objective that the program has, by knot.
        slack: how wide the bounds of an objective with kinks are.
        options: of start values.
    """
    # Parts that a program has, and that are not empty.
    slices = {name: part for name, part in task.slices.items() if part.stop > part.start}
    n = len(course)
    y = np.zeros((n, task.size))
    y[:, slices["q"]] = q
    held, kept = model.cell.held_knots(n), constraints_of(model.cell, moving=True)
    for k, setting in enumerate(course.settings):
        parts = model.split(q[k][None])
        if "beside" in slices:
            y[k, slices["beside"]] = setting.objective.motion_start(setting, parts, cuts[k], slack)
        for constraint in kept:
            if constraint.name in slices and (held[k] or not constraint.torque_limited):
                y[k, slices[constraint.name]] = constraint.starts(loaded(setting, drive), parts)[0]
    if "slopes" in slices:
        y[:, slices["slopes"]] = slopes(q, 1.0 / (n - 1))
        y[:, slices["bends"]] = bends(q, 1.0 / (n - 1))
    if "wrenches" in slices:
        assert drive.capacity is not None
        wrenches = drive.wrenches(course, model.split(q), duration)
        y[:, slices["wrenches"]] = wrenches / drive.capacity.strength
    if "level" in slices:
        least = values_at(model, course, q).min()
        y[:, slices["level"]] = least - options.below * (1 + abs(least))
    if "stretch" in slices:
        y[:, slices["stretch"]] = 1.0
    if "share" in slices:
        y[:, slices["share"]] = options.share
    return y


def values_at(model: PostureModel, course: Course, q: Array) -> Array:
    """Objective at the first knots of a motion, (k, N); NaN or −∞ where there is none, (k,)."""
    settings = course.settings[: len(q)]
    if model.objective.summable:
        return model.objectives(model.together(settings), q)
    return np.hstack([model.objectives(s, q[k][None]) for k, s in enumerate(settings)])


def loaded(setting: Setting, drive: JointRates) -> PostureContext:
    """A setting with the held object, which it lacks where torques count along a path alone."""
    if setting.holding is not None or drive.capacity is None:
        return setting
    capacity = drive.capacity
    return replace(setting, capacity=capacity, holding=capacity.holding(setting.cell))
