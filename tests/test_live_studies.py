"""A study on the page: a point is shown as its line and `copose.evaluate` have it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser")

import copose
from browser import Chromium
from copose.batch.run import run_points
from copose.errors import InputError
from copose.live import open_study
from copose.live.page import Page
from copose.live.session.session import Session
from copose.live.studies.study_player import PointChoice, document_at
from copose.live.studies.study_points import Marks, MovedBodies, StudyPoints
from copose.problem import held
from copose.studies.study import Study, StudyFolder
from copose.studies.table import StudyTable
from test_live_browser import Hand, check_arms, controls

PROBLEMS = Path(__file__).parent.parent / "problems"
PLANAR = PROBLEMS / "paper-fig2.toml"
# Five places along x, of which the last is beyond reach, and two masses.
PLACES = """
[[vary]]
key = "object.position.x"
values = [0.3, 0.5, 0.62, 0.7, 3.0]
[[vary]]
key = "object.mass"
values = [0.05, 0.1]
"""
# Points of several structures: kinds, and arms of other lengths.
KINDS = """
[[vary]]
key = "objective.kind"
values = ["volume", "isotropy"]
[[vary]]
keys = ["arms.a1.links.0.length", "object.shape"]
values = [[0.4, { kind = "disk", radius = 0.15 }], [0.5, { kind = "box", size = [0.3, 0.1] }]]
"""
# How far an objective may be from that of its line.
EXACT = 1e-9


def table_of(
    folder: Path, varied: str, problem: Path = PLANAR, record: tuple[str, ...] = (), **keys: object
) -> StudyTable:
    """The table of a study that has run."""
    file = folder / "study.toml"
    more = "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items())
    file.write_text(
        f'format = 1\nname = "points"\nproblem = "{problem}"\neffort = "low"\n'
        f"record = {json.dumps(record)}\n{more}{varied}"
    )
    run_points(Study.read(file), StudyFolder(folder))
    return StudyTable.of(StudyFolder(folder).study(), StudyFolder(folder))


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> StudyTable:
    return table_of(tmp_path_factory.mktemp("places"), PLACES, record=("after.ellipsoid.radii.0",))


@pytest.fixture(scope="module")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> StudyTable:
    return table_of(tmp_path_factory.mktemp("kinds"), KINDS)


def choice_of(table: StudyTable, point: int = 0) -> PointChoice:
    choice = PointChoice(Session(document_at(table, point), lambda state: None), table)
    choice.open(point)
    return choice


def solved(table: StudyTable) -> list[int]:
    return [k for k, status in enumerate(table.statuses) if status == "solved"]


def check_recorded(choice: PointChoice, point: int) -> None:
    """The arms are where the line has them, worth what it says, and so says `copose.evaluate`."""
    state, line = choice.session.state, choice.table.line(point)
    assert state.reached and not state.message and not state.searched
    assert state.origin == f"point {point}" and choice.point == point
    assert {arm: list(q) for arm, q in state.solution.after.joints.items()} == line["joints"]
    assert state.value == pytest.approx(line["objective"], abs=EXACT)
    assert state.start is state.solution.after and state.start_value == state.value
    told = copose.evaluate(state.problem, line["joints"])
    assert told.objective.kind == state.solution.objective.kind
    assert told.objective.after == pytest.approx(line["objective"], abs=EXACT)


def test_a_solved_point_shows_what_its_line_records(places: StudyTable) -> None:
    choice = choice_of(places)
    assert len(solved(places)) == 8
    for point in (*solved(places), *reversed(solved(places))):
        choice.take(point)
        check_recorded(choice, point)
        assert choice.session.state.problem == held(places.study.problems.at(places.values(point)))


def test_nothing_is_searched(places: StudyTable, monkeypatch: pytest.MonkeyPatch) -> None:
    def searched(*_: object, **__: object) -> None:
        raise AssertionError("a search")

    for name in ("solve", "follow"):
        monkeypatch.setattr(copose.posture.Planner, name, searched)
    choice = choice_of(places, 2)
    choice.take(3)
    check_recorded(choice, 3)


def test_at_an_infeasible_point_the_arms_stay(places: StudyTable) -> None:
    choice = choice_of(places, 2)
    before = choice.session.state.solution
    choice.take(8)
    state = choice.session.state
    assert places.statuses[8] == "infeasible" and not state.reached
    assert state.solution is before and "point 8 is infeasible" in state.message
    assert state.problem.object.position == (3.0, 0.5) and not state.origin
    choice.take(1)
    check_recorded(choice, 1)


def test_structures_are_built_as_points_need_them(kinds: StudyTable) -> None:
    choice = choice_of(kinds)
    for point in (3, 0, 1, 2):
        choice.take(point)
        check_recorded(choice, point)
        assert choice.session.state.problem.objective.kind == ("volume", "isotropy")[point // 2]


def test_hands_go_on_from_a_point_and_undo_comes_back(places: StudyTable) -> None:
    choice = choice_of(places, 2)
    session = choice.session
    session.mark()
    choice.take(5)
    session.mark()
    session.move({"object.position": [0.64, 0.5]})
    state = session.state
    assert state.reached and not state.origin and state.problem.object.mass == 0.1
    told = copose.evaluate(state.problem, state.solution.after.joints)
    assert state.value == pytest.approx(told.objective.after, abs=EXACT)
    assert state.start_value == pytest.approx(places.line(5)["objective"], abs=EXACT)
    session.search()
    assert session.state.value >= state.value - EXACT
    session.undo()
    check_recorded(choice, 5)
    session.undo()
    check_recorded(choice, 2)
    assert session.state.problem.object.mass == 0.05


def test_what_may_be_moved_is_where_it_was_found(tmp_path: Path) -> None:
    varied = """
