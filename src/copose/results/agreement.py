"""Agreement of a result with itself: names, counts, lengths and ellipsoids."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sized
from typing import Any

import numpy as np

from copose.capability import RESOLUTIONS, log_ball_volume
from copose.problem import SPACES, PlanarObstacle
from copose.results.motion import Motion
from copose.results.posture import PlanarPlace, Posture
from copose.results.records import EllipsoidRecord
from copose.results.solution import ProblemRecord, Solution


class Largest:
    """Bounds of the numbers in a result."""

    error = 1e-6  # relative, between numbers that follow from one another
    place = 1e12  # m or rad, of positions and angles
    number = 1e100  # of all others: squares and products of two are still numbers


def disagreements(answer: Solution | Motion) -> Iterator[str]:
    """Contradictions within a result, ``key: why`` each."""
    yield from _problem(answer.problem)
    names = answer.joint_names
    if not names or any(len(set(joints)) < len(joints) for joints in names.values()):
        yield "joint_names: not the different joints of at least one arm"
    for link in answer.problem.links:
        if not 0 <= link.frame <= len(names.get(link.arm, ())) or link.arm not in names:
            yield "problem.links: not of joints that joint_names lists"
        if any(len(point) != 3 for point in link.points):
            yield "problem.links: points not of 3 numbers each"
    yield from _motion(answer) if isinstance(answer, Motion) else _solution(answer)


def _problem(problem: ProblemRecord) -> Iterator[str]:
    space, axes, shape = SPACES[problem.space], problem.axes, problem.shape
    if not axes or len(set(axes)) < len(axes) or not set(axes) <= set(space.coordinates):
        yield "problem.axes: not coordinates of the task space"
    flat = [isinstance(obstacle, PlanarObstacle) for obstacle in problem.obstacles]
    if shape is not None:
        flat.append(shape.kind == "disk" or len(getattr(shape, "size", ())) == 2)
    if any(each != space.planar for each in flat):
        yield "problem: has a shape that is not of the task space"


def _solution(solution: Solution) -> Iterator[str]:
    names, cases, past = solution.joint_names, solution.cases, solution.cases_before
    answers = [solution.after is not None, cases is not None]
    if sum(answers) != (solution.status == "solved") or cases == ():
        yield "status: does not go with after"
    if any(
        not set(joints) <= set(names.get(arm, ())) for arm, joints in solution.unlimited.items()
    ):
        yield "unlimited: not joints that joint_names lists"
    if solution.limits and _counts(solution.limits) != _counts(names):
        yield "limits: not those of the joints that joint_names lists"
    if cases is not None and len({case.name for case in cases}) < len(cases):
        yield "cases: two have one name"
    if cases and past and [case.name for case in cases] != [case.name for case in past]:
        yield "cases_before: not the cases that cases lists"
    for free in solution.freedom:
        ends = free.lower, free.upper
        offsets = [x for x in (free.before, free.after) if x is not None]
        if ends[0] > ends[1] or max(map(abs, (*ends, *offsets))) > Largest.place:
            yield f"freedom.{free.name}: not a range and offsets"
    for key in ("before", "after", "nearest_miss"):
        yield from _faults(solution, key, getattr(solution, key))
    for key in ("cases", "cases_before"):
        for k, case in enumerate(getattr(solution, key) or ()):
            yield from _faults(solution, f"{key}.{k}", case)
            if not 0 < case.weight <= Largest.number:
                yield f"{key}.{k}.weight: not above zero"


def _motion(motion: Motion) -> Iterator[str]:
    counts = _counts(motion.joint_names)
    if (motion.status == "solved") != (motion.knots is not None):
        yield "status: does not go with knots"
    if _counts(motion.limits) != counts:
        yield "limits: not those of the joints that joint_names lists"
    if motion.time is None or motion.knots is None:
        if (motion.time is None) != (motion.knots is None):
            yield "time, knots: one without the other"
        return
    if len(motion.time) != len(motion.knots) or len(motion.time) < 2:
        yield "time: not one for every knot, of two at least"
    if np.any(np.diff(motion.time) < 0) or max(map(abs, motion.time)) > Largest.place:
        yield "time: does not run forwards"
    if motion.least_norm is not None and len(motion.least_norm.objective) != len(motion.time):
        yield "least_norm.objective: not one for every knot"
    for k, knot in enumerate(motion.knots):
        yield from _faults(motion, f"knots.{k}", knot)
        for key in ("velocity", "acceleration", "torque"):
            values = getattr(knot, key)
            if values is not None and _counts(values) != counts:
                yield f"knots.{k}.{key}: not those of the joints that joint_names lists"


def _faults(answer: Solution | Motion, key: str, posture: Posture | None) -> Iterator[str]:
    """Contradictions within a posture, each with the posture's key."""
    if posture is not None:
        yield from (f"{key}.{fault}" for fault in _posture(answer, posture))


