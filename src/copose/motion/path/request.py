"""A path as it is asked for: checked against its problem, and described in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.cell.cell import dynamic_torque
from copose.cell.freedom import Freedom
from copose.errors import InputError
from copose.motion.path.object_motion import ObjectMotion
from copose.problem import PathSpec, Problem
from copose.robots import Arm


def asked(problem: Problem, path: PathSpec, arms: Sequence[Arm]) -> ObjectMotion:
    """The object's path, if the problem can have it.

    Raises:
        InputError: the path cannot be what it asks for.
    """

    def refused(what: str, key: str) -> InputError:
        return InputError(what, key=key, file=problem.source)

    if problem.cases or len(Freedom.of(problem)):
        key = "cases" if problem.cases else "freedom"
        raise refused("and a motion exclude each other; leave out one of them", key)
    journey = ObjectMotion.of(problem)
    if path.closed and not journey.returns:
        what = "a closed path ends where it begins; make the last waypoint the first"
        raise refused(what, "path.closed")
    joints = [joint for arm in arms for joint in arm.joints]
    limits = [limit for joint in joints for limit in (joint.velocity, joint.acceleration)]
    if path.duration == "shortest" and journey.still:
        what = "the waypoints are one place: nothing there takes time; give a duration in seconds"
        raise refused(what, "path.duration")
    timed = dynamic_torque(problem, arms) or np.isfinite(limits).any()
    if path.duration == "shortest" and not timed:
        what = (
            "needs limits that take time to keep, and no joint has one that counts; give "
            "velocity_limits, acceleration_limits or torque_limits, or a duration"
        )
        raise refused(what, "path.duration")
    return journey


def described(problem: Problem, arms: Sequence[Arm]) -> str | None:
    """``[path]`` in a sentence; None without one.

    Raises:
        InputError: the path cannot be what it asks for.
    """
    path = problem.path
    if path is None:
        return None
    journey = asked(problem, path, arms)
    length = sum(float(np.linalg.norm(segment.step)) for segment in journey.segments)
    turned = sum(float(np.linalg.norm(segment.turn)) for segment in journey.segments)
    time = "in the shortest time"
    if not isinstance(path.duration, str):
        time = f"in {path.duration:g} s, {journey.speed / path.duration:.3g} m/s at most"
    if dynamic_torque(problem, arms):
        time += " with torques within their limits"
    back = ", back to the posture that it begins with" if path.closed else ""
    return (
        f"path: {len(path.waypoints)} waypoints, {length:.3g} m and {turned:.3g} rad {time}; "
        f"{path.knots} knots{back}"
    )