set = ["object.freedom.x=[-0.1, 0.1]", "object.freedom.y=[-0.1, 0.1]"]
[[vary]]
key = "arms.a2.base.position.x"
values = [0.9, 1.0]
"""
    table = table_of(tmp_path, varied)
    choice = choice_of(table)
    for point in (0, 1):
        choice.take(point)
        check_recorded(choice, point)
        moved = choice.session.state.problem.object.position
        assert moved == tuple(table.line(point)["placement"]["object.position"]) != (0.5, 0.5)


def test_of_cases_the_one_that_is_shown_has_its_joints(tmp_path: Path) -> None:
    source = tmp_path / "cases.toml"
    cases = (
        '[[cases]]\nname = "low"\nposition = [0.5, 0.45]\n[[cases]]\nname = "high"\nmass = 0.1\n'
    )
    source.write_text(PLANAR.read_text() + cases)
    table = table_of(tmp_path, '[[vary]]\nkey = "object.mass"\nvalues = [0.05, 0.07]', source)
    choice, line = choice_of(table), table.line(1)
    for case, place in (("low", (0.5, 0.45)), ("high", (0.5, 0.5))):
        choice.take(1, case)
        state = choice.session.state
        assert choice.session.document.case == case and state.problem.object.position == place
        joints = {arm: list(q) for arm, q in state.solution.after.joints.items()}
        assert state.reached and joints == line["joints"][case]


def test_a_point_that_is_not_there_is_refused(places: StudyTable) -> None:
    choice = choice_of(places, 2)
    before = choice.session.state
    for point in (-1, 10):
        with pytest.raises(InputError, match=f"no point {point}"):
            choice.take(point)
    assert choice.session.state is before


@pytest.mark.parametrize(
    ("key", "value", "body"),
    [
        ("object.position.x", 0.7, "object"),
        ("object.position.1", 0.7, "object"),
        ("object.position", [0.1, 0.2, 0.3], "object"),
        ("arms.right.base.position.z", 0.7, "base of right"),
        ("arms.left.base.position", [0.1, 0.2, 0.3], "base of left"),
        ("arms.left.base", {"position": [0.1, 0.2, 0.3], "rpy": [0, 0, 1]}, "base of left"),
        ("arms.left.base", {"rpy": [0, 0, 1]}, "base of left"),
        ("object.mass", 3.0, None),
        ("arms.left.base.rpy.z", 3.0, None),
        ("arms.left.grasp.position.x", -0.2, None),
        ("objective.kind", "isotropy", None),
        ("constraints.collision", True, None),
    ],
)
def test_bodies_stand_where_problems_have_them(key: str, value: Any, body: str | None) -> None:
    from copose.problem import overridden, parse, read_tables

    file = PROBLEMS / "two-panda-box.toml"
    tables = read_tables(file)
    bodies = MovedBodies(tables, [key])
    assert bodies.names == (() if body is None else (body,))
    if body is None:
        return
    problem = parse(overridden(tables, {key: value}), file)
    poses = {f"base of {arm.name}": arm.base.pose for arm in problem.arms}
    truth = {"object": problem.object.pose, **poses}[body].position
    np.testing.assert_allclose(bodies.positions(body, {key: [value, value]}), [truth, truth])


def test_of_two_keys_the_later_one_counts() -> None:
    from copose.problem import read_tables

    tables = read_tables(PLANAR)
    x, whole = "object.position.x", "object.position"
    columns = {x: [0.1, 0.2], whole: [[1.0, 2.0], [3.0, 4.0]]}
    told = MovedBodies(tables, [x, whole]).positions("object", columns)
    np.testing.assert_array_equal(told, [[1, 2, 0], [3, 4, 0]])
    told = MovedBodies(tables, [whole, x]).positions("object", columns)
    np.testing.assert_array_equal(told, [[0.1, 2, 0], [0.2, 4, 0]])


def test_at_one_place_stands_the_best_point(places: StudyTable) -> None:
    points = StudyPoints(places, "objective")
    marks = points.marks("object")
    np.testing.assert_array_equal(marks.places[:, 0], [0.3, 0.5, 0.62, 0.7, 3.0])
    assert (marks.places[:, 1:] == [0.5, 0.0]).all()
    lines = [places.line(k) for k in range(10)]
    for k, point in enumerate(marks.points[:4].tolist()):
        values = {j: lines[j]["objective"] for j in (2 * k, 2 * k + 1)}
        assert point == max(values, key=values.get)
        assert marks.here(point) == sorted(values, key=values.get, reverse=True)
    values = [lines[point]["objective"] for point in points.ranking]
    assert values == sorted(values, reverse=True) and len(values) == 8
    assert points.rank(8) is None and points.rank(int(points.ranking[3])) == 3
    other = points.by("after.ellipsoid.radii.0")
    radii = [lines[point]["record"]["after.ellipsoid.radii.0"] for point in other.ranking]
    assert radii == sorted(radii, reverse=True)
    assert points.seen(np.arange(10), "all").all() and not points.seen(np.arange(10), "none").any()
    assert points.seen(np.arange(10), "solved").tolist() == [True] * 8 + [False] * 2
    assert np.flatnonzero(points.seen(np.arange(10), "best tenth")).tolist() == [points.ranking[0]]


def test_a_ray_hits_the_nearest_mark_that_is_shown() -> None:
    places = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0.5, 0], [-1.0, 0, 0]])
    numbers = np.array([7, 3, 5, 9])
    marks, along = Marks(places, numbers, numbers, np.arange(4)), np.array([1.0, 0, 0])
    shown = np.ones(4, dtype=bool)
    eye = np.array([-0.5, 0.01, 0])
    assert marks.hit(eye, along, 0.02, shown) == 7
    assert marks.hit(eye, along, 0.02, shown & (numbers != 7)) == 3
    assert marks.hit(eye, -along, 0.02, shown) == 9
    # Beside the nearer mark by 0.02 rad, beside the farther one by 0.0067.
    assert marks.hit(eye, along, 0.001, shown) == 3
    assert marks.hit(eye, np.array([0.0, 0, 1]), 0.02, shown) is None


@pytest.fixture
def page(places: StudyTable) -> Iterator[Page]:
    page = Page(places, host="127.0.0.1", port=0)
    assert page.settle()
    yield page
    page.stop()


def control(page: Page, label: str) -> Any:
    """A control by its label; to set its value is what a hand does."""
    return next(each for each in controls(page) if each.label == label)


def do(page: Page, label: str, value: object) -> None:
    control(page, label).value = value
    assert page.settle()


def panel_text(page: Page) -> str:
    """All HTML of the panels."""
    handles = page.server.gui._gui_input_handle_from_uuid.values()
    return "".join(each.content for each in handles if hasattr(each, "content"))


def test_the_panel_goes_through_the_ranking(page: Page, places: StudyTable) -> None:
    best = places.best(8)
    assert page.study.choice.point == best[0]
    do(page, "best → worst", 4)
    check_recorded(page.study.choice, best[3])
    assert page.state.undoable
    for word, rank in (("Next", 4), ("Next", 5), ("Previous", 4), ("Best", 0), ("Previous", 0)):
        do(page, "", word)
        assert page.study.choice.point == best[rank]
        assert control(page, "best → worst").value == rank + 1
    do(page, "point", 9)
    assert page.study.choice.point == 9 and not page.state.reached
    assert control(page, "at this place").value == 2
    do(page, "at this place", 1)
    assert page.study.choice.point == 8
    do(page, "", "Best")
    check_recorded(page.study.choice, best[0])


def test_the_panel_ranks_by_what_was_recorded(page: Page, places: StudyTable) -> None:
    name = "after.ellipsoid.radii.0"
    do(page, "value", name)
    do(page, "best → worst", 2)
    assert page.study.choice.point == places.best(2, name)[1]
    check_recorded(page.study.choice, places.best(2, name)[1])


def nodes(page: Page) -> set[str]:
    scene = page.server.scene
    names = ("solved", "infeasible", "failed")
    return {name for name in names if scene.get_handle_by_name(f"/study/{name}") is not None}


def test_the_scene_shows_parts_of_the_points(page: Page, places: StudyTable) -> None:
    assert nodes(page) == {"solved", "infeasible"}
    cloud = page.server.scene.get_handle_by_name("/study/solved")
    np.testing.assert_allclose(cloud.points[:, 0], [0.3, 0.5, 0.62, 0.7], atol=1e-6)
    best = page.study.points.marks("object").points[:4].tolist().index(places.best(1)[0])
    # Viridis ends in yellow.
    assert cloud.colors[best].tolist() == [253, 231, 37]
    for part, shown in (("solved", {"solved"}), ("none", set()), ("all", {"solved", "infeasible"})):
        do(page, "in the scene", part)
        assert nodes(page) == shown


def test_the_first_view_shows_all_points(page: Page) -> None:
    camera, places = page.server.initial_camera, page.study.places
    toward = np.subtract(camera.look_at, camera.position)
    depth = (places - camera.position) @ toward / np.linalg.norm(toward)
    right = np.cross(toward / np.linalg.norm(toward), camera.up)
    for axis in (right, camera.up):
        # Seen from above the plane's y is up; a scene between two panels is higher than wide.
        aside = np.abs((places - camera.position) @ axis)
        assert (aside <= depth * np.tan(camera.fov / 2)).all()


def test_a_page_of_other_arms_is_built_anew(kinds: StudyTable) -> None:
    with open_study(kinds) as live:
        page = live._page
        for point in (0, 3, 1, 2):
            live.show_point(point)
            assert live.settle()
            check_recorded(page.study.choice, point)
            assert page.stage.scene._problem.object.shape == live.problem.object.shape
            assert control(page, "objective").value == live.problem.objective.kind
            # One panel and no more.
            assert [each.label for each in controls(page)].count("Undo") == 1
        page.undo()
        assert live.settle()
        live.drag({"position": [0.52, 0.5]})
        assert live.settle() and live.state.reached and live.state.searched


def test_the_list_has_the_objectives_of_all_points(tmp_path: Path) -> None:
    varied = """
