"""The motion along a path on the page: planned, shown between knots, replanned, saved."""

from __future__ import annotations

import csv
import re
import time
from collections.abc import Iterator
from html import escape
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import copose
import path_problems
from copose.live.page import Page
from copose.live.panels.path_panel import instant, instant_headline, motion_headline
from copose.live.plots.path_figure import motion_svg
from copose.live.problem_file.document import Document
from copose.live.scene.gizmos import Gizmo
from copose.live.session.path_motion import PathMotion
from copose.live.session.session import Session
from copose.loader import parse
from copose.motion.path.object_motion import waypoint_poses
from copose.poses import Pose
from copose.problem import Problem
from object_path import ObjectPath

# Parts of an interval that are looked at.
PARTS = (0.13, 0.5, 0.81)


def problem_of(**changes: object) -> Problem:
    """Two planar arms carry and turn an object, in few knots."""
    return parse(path_problems.hinged(knots=8) | changes, None)


def opened(problem: Problem) -> PathMotion:
    session = Session(Document.of(problem), lambda state: None)
    session.open()
    return PathMotion(session)


@pytest.fixture(scope="module")
def shared() -> PathMotion:
    """A motion that tests only look at."""
    path = opened(problem_of())
    assert path.plan()
    return path


@pytest.fixture
def path(shared: PathMotion) -> PathMotion:
    """A motion that a test may change."""
    session = Session(Document.of(problem_of()), lambda state: None)
    session.open()
    return PathMotion(session, shared.course)


def test_a_session_plans_what_plan_answers(shared: PathMotion) -> None:
    told = copose.plan(problem_of())
    assert shared.course.motion.objective.after == pytest.approx(told.objective.after, abs=1e-9)
    assert shared.course.motion.objective.before == pytest.approx(told.objective.before, abs=1e-9)
    assert shared.message == "" and not shared.stale and not shared.interrupted


def test_between_knots_the_arms_are_on_the_cubic_hermite_curve(shared: PathMotion) -> None:
    motion = shared.course.motion
    knots, times = motion.knots, np.array(motion.time)
    for arm in motion.joint_names:
        curve = CubicHermiteSpline(
            times, [knot.joints[arm] for knot in knots], [knot.velocity[arm] for knot in knots]
        )
        for k in range(len(times) - 1):
            for part in PARTS:
                t = times[k] + part * (times[k + 1] - times[k])
                shown = shared.look(t)
                assert shared.time == t
                np.testing.assert_allclose(shown.joints[arm], curve(t), rtol=0, atol=1e-12)


def test_between_knots_the_object_is_on_its_path_and_the_chain_closed(shared: PathMotion) -> None:
    course = shared.course
    truth = ObjectPath(path_problems.hinged(knots=8), course.duration)
    worst = 0.0
    for t in np.linspace(0.0, course.duration, 24):
        shown = shared.look(float(t))
        there = truth.at(float(t))
        np.testing.assert_allclose(shown.object.position, there.position[:2], atol=1e-9)
        worst = max(worst, *shown.closure_error.values())
    assert 1e-9 < worst <= 1e-4


def test_at_a_knot_the_record_itself_is_shown(shared: PathMotion) -> None:
    motion = shared.course.motion
    for t, knot in zip(motion.time, motion.knots, strict=True):
        assert shared.look(t) is knot
        assert shared.course.value(t) == pytest.approx(knot.objective, abs=1e-12)
    assert shared.look(-1.0) is motion.knots[0]
    assert shared.look(99.0) is motion.knots[-1]


def test_a_waypoint_in_the_hand_is_set_as_by_key(path: PathMotion) -> None:
    session, gizmo = path.session, Gizmo("waypoint", "1")
    where = Pose.from_rpy([0.12, 0.17, 0.0], [0.0, 0.0, 0.5])
    session.mark()
    session.put(gizmo.changes(session.state.problem, where))
    # What it is not turned by is not said.
    assert list(session.changes) == ["path.waypoints.1.position"]
    assert path.stale and "planned anew" in motion_headline(path)
    asked = problem_of(
        path={"waypoints": [{"position": [-0.1, 0.1]}, {"position": [0.12, 0.17], "angle": 0.5}],
              "knots": 8}
    )  # fmt: skip
    assert session.state.problem == asked
    assert path.plan() and not path.stale
    told = copose.plan(asked)
    assert path.course.motion.objective.after == pytest.approx(told.objective.after, abs=1e-9)
    session.undo()
    assert session.state.problem == problem_of() and path.stale


