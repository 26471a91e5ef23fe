"""The motion along the path of a session: planned, looked at at any instant, and saved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from copose.errors import InputError
from copose.formats import trajectory_csv
from copose.live.problem_file.document import place
from copose.live.session import Session
from copose.live.state import State
from copose.motion import plan
from copose.motion.curve.hermite import hermite
from copose.motion.path.object_motion import ObjectMotion, waypoint_poses
from copose.poses import Array, Pose
from copose.posture import Planner
from copose.problem import Problem, moved
from copose.progress import Tell
from copose.results import Knot, Motion, Posture, Solution, to_json, write_file

# What an instant may be beside a knot that counts as at it, s.
_AT_KNOT = 1e-9
# What waypoints may differ by that count as the same, m and of quaternions.
_ALIKE = 1e-12
_INTERRUPTED = "planning was interrupted"
_NONE = "no motion has been planned"


@dataclass(frozen=True, eq=False)
class Course:
    """A motion that was found, between its knots, too.

    Attributes:
        problem: whose path it goes along.
        motion: with knots.
        planner: of the problem's structure.
    """

    problem: Problem
    motion: Motion
    planner: Planner

    @property
    def duration(self) -> float:
        """The time that it takes, s."""
        return float(self.motion.duration or 0.0)

    @cached_property
    def knots(self) -> tuple[Knot, ...]:
        """The motion's."""
        return self.motion.knots or ()

    @cached_property
    def time(self) -> Array:
        """Of the knots, s, (n,)."""
        return np.array(self.motion.time, dtype=float)

    @cached_property
    def values(self) -> Array:
        """The objective at the knots, NaN where there is none, (n,)."""
        return np.array([knot.objective for knot in self.knots], dtype=float)

    @cached_property
    def _journey(self) -> ObjectMotion:
        return ObjectMotion.of(self.problem)

    @cached_property
    def _rates(self) -> dict[str, Array]:
        names = self.motion.joint_names
        return {arm: np.array([knot.velocity[arm] for knot in self.knots]) for arm in names}

    @cached_property
    def _joints(self) -> dict[str, Array]:
        names = self.motion.joint_names
        return {arm: np.array([knot.joints[arm] for knot in self.knots]) for arm in names}

    def joints(self, time: float) -> dict[str, list[float]]:
        """The arms at an instant: on the cubic Hermite curve between two knots, rad or m."""
        k = int(np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2))
        step = float(self.time[k + 1] - self.time[k])
        part = float(np.clip((time - self.time[k]) / step, 0.0, 1.0)) if step > 0 else 0.0
        two = slice(k, k + 2)
        return {
            arm: hermite(q[two], self._rates[arm][two], step, part)[0].tolist()
            for arm, q in self._joints.items()
        }

    def pose(self, time: float) -> Pose:
        """The object at an instant."""
        return self._journey.at(time / self.duration if self.duration > 0 else 0.0).pose

    def solution(self, time: float) -> Solution:
        """The measures at an instant; between knots the chain is open by what the path tolerates,
        so that the posture may be its ``nearest_miss``.
        """
        where = place(self.pose(time), planar=self.problem.space.planar)
        return self.planner.evaluate(self.joints(time), problem=moved(self.problem, where))

    def posture(self, time: float) -> Posture:
        """The arms and the object at an instant; at a knot what the motion records of it."""
        knot = self.knot(time)
        if knot is not None:
            return knot
        told = self.solution(time)
        shown = told.after or told.nearest_miss
        assert shown is not None
        return shown

    def knot(self, time: float) -> Knot | None:
        """The knot at an instant; None between knots."""
        k = int(np.abs(self.time - time).argmin())
        return self.knots[k] if abs(self.time[k] - time) <= _AT_KNOT else None

    def value(self, time: float) -> float | None:
        """The objective at an instant, straight between knots; None where there is none."""
        return self._between(self.values, time)

    def tracked(self, time: float) -> float | None:
        """The objective of least-norm tracking, alike."""
        record = self.motion.least_norm
        if record is None:
            return None
        return self._between(np.array(record.objective, dtype=float), time)

    def _between(self, values: Array, time: float) -> float | None:
        value = float(np.interp(time, self.time, values))
        return value if np.isfinite(value) else None


@dataclass(eq=False)
class PathMotion:
    """The motion of a session along its path; every method belongs to the session's thread.

    Attributes:
        session: whose problem has a path.
        course: the motion that was planned last; None before one was found.
        message: why there is none, or no newer one; empty if nothing is wrong.
        interrupted: whether planning was, the last time.
        time: the instant that is looked at, s.
    """

    session: Session
    course: Course | None = None
    message: str = ""
    interrupted: bool = False
    time: float = 0.0

    def plan(self, tell: Tell | None = None) -> bool:
        """Plan the motion of the session's problem; where there is none the last one stays.

        Args:
            tell: is told of progress.

        Returns:
            Whether there is a new motion.
        """
        problem = self.session.state.problem
        try:
            with self.session.watched(tell) as watch:
                motion = plan(problem)
                self.interrupted = watch.interrupted
            planner = self.session.planner()
        except InputError as error:
            self.message, self.interrupted = str(error), False
            return False
        if motion.knots is None:
            why = f"{motion.status}: {motion.reason}"
            self.message = _INTERRUPTED if self.interrupted else why
            return False
        share = self.time / self.course.duration if self.course and self.course.duration else 0.0
        self.course, self.message = Course(problem, motion, planner), ""
        # The same place along the path, should it take another time.
        self.time = share * self.course.duration
        return True

    def look(self, time: float) -> Posture:
        """Go to an instant.

        Raises:
            InputError: there is no motion.
        """
        course = self._course()
        self.time = float(np.clip(time, 0.0, course.duration))
        return course.posture(self.time)

    def state(self) -> State:
        """What the session shows, with the arms where they are at the instant.

        Raises:
            InputError: there is no motion.
        """
        told = self._course().solution(self.time)
        return replace(self.session.state, solution=told, shares=None)

    @property
    def stale(self) -> bool:
        """Whether the problem asks for another motion by now."""
        course = self.course
        return course is not None and not _same_motion(course.problem, self.session.state.problem)

    def save(self, kind: str, path: Path) -> Path:
        """Write the motion; it replaces what is there.

        Args:
            kind: motion, for a folder with ``result.json``, ``trajectory.csv`` and ``path.png``; or
                page, for HTML that plays.
            path: the folder, or the file.

        Raises:
            InputError: there is no motion, or the files cannot be written.
        """
        course = self._course()
        if kind == "page":
            from copose.formats import export

            export(course.motion, "html", path, problem=course.problem)
            return path
        from copose.report import draw

        write_file(path / "result.json", to_json(course.motion).encode())
        write_file(path / "trajectory.csv", trajectory_csv(course.motion).encode())
        draw(course.motion, path / "path.png")
        return path

    def _course(self) -> Course:
        if self.course is None:
            raise InputError(self.message or _NONE)
        return self.course


def _same_motion(one: Problem, other: Problem) -> bool:
    """Whether two problems ask for one motion: what ``[object]`` has of places does not enter but
    where waypoints leave them out.
    """
    if one is other:
        return True
    here = place(one.object.pose, planar=one.space.planar)
    there = zip(waypoint_poses(one), waypoint_poses(other), strict=False)
    return moved(other, here) == moved(one, here) and all(
        np.allclose(a.position, b.position, 0, _ALIKE)
        and np.allclose(a.quaternion, b.quaternion, 0, _ALIKE)
        for a, b in there
    )