def _posture(answer: Solution | Motion, posture: Posture) -> Iterator[str]:
    space, counts = SPACES[answer.problem.space], _counts(answer.joint_names)
    m, wrenches = space.m, posture.wrenches or {}
    for key, number in _numbers("", posture.model_dump()):
        if abs(number) > (Largest.place if _is_place(key) else Largest.number):
            yield f"{key}: {number:g} is larger than any can be"
    shares = (posture.torque_shares or {}).items()
    by_joint = {
        "joints": posture.joints,
        "static_torque": posture.static_torque,
        **{f"torque_shares.{name}": each for name, each in shares},
    }
    for key, values in by_joint.items():
        if values is not None and _counts(values) != counts:
            yield f"{key}: not those that joint_names lists"
    by_arm: dict[str, Mapping[str, Any]] = {
        "arms": posture.arms,
        "closure_error": posture.closure_error,
        **{f"wrenches.{name}": each for name, each in wrenches.items()},
    }
    for key, arms in by_arm.items():
        if set(arms) != set(answer.joint_names):
            yield f"{key}: not of the arms that joint_names lists"
    if min(posture.closure_error.values(), default=0.0) < 0:
        yield "closure_error: below zero"
    if set(posture.log_volumes) != set(RESOLUTIONS):
        yield f"log_volumes: not those of {' and '.join(RESOLUTIONS)}"
    places = {"object": posture.object}
    for what in ("base", "grasp"):
        moved = getattr(posture, what) or {}
        if not set(moved) <= set(answer.joint_names):
            yield f"{what}: not of arms that joint_names lists"
        places |= {f"{what}.{arm}": place for arm, place in moved.items()}
    for key, place in places.items():
        if isinstance(place, PlanarPlace) != space.planar:
            yield f"{key}: not of the task space"
        if abs(float(np.linalg.norm(getattr(place, "quaternion", (1.0,)))) - 1) > Largest.error:
            yield f"{key}.quaternion: not of length 1"
    ellipsoids: list[tuple[str, EllipsoidRecord, int | None]] = [
        ("ellipsoid", posture.ellipsoid, len(answer.problem.axes)),
        *((f"arms.{name}.ellipsoid", arm.ellipsoid, m) for name, arm in posture.arms.items()),
        *((f"companions.{name}", each, None) for name, each in (posture.companions or {}).items()),
    ]
    rows: list[tuple[str, int, Iterable[Sized]]] = [
        ("accelerations", m, [each.direction for each in posture.accelerations or ()]),
    ]
    for name, arm in posture.arms.items():
        rows.append((f"arms.{name}.skeleton", 3, [*arm.skeleton, arm.grasp]))
        if len(arm.skeleton) < 2:
            yield f"arms.{name}.skeleton: neither root nor tip"
        rows.append((f"arms.{name}.quaternions", 4, arm.quaternions))
        if len(arm.quaternions) != len(arm.skeleton):
            yield f"arms.{name}.quaternions: not one of each point of skeleton"
        elif any(abs(math.hypot(*each) - 1) > Largest.error for each in arm.quaternions):
            yield f"arms.{name}.quaternions: not of length 1"
    for name, each in wrenches.items():
        rows.append(
            (f"wrenches.{name}", m, [x for w in each.values() for x in (w.wrench, w.internal)])
        )
    for name, exact in (posture.exact_sets or {}).items():
        a = len(exact.axes)
        if not 1 <= a <= 3 or not set(exact.axes) <= set(space.coordinates):
            yield f"exact_sets.{name}.axes: not coordinates of the task space"
        if exact.residual_radius < 0:
            yield f"exact_sets.{name}.residual_radius: below zero"
        rows.append((f"exact_sets.{name}.vertices", a, exact.vertices))
        ellipsoids.append((f"exact_sets.{name}.ellipsoid", exact.ellipsoid, a))
    for key, size, entries in rows:
        if any(len(entry) != size for entry in entries):
            yield f"{key}: not of {size} numbers each"
    for key, record, size_or_none in ellipsoids:
        yield from (f"{key}.{fault}" for fault in _ellipsoid(record, size_or_none))


def _ellipsoid(record: EllipsoidRecord, a: int | None) -> Iterator[str]:
    """Contradictions within an ellipsoid's numbers, in ``a`` coordinates where that is known."""
    if all(getattr(record, key) is None for key in EllipsoidRecord.model_fields):
        return
    for key in EllipsoidRecord.model_fields:
        if getattr(record, key) is None:
            yield f"{key}: null, and others are not"
            return
    radii = record.radii or ()
    a = len(radii) if a is None else a
    if (
        len(radii) != a
        or min(radii, default=0.0) < 1 / Largest.number
        or max(radii) > Largest.number
    ):
        yield "radii: not one positive number per axis"
    elif list(radii) != sorted(radii, reverse=True):
        yield "radii: not the longest first"
    elif len(record.center or ()) != a:
        yield f"center: not of {a} numbers"
    elif any([*map(len, x or ())] != [a] * a for x in (record.gram, record.axes)):
        yield f"gram, axes: not of {a} rows of {a} numbers"
    else:
        axes, gram = np.array(record.axes), np.array(record.gram)
        factor = axes / np.array(radii)[:, None]
        volume = float(np.sum(np.log(radii))) + log_ball_volume(a)
        if not np.allclose(axes @ axes.T, np.eye(a), rtol=0, atol=Largest.error):
            yield "axes: not unit vectors at right angles"
        elif not np.allclose(factor.T @ factor, gram, rtol=0, atol=Largest.error * radii[-1] ** -2):
            yield "gram: not that of radii and axes"
        elif abs((record.log_volume or 0.0) - volume) > Largest.error * max(1.0, abs(volume)):
            yield "log_volume: not that of radii"


def _is_place(key: str) -> bool:
    """True where a key of a posture is of positions, angles or quaternions."""
    return bool(re.search(r"^(joints|object|base|grasp)\b|\.(skeleton|quaternions|grasp)\b", key))


def _counts(by_arm: Mapping[str, Sized]) -> list[tuple[str, int]]:
    # In order: what is stacked is told apart by it alone.
    return [(arm, len(values)) for arm, values in by_arm.items()]


def _numbers(key: str, data: Any) -> Iterator[tuple[str, float]]:
    """All numbers of a tree and where they are."""
    if isinstance(data, Mapping):
        for name, value in data.items():
            yield from _numbers(f"{key}.{name}" if key else name, value)
    elif isinstance(data, tuple):
        for k, value in enumerate(data):
            yield from _numbers(f"{key}.{k}", value)
    elif isinstance(data, float):
        yield key, data
