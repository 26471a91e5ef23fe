"""Where the variables of a motion's program start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.capability.torque_limits import Demand
from copose.motion.dynamics.rates import JointRates
from copose.motion.nlp.knot import KnotNlp
from copose.motion.path.knots import Course, bends, slopes
from copose.objectives.ellipsoid_measures import EllipsoidMeasure
from copose.objectives.limits_measures import LimitsMeasure
from copose.poses import Array
from copose.posture.model import PostureModel, Setting

# How far below the least objective its level starts, relative.
_BELOW = 0.01
# What share of torque and acceleration limits a motion that spares them starts with.
_SHARE = 2.0


def started(
    model: PostureModel,
    drive: JointRates,
    task: KnotNlp,
    course: Course,
    q: Array,
    duration: float,
    demands: Sequence[Sequence[Demand]] | None,
    slack: float,
) -> Array:
    """All variables of every knot of a closed motion, (n, ny); not finite where one has no start.

    Args:
        model: what is built.
        drive: computes wrenches.
        task: what the program holds at a knot.
        course: at the knots.
        q: the motion, (n, N).
        duration: s.
        demands: of an objective that torque limits decide, by knot.
        slack: how wide the bounds of an objective with kinks are.
    """
    # Parts that a program has, and that are not empty.
    slices = {name: part for name, part in task.slices.items() if part.stop > part.start}
    n = len(course)
    y = np.zeros((n, task.size))
    y[:, slices["q"]] = q
    held = model.cell.held_knots(n)
    for k, setting in enumerate(course.settings):
        here = q[k][None]
        if "beside" in slices:
            wanted = None if demands is None else demands[k]
            y[k, slices["beside"]] = _beside(model, setting, here, wanted, slack)
        if "hold" in slices and held[k]:
            assert drive.capacity is not None
            holding = drive.capacity.holding(setting.cell)
            y[k, slices["hold"]] = drive.capacity.resting(holding, model.split(here))[0]
    if "slopes" in slices:
        y[:, slices["slopes"]] = slopes(q, 1.0 / (n - 1))
        y[:, slices["bends"]] = bends(q, 1.0 / (n - 1))
    if "wrenches" in slices:
        assert drive.capacity is not None
        wrenches = drive.wrenches(course, model.split(q), duration)
        y[:, slices["wrenches"]] = wrenches / drive.capacity.strength
    if "level" in slices:
        least = values_at(model, course, q).min()
        y[:, slices["level"]] = least - _BELOW * (1 + abs(least))
    if "stretch" in slices:
        y[:, slices["stretch"]] = 1.0
    if "share" in slices:
        y[:, slices["share"]] = _SHARE
    return y


def values_at(model: PostureModel, course: Course, q: Array) -> Array:
    """The objective at every knot of a motion, (n, N); NaN or −∞ where there is none, (n,)."""
    found = [
        model.objectives(setting, here[None])[0]
        for setting, here in zip(course.settings, q, strict=True)
    ]
    return np.array(found)


def _beside(
    model: PostureModel,
    setting: Setting,
    q: Array,
    demands: Sequence[Demand] | None,
    slack: float,
) -> Array:
    """What the objective adds, at a posture, (1, N)."""
    objective = setting.objective
    if isinstance(objective, EllipsoidMeasure):
        grams = model.grams(setting, model.split(q))
        assert grams is not None
        if not np.all(np.isfinite(grams)):
            return np.full(1, np.nan)
        return objective.extra_start(grams[0], slack)
    assert isinstance(objective, LimitsMeasure) and model.capacity is not None
    assert setting.holding is not None and demands is not None
    parts = model.split(q)
    return np.asarray(objective.starts(model.capacity, setting.holding, parts, [demands])[0])