def test_what_a_waypoint_leaves_out_goes_on_being_left_out_until_it_changes() -> None:
    problem, gizmo = problem_of(), Gizmo("waypoint", "0")
    here = waypoint_poses(problem)[0]
    assert gizmo.pose(problem).position.tolist() == [-0.1, 0.1, 0.0]
    assert gizmo.changes(problem, here) == {}
    turned = Pose.from_rpy(here.position, [0.0, 0.0, 0.2])
    assert gizmo.changes(problem, turned) == {"path.waypoints.0.angle": pytest.approx(0.2)}


def test_the_object_may_go_elsewhere_but_where_the_path_begins_with_it(path: PathMotion) -> None:
    path.session.move({"object.position": [0.02, 0.03]})
    assert not path.stale
    # The first waypoint has the object's angle.
    path.session.move({"object.angle": 0.1})
    assert path.stale
    path.session.move({"object.angle": 0.0})
    assert not path.stale
    path.session.change({"objective": {"kind": "isotropy"}})
    assert path.stale


def test_a_path_beyond_reach_says_so_and_the_last_motion_stays(path: PathMotion) -> None:
    last = path.course
    path.session.put({"path.waypoints.1.position": [5.0, 0.2]})
    assert not path.plan()
    assert path.message.startswith("infeasible: ") and "\n" not in path.message
    assert path.message == f"infeasible: {copose.plan(path.session.state.problem).reason}"
    assert path.course is last and path.stale and escape(path.message) in motion_headline(path)
    path.session.put({"path.waypoints.1.position": [0.15, 0.2]})
    assert path.plan() and path.message == ""


def test_a_path_that_cannot_be_asked_for_says_so() -> None:
    path = opened(problem_of(path=path_problems.hinged(knots=8)["path"] | {"closed": True}))
    assert not path.plan()
    assert "ends where it begins" in path.message
    with pytest.raises(copose.InputError, match="ends where it begins"):
        path.look(0.0)
    with pytest.raises(copose.InputError, match="ends where it begins"):
        path.save("motion", Path("nowhere"))


def test_planning_ends_when_it_is_interrupted(path: PathMotion) -> None:
    last, stages = path.course, []

    def told(now: copose.Progress) -> None:
        stages.append(now.stage)
        path.session.interrupt()

    assert not path.plan(told)
    assert path.interrupted and path.message == "planning was interrupted"
    assert stages and path.course is last


def test_files_of_a_motion_hold_it(shared: PathMotion, tmp_path: Path) -> None:
    motion = shared.course.motion
    shared.save("motion", tmp_path / "out")
    assert copose.read_motion(tmp_path / "out" / "result.json") == motion
    with (tmp_path / "out" / "trajectory.csv").open() as file:
        rows = list(csv.reader(file))
    np.testing.assert_allclose(np.array(rows[1:], float)[:, 1:], motion.q, atol=1e-12)
    assert (tmp_path / "out" / "path.png").read_bytes().startswith(b"\x89PNG")
    shared.save("page", tmp_path / "motion.html")
    assert "<html" in (tmp_path / "motion.html").read_text()[:2000].lower()


def test_curves_are_those_of_the_motion(shared: PathMotion) -> None:
    motion = shared.course.motion
    drawn = motion_svg(motion, width=300.0)
    lines = re.findall(r'<polyline points="([^"]+)"', drawn)
    points = [np.array([p.split(",") for p in line.split()], float) for line in lines]
    # Tracking, the plan, and two arms' three joints each.
    assert len(points) == 2 + 6
    x = np.array(motion.time) / motion.time[-1]
    for line in points:
        np.testing.assert_allclose((line[:, 0] - line[0, 0]) / np.ptp(line[:, 0]), x, atol=1e-3)
    # The cursor goes with the share of the duration from the lines' beginning to their end.
    cursor = re.search(r'<line x1="([^"]+)"[^>]*class="copose-cursor"[^>]*\* ([\d.]+)px', drawn)
    left, reach = map(float, cursor.groups())
    assert left == pytest.approx(points[1][0, 0], abs=0.06)
    assert left + reach == pytest.approx(points[1][-1, 0], abs=0.06)
    values = [knot.objective for knot in motion.knots]
    tracked = motion.least_norm.objective
    heights = np.concatenate([points[0][:, 1], points[1][:, 1]])
    # Down the page is up in value, by one scale for both.
    fit = np.polyfit([*tracked, *values], heights, 1)
    assert fit[0] < 0
    np.testing.assert_allclose(np.polyval(fit, [*tracked, *values]), heights, atol=0.06)


