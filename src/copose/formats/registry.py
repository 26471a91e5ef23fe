"""The formats of other programs by name, one line each, and the export to them."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from copose.errors import InputError, nearest
from copose.formats.postures import ExportedPosture, knots, problem_of
from copose.formats.ros import (
    joint_state_yaml,
    joint_trajectory_yaml,
    robot_state_yaml,
    robot_trajectory_yaml,
)
from copose.formats.xml_files import group_state_srdf, keyframes_xml
from copose.problem import SPACES, Problem
from copose.results import Motion, Solution, write_file


def posture_csv(exported: ExportedPosture) -> str:
    """The table of a posture, ``arm/joint, …`` and one row, rad or m."""
    return _text([*exported.solution.q_names], [exported.posture.q.tolist()])


def trajectory_csv(motion: Motion) -> str:
    """The table of a motion, ``time, arm/joint, …``: a row for every knot, s and rad or m.

    Raises:
        InputError: nothing moves.
    """
    rows = ([time, *knot.q.tolist()] for time, knot in knots(motion))
    return _text(["time", *motion.q_names], rows)


def _text(header: list[str], rows: Iterable[list[float]]) -> str:
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(map(repr, row) for row in rows)
    return sink.getvalue()


def posture_page(exported: ExportedPosture) -> str:
    """A page that shows a posture, and the one before as a ghost.

    Raises:
        InputError: the problem cannot be read or is not the result's, or viser is not installed.
    """
    # Pages need packages that the other formats do without.
    from copose.viewer import page_html

    solution = exported.solution
    problem = problem_of(solution, exported.problem, "html")
    return page_html(solution, problem, posture=exported.posture)


def motion_page(motion: Motion, problem: Problem | None) -> str:
    """A page that plays a motion.

    Raises:
        InputError: nothing moves, the problem cannot be read or is not the result's, or viser is
            not installed.
    """
    knots(motion)
    from copose.viewer import page_html

    return page_html(motion, problem_of(motion, problem, "html"))


@dataclass(frozen=True)
class Format:
    """The writers of postures and motions in one format."""

    posture_file: str  # usual name of a posture's file
    posture: Callable[[ExportedPosture], str]  # writes the text of a posture
    motion_file: str = ""  # usual name of a motion's file; empty where the format has no motions
    # Writes the text of a motion, by the problem where that is needed.
    motion: Callable[[Motion, Problem | None], str] | None = None
    planar: bool = False  # whether arms that have no robot file can be written


def _alone(write: Callable[[Motion], str]) -> Callable[[Motion, Problem | None], str]:
    """A writer of motions from one that needs no problem."""
    return lambda motion, _problem: write(motion)


FORMATS = {
    "moveit": Format(
        "robot_state.yaml", robot_state_yaml, "robot_trajectory.yaml", _alone(robot_trajectory_yaml)
    ),
    "srdf": Format("group_state.srdf", group_state_srdf),
    "mujoco": Format("keyframe.xml", keyframes_xml),
    "ros": Format(
        "joint_state.yaml",
        joint_state_yaml,
        "trajectory.yaml",
        _alone(joint_trajectory_yaml),
        planar=True,
    ),
    "csv": Format(
        "posture.csv", posture_csv, "trajectory.csv", _alone(trajectory_csv), planar=True
    ),
    "html": Format("posture.html", posture_page, "motion.html", motion_page, planar=True),
}


def export(
    result: Solution | Motion,
    to: str,
    path: str | Path,
    *,
    problem: Problem | None = None,
    case: str | None = None,
) -> None:
    """Write a result's best posture, or a motion, in the format of another program.

    Args:
        result: with ``after``, ``cases`` or ``knots``.
        to: moveit (RobotState or RobotTrajectory), srdf (group_state), mujoco (keyframe), ros
            (JointState or JointTrajectory), csv, or html (a page to look at).
        path: of the file.
        problem: that was solved, which mujoco and html need; else it is read from the file that
            the result names.
        case: whose posture it is, of several; else the first.

    Raises:
        InputError: there is no posture or motion, the format cannot hold it, or the file cannot
            be written.
    """
    write_file(Path(path), exported_text(result, to, problem=problem, case=case).encode())


def exported_text(
    result: Solution | Motion, to: str, *, problem: Problem | None = None, case: str | None = None
) -> str:
    """The text of a result in the format of another program, see `export`."""
    format_ = _format(to)
    if SPACES[result.problem.space].planar and not format_.planar:
        legal = ", ".join(name for name, known in FORMATS.items() if known.planar)
        raise InputError(f"planar arms have no robot file, which {to} is about; allowed: {legal}")
    if isinstance(result, Solution):
        return format_.posture(ExportedPosture.of(result, case, problem))
    if format_.motion is None:
        legal = ", ".join(name for name, known in FORMATS.items() if known.motion)
        raise InputError(f"is a motion, and {to} holds one posture; allowed: {legal}")
    if case is not None:
        raise InputError(f"no case is called {case!r}: a motion has no cases", key="cases")
    return format_.motion(result, problem)


def usual_name(result: Solution | Motion, to: str) -> str:
    """The usual name of a result's file in a format."""
    format_ = _format(to)
    return format_.posture_file if isinstance(result, Solution) else format_.motion_file


def _format(to: str) -> Format:
    if to not in FORMATS:
        raise InputError(f"{to!r} is no format{nearest(to, FORMATS)}")
    return FORMATS[to]
