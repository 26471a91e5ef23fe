"""A result as one page that opens from a file and asks nothing of any network."""

from __future__ import annotations

import contextlib
import html
import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from copose.errors import InputError
from copose.problem import Problem
from copose.results import CasePosture, Motion, Posture, Solution
from copose.robots import Arm, load_arms
from copose.viewer.caption import caption
from copose.viewer.looks import link_looks
from copose.viewer.scene import CellScene
from copose.viewer.server import quiet_server, stop

if TYPE_CHECKING:
    from viser import ViserServer

# Seconds that a motion rests where it begins and where it ends.
_REST = 0.7
# Seconds that a motion is played for, over and over, at least: a page that comes to the end of its
# recording builds the scene anew, which is seen.
_LONG = 30.0
# What lengths of links may differ by from the result's, m.
_SAME = 1e-6


def page_html(
    result: Solution | Motion, problem: Problem, *, posture: Posture | None = None
) -> str:
    """A page of a posture, with the one before as a ghost, or of a motion, which plays in a loop.

    Args:
        result: with ``after``, ``cases`` or ``knots``.
        problem: that was solved.
        posture: which of a solution's; left out, ``after``, or the first case's.

    Raises:
        InputError: there is nothing to show, the problem is not the result's, a robot cannot be
            read, or viser is not installed.
    """
    shown = _postures(result, posture)
    arms = load_arms(problem)
    _check(result, problem, arms, shown[0])
    looks = link_looks(problem, arms)
    with _server() as server:
        scene = CellScene(server.scene, problem, arms, looks)
        # Ellipsoids of a whole motion are drawn at one scale: that of the longest.
        scene.fit(max(shown, key=_longest))
        scene.camera(shown[0]).place(server.initial_camera)
        scene.show(shown[0])
        scene.show_before(_before(result, shown[0]))
        if len(shown) > 1:
            scene.show_path(shown)
        page = server.get_scene_serializer()
        if isinstance(result, Motion) and result.time is not None:
            for now, seconds in _played(shown, result.time):
                scene.show(now)
                page.insert_sleep(seconds)
        text = page.as_html()
    text = re.sub(
        "<title>.*?</title>", lambda _: f"<title>{html.escape(problem.name)}</title>", text, count=1
    )
    body = re.search("<body[^>]*>", text)
    if body is None:
        return text
    return text[: body.end()] + caption(result, shown, scene.slices) + text[body.end() :]


def _played(shown: Sequence[Posture], time: Sequence[float]) -> Iterator[tuple[Posture, float]]:
    """The postures of a motion, over and over, and for how many seconds each is seen."""
    steps = [*np.diff(time).tolist(), _REST]
    steps[0] += _REST
    for _ in range(max(1, round(_LONG / sum(steps)))):
        yield from zip(shown, steps, strict=True)


@contextlib.contextmanager
def _server() -> Iterator[ViserServer]:
    """A server that only this machine reaches, for as long as a page is made."""
    server = quiet_server()
    try:
        yield server
    finally:
        stop(server)


def _postures(result: Solution | Motion, posture: Posture | None) -> Sequence[Posture]:
    """What is shown, in the order of time."""
    if isinstance(result, Motion):
        found: Sequence[Posture] = result.knots or ()
    else:
        found = [each for each in (posture, result.after, *(result.cases or ())) if each][:1]
    if not found:
        why = f": {result.reason}" if result.reason else ""
        raise InputError(f"has nothing to show, it is {result.status}{why}")
    return found


def _before(result: Solution | Motion, shown: Posture) -> Posture | None:
    """The posture that a ghost shows: a motion's first stays where it was."""
    if isinstance(result, Motion):
        return shown
    if isinstance(shown, CasePosture):
        before = [each for each in result.cases_before or () if each.name == shown.name]
        return before[0] if before else None
    return result.before


def _longest(posture: Posture) -> float:
    return (posture.ellipsoid.radii or (0.0,))[0]


def _check(
    result: Solution | Motion, problem: Problem, arms: Sequence[Arm], posture: Posture
) -> None:
    """Refuse a problem that is not the result's."""
    if {arm.name: arm.joint_names for arm in arms} != result.joint_names:
        raise InputError("has other arms or joints than the result", file=problem.source)
    for arm in arms:
        here = np.array([f.position for f in arm.frames(posture.joints[arm.name])])
        there = np.array(posture.arms[arm.name].skeleton)
        if here.shape != there.shape or not np.allclose(_steps(here), _steps(there), 0, _SAME):
            raise InputError(
                f"has arm {arm.name!r} stand otherwise than the result; give the problem as it "
                "was solved, with what --set changed",
                file=problem.source,
            )


def _steps(points: np.ndarray) -> np.ndarray:
    """Distances from frame to frame, (k − 1,)."""
    return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1))