def test_the_cursor_and_the_numbers_are_at_the_instant(shared: PathMotion) -> None:
    course = shared.course
    k = 3
    shared.look(course.motion.time[k])
    share = course.motion.time[k] / course.duration
    assert f"--copose-time: {share:.5f}" in instant(shared)
    assert f"<b>{course.motion.knots[k].objective:.6f}</b>" in instant_headline(shared)
    assert f"<b>{course.motion.objective.after:.6f}</b>" in motion_headline(shared)


@pytest.fixture
def page() -> Iterator[Page]:
    page = Page(problem_of(), host="127.0.0.1", port=0)
    page.settle()
    yield page
    page.stop()


def shown_position(page: Page) -> list[float]:
    return list(page.stage.scene.object.position)


def test_the_page_shows_the_motion_or_the_posture(page: Page) -> None:
    # It opens with the motion.
    assert page.path.shown and page.path.motion.course is not None
    assert shown_position(page) == pytest.approx([-0.1, 0.1, 0.0])
    page.path.go(page.path.motion.course.duration)
    page.settle()
    assert shown_position(page) == pytest.approx([0.15, 0.2, 0.0])
    for phase in ("start", "update", "end"):
        page.drag(Gizmo("object"), Pose.from_rpy([0.03, 0.02, 0.0], [0.0, 0.0, 0.0]), phase)
    page.settle()
    assert not page.path.shown
    assert shown_position(page) == pytest.approx([0.03, 0.02, 0.0])
    page.path.go(0.0)
    page.settle()
    assert page.path.shown and shown_position(page) == pytest.approx([-0.1, 0.1, 0.0])
    # A waypoint in the hand leaves the motion where it is.
    for phase in ("start", "update", "end"):
        page.drag(Gizmo("waypoint", "1"), Pose.from_rpy([0.1, 0.2, 0.0], [0.0, 0.0, 0.5]), phase)
    page.settle()
    assert page.path.shown and page.path.motion.stale
    page.undo()
    page.settle()
    assert page.path.shown and not page.path.motion.stale


def test_planning_that_a_hand_interrupts_goes_on_once_it_rests(page: Page) -> None:
    path, stop = page.path, True
    told = path.told

    def interrupt(now: copose.Progress | None) -> None:
        nonlocal stop
        if stop:
            stop = False
            act()
        told(now)

    def drag() -> None:
        page.drag(Gizmo("object"), Pose.from_rpy([0.02, 0.02, 0.0], [0.0, 0.0, 0.0]))

    path.told, last = interrupt, path.motion.course
    act = drag
    path.plan()
    page.settle()
    assert not path.motion.interrupted and path.motion.course is not last
    # Who ends it by the button wants no motion.
    stop, act, last = True, path.plan, path.motion.course
    path.plan()
    page.settle()
    drag()
    page.settle()
    assert path.motion.message == "planning was interrupted" and path.motion.course is last


def test_a_motion_plays_to_its_end_and_stops_for_a_hand(page: Page) -> None:
    path = page.path
    looked: list[float] = []
    look = path.motion.look
    path.motion.look = lambda t: looked.append(t) or look(t)
    path.play()
    page.settle()
    assert path.motion.time == path.motion.course.duration
    assert len(looked) > 3 and looked == sorted(looked)
    path.play()
    while path.motion.time in (0.0, path.motion.course.duration):
        time.sleep(0.01)
    page.drag(Gizmo("object"), Pose.from_rpy([0.02, 0.02, 0.0], [0.0, 0.0, 0.0]))
    page.settle()
    assert not path.shown and path.motion.time < path.motion.course.duration
    assert shown_position(page) == pytest.approx([0.02, 0.02, 0.0])