set = ["arms.a1.torque_limits=[2, 2, 2]", "arms.a2.torque_limits=[2, 2, 2]"]
[[vary]]
keys = ["objective.kind", "world.gravity"]
values = [["volume", [0, 0]], ["payload", [0, -9.81]]]
"""
    with open_study(table_of(tmp_path, varied)) as live:
        kind = control(live._page, "objective")
        assert live.problem.objective.kind == "volume" and "payload" not in kind.options
        live.show_point(1)
        assert live.settle()
        check_recorded(live._page.study.choice, 1)
        assert kind.value == "payload" and "payload" in kind.options


def test_without_solved_points_the_page_opens_with_the_nearest_miss(tmp_path: Path) -> None:
    table = table_of(tmp_path, '[[vary]]\nkey = "object.position.x"\nvalues = [3.0, 4.0]')
    with open_study(table) as live:
        assert live.settle()
        assert not live.state.reached and "cannot reach" in live.state.message


def test_a_study_that_has_not_run_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    file.write_text(f'format = 1\nname = "p"\nproblem = "{PLANAR}"\n{PLACES}')
    table = StudyTable.of(Study.read(file), StudyFolder(tmp_path))
    with pytest.raises(InputError, match="no point is done yet"):
        open_study(table)


def test_a_click_on_a_point_takes_the_arms_there(
    chromium: Chromium, page: Page, places: StudyTable
) -> None:
    with chromium.view((1200, 700)) as view:
        hand = Hand(page, view)
        hand.open("/study/solved", "/study/infeasible")
        # A click where the object stands would be on it.
        page.show_point(
            next(k for k in solved(places) if places.values(k)["object.position.x"] == 0.5)
        )
        hand.settle()
        for x in (0.3, 0.7):
            point = max(
                (k for k in solved(places) if places.values(k)["object.position.x"] == x),
                key=lambda k: places.numbers["objective"][k],
            )
            view.page.mouse.click(*view.pixel([x, 0.5, 0.0]))
            view.until(
                "words => document.getElementById('study-point')?.innerText.startsWith(words)",
                f"point {point},",
            )
            hand.settle()
            check_recorded(page.study.choice, point)
            assert float(hand.text("now")) == pytest.approx(page.state.value, abs=1e-6)
            check_arms(hand)
        value = page.state.value
        hand.drag(-0.06)
        assert page.state.problem.object.position[0] < 0.68 and page.state.value != value
        check_arms(hand)
        assert view.foreign == [] and view.errors == []
