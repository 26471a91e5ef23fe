"""Preconditions of a motion that are refuted without a search: contacts, torques at rest, speed."""

from __future__ import annotations

import numpy as np

from copose.cell.dynamics import HELD
from copose.motion.dynamics.limit_use import holding_shares
from copose.motion.dynamics.rate_bounds import outrun
from copose.motion.path.knots import Course
from copose.motion.search.candidates import Ends
from copose.motion.search.obstruction import Obstruction, dropped, outpaced, uncarried
from copose.motion.search.refinement import Refiner


def refuted(finisher: Refiner, course: Course, held: Ends, duration: float) -> Obstruction | None:
    """The first precondition that does not hold; None where all do."""
    return (
        _uncarried(finisher, course, duration)
        or _dropped(finisher, course, held)
        or _outpaced(finisher, course)
    )


def _uncarried(finisher: Refiner, course: Course, duration: float) -> Obstruction | None:
    """Torques have to keep limits, and no contact wrenches carry the object at all."""
    moving = finisher.model.cell.dynamic_torque
    if not (finisher.model.cell.problem.constraints.static_torque or moving):
        return None
    k = finisher.drive.torques.uncarried(course, moving=moving)
    return None if k is None else uncarried(finisher.model, course, k, duration)


def _dropped(finisher: Refiner, course: Course, held: Ends) -> Obstruction | None:
    """The posture that the motion has to begin or to end in does not hold the object at rest."""
    model, capacity = finisher.model, finisher.drive.capacity
    for k, q in ((0, held.first), (len(course) - 1, held.last)):
        if not model.cell.held_knots(len(course))[k] or not np.isfinite(q).all():
            continue
        assert capacity is not None
        shares = holding_shares(model, capacity, course, k, q)
        if shares.max() > 1 + HELD:
            return dropped(model, k, shares)
    return None


def _outpaced(finisher: Refiner, course: Course) -> Obstruction | None:
    """A grasp moves faster than its arm can follow, in the time that is asked for."""
    duration = finisher.path.duration
    if isinstance(duration, str):
        return None
    # Differences between knots do not see what rates do there.
    step = duration / (finisher.path.knots - 1)
    grasp = outrun(finisher.model.cell, course, duration, step)
    return None if grasp is None else outpaced(finisher.model, course, duration, grasp)
