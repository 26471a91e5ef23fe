"""A result as one page that opens from a file and needs no network."""

from __future__ import annotations

import contextlib
import html
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from copose.errors import InputError
from copose.problem import Problem
from copose.report.look import LOOK, arm_colors
from copose.report.words import (
    evidence_words,
    gain_words,
    has_before,
    objective_name,
    round_scale,
    semi_axis_units,
    short,
    value_words,
)
from copose.results import CasePosture, Motion, Posture, Solution
from copose.robots import Arm, load_arms
from copose.viewer.looks import link_looks
from copose.viewer.nodes.ellipsoids import Slices
from copose.viewer.scene import CellScene
from copose.viewer.server import quiet_server, stop

if TYPE_CHECKING:
    from viser import ViserServer


@dataclass(frozen=True)
class CaptionLook:
    """Styles of a caption, in CSS."""

    block: str = (
        "position:fixed;left:16px;bottom:{};z-index:5;pointer-events:none;max-width:60vw;"
        "font:13px/1.5 system-ui,sans-serif;color:#222;text-shadow:0 0 3px #fff,0 0 3px #fff"
    )
    still: str = "14px"  # distance from the lower edge of the page
    playing: str = "58px"  # the same of a motion, which has a bar below
    swatch: str = (
        "display:inline-block;width:10px;height:10px;border-radius:5px;margin-right:6px;"
        "background:{}"
    )

    def entry(self, color: str, words: str) -> str:
        """A line of a legend."""
        return f'<div><span style="{self.swatch.format(color)}"></span>{html.escape(words)}</div>'


def caption_html(result: Solution | Motion, shown: Sequence[Posture], slices: Slices) -> str:
    """The caption in a corner of a page: its title, the objective, and a legend of the colours."""
    look, moves = CaptionLook(), isinstance(result, Motion)
    title = html.escape(short(result.problem.name, 60))
    lines = [f'<div style="font-weight:600;font-size:15px">{title}</div>']
    words = filter(None, [_value(result, shown), evidence_words(result)])
    lines += [f"<div>{html.escape(line)}</div>" for line in words]
    lines += [look.entry(color, f"arm {name}") for name, color in arm_colors(shown[0]).items()]
    units = dict(zip(("linear", "angular"), semi_axis_units(result), strict=True))
    for kind, scale in slices.scales.items():
        value = round_scale(0.2 / scale)
        size = f"{value * scale:.2g} m drawn = {value:g} {units[kind]}"
        lines.append(look.entry(slices.look.colors[kind], f"{kind} accelerations, {size}"))
    if isinstance(result, Motion) or has_before(result):
        lines.append(look.entry(LOOK.before, "where it begins" if moves else "before"))
    place = look.block.format(look.playing if moves else look.still)
    return f'<div id="copose-caption" style="{place}">{"".join(lines)}</div>'


def _value(result: Solution | Motion, shown: Sequence[Posture]) -> str:
    """The objective's value and its gain."""
    if isinstance(result, Motion):
        seconds = result.time[-1] - result.time[0] if result.time else 0.0
        return f"{objective_name(result)} along the path, {seconds:.3g} s"
    words = value_words(result, shown[0])
    gain = gain_words(result)
    return f"{words}; {gain}" if gain else words


@dataclass(frozen=True)
class ResultPageOptions:
    """Times of a recorded motion, and what problem and result may differ by."""

    rest: float = 0.7  # s, for which a motion rests where it begins and where it ends
    # Shortest recording, s, in which the motion is repeated: at its end a page visibly builds the
    # scene anew.
    least: float = 30.0
    same: float = 1e-6  # m, by which lengths of links may differ from the result's


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
    _check(result, problem, arms, shown[0], ResultPageOptions.same)
    looks = link_looks(problem, arms)
    with _server() as server:
        scene = CellScene(server.scene, problem, arms, looks)
        # Ellipsoids of a whole motion are drawn at one scale: that of the longest.
        scene.fit(max(shown, key=lambda posture: (posture.ellipsoid.radii or (0.0,))[0]))
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
    return text[: body.end()] + caption_html(result, shown, scene.slices) + text[body.end() :]


def _played(shown: Sequence[Posture], time: Sequence[float]) -> Iterator[tuple[Posture, float]]:
    """The postures of a motion, repeated, each with the seconds for which it is seen."""
    steps = [*np.diff(time).tolist(), ResultPageOptions.rest]
    steps[0] += ResultPageOptions.rest
    for _ in range(max(1, round(ResultPageOptions.least / sum(steps)))):
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
    """The postures that are shown, in the order of time."""
    if isinstance(result, Motion):
        shown: Sequence[Posture] = result.knots or ()
    else:
        choices = (posture, result.after, *(result.cases or ()))
        shown = [choice for choice in choices if choice][:1]
    if not shown:
        why = f": {result.reason}" if result.reason else ""
        raise InputError(f"has nothing to show, it is {result.status}{why}")
    return shown


def _before(result: Solution | Motion, shown: Posture) -> Posture | None:
    """The posture that a ghost shows: a motion's first stays where it was."""
    if isinstance(result, Motion):
        return shown
    if isinstance(shown, CasePosture):
        return next((c for c in result.cases_before or () if c.name == shown.name), None)
    return result.before


def _check(
    result: Solution | Motion, problem: Problem, arms: Sequence[Arm], posture: Posture, same: float
) -> None:
    """Refuse a problem that is not the result's."""
    if {arm.name: arm.joint_names for arm in arms} != result.joint_names:
        raise InputError("has other arms or joints than the result", file=problem.source)
    for arm in arms:
        own = np.array([f.position for f in arm.frames(posture.joints[arm.name])])
        stated = np.array(posture.arms[arm.name].skeleton)
        if own.shape != stated.shape or not np.allclose(_steps(own), _steps(stated), 0, same):
            raise InputError(
                f"has arm {arm.name!r} stand otherwise than the result; give the problem as it "
                "was solved, with what --set changed",
                file=problem.source,
            )


def _steps(points: np.ndarray) -> np.ndarray:
    """Distances from frame to frame, (k − 1,)."""
    return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1))
