"""The page's problem and posture without a page: what a hand moves, changes and undoes."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

import copose
from copose.live.panels import objectives as aims
from copose.live.problem_file.document import Document, key
from copose.live.scene.gizmos import Gizmo, robot_mates
from copose.live.session.session import Session
from copose.live.session.state import SearchAim as Aim
from copose.live.session.state import State
from copose.live.worker import Worker
from copose.poses import Pose
from copose.posture import Planner

PROBLEMS = Path(__file__).parent.parent / "problems"
PLANAR = PROBLEMS / "paper-fig2.toml"


def session_of(file: Path, **changes: object) -> tuple[Session, list[State]]:
    states: list[State] = []
    session = Session(Document.of(copose.load(file, set=changes)), states.append)
    session.open()
    return session, states


@pytest.fixture
def planar() -> Session:
    return session_of(PLANAR)[0]


def moved(session: Session, dx: float, dy: float = 0.0) -> dict[str, object]:
    x, y = session.document.problem({}).object.position
    return {"object.position": [x + dx, y + dy]}


def test_the_page_opens_with_the_answer_of_a_search(planar: Session) -> None:
    solved = copose.solve(copose.load(PLANAR))
    assert planar.state.value == pytest.approx(solved.objective.after, abs=1e-9)
    assert planar.state.start_value == pytest.approx(solved.objective.before, abs=1e-9)
    assert planar.state.reached and planar.state.searched and not planar.state.undoable
    values = [optimum.objective for optimum in planar.state.optima]
    assert values == sorted(values, reverse=True)
    assert values[0] == pytest.approx(planar.state.value, abs=1e-9)


def test_arms_follow_the_object_and_hold_it(planar: Session) -> None:
    for k in range(1, 6):
        planar.move(moved(planar, 0.01 * k))
        state = planar.state
        assert state.reached and not state.searched
        told = copose.evaluate(state.problem, state.solution.after.joints)
        assert told.status == "solved"
        assert state.value == pytest.approx(told.objective.after, abs=1e-9)
        assert state.problem.object.position[0] == pytest.approx(
            moved(planar, 0.01 * k)["object.position"][0]
        )


def test_a_search_where_the_hand_rests_finds_what_solve_finds(planar: Session) -> None:
    planar.move(moved(planar, 0.05, -0.04))
    planar.search()
    solved = copose.solve(planar.state.problem)
    assert planar.state.searched
    assert planar.state.value == pytest.approx(solved.objective.after, abs=1e-8)


def test_beyond_reach_the_last_posture_stays(planar: Session) -> None:
    planar.move(moved(planar, 0.02))
    last = planar.state.solution
    planar.move(moved(planar, 5.0))
    assert not planar.state.reached
    assert planar.state.solution is last
    assert "arm 'a1' misses its grasp by" in planar.state.message
    planar.search()
    assert planar.state.message.startswith("infeasible: arm 'a1' cannot reach its grasp")
    assert planar.state.solution is last
    planar.move(moved(planar, 0.02))
    assert planar.state.reached and planar.state.message == ""


def test_undo_goes_back_step_by_step(planar: Session) -> None:
    first = planar.state
    planar.mark()
    planar.move(moved(planar, 0.03))
    second = planar.state
    planar.change({"objective": aims.objective_table(planar.state.problem, "isotropy")})
    assert planar.state.solution.objective.kind == "isotropy"
    planar.undo()
    assert planar.state.value == second.value and planar.state.undoable
    assert planar.state.problem.objective.kind == "volume"
    planar.undo()
    assert planar.state.value == first.value and not planar.state.undoable
    planar.undo()
    assert planar.changes == {}


def test_the_start_is_measured_by_what_counts_now(planar: Session) -> None:
    start = planar.state.start.joints
    for kind in ("isotropy", "worst-direction", "force-volume"):
        planar.move(moved(planar, 0.02))
        planar.change({"objective": aims.objective_table(planar.state.problem, kind)})
        told = copose.evaluate(copose.load(PLANAR, objective=kind), start)
        assert planar.state.start_value == pytest.approx(told.objective.after, abs=1e-12)
        solved = copose.solve(planar.state.problem)
        assert planar.state.value == pytest.approx(solved.objective.after, abs=1e-8)


def test_what_no_problem_has_changes_nothing(planar: Session) -> None:
    before, value = planar.changes, planar.state.value
    with pytest.raises(copose.InputError, match="gravity"):
        planar.change({"objective": {"kind": "payload"}})
    with pytest.raises(copose.InputError):
        planar.change({"object.mass": -1.0})
    assert planar.changes == before and planar.state.value == value and not planar.state.undoable
    assert planar.state.problem.objective.kind == "volume"


def test_what_was_refused_is_told_until_something_is_done(planar: Session) -> None:
    planar.move(moved(planar, 0.02))
    planar.fail("refused")
    planar.search()
    assert planar.state.searched and planar.state.message == "refused"
    planar.mark()
    planar.move(moved(planar, 0.03))
    assert not planar.state.message
    planar.undo()
    assert planar.state.searched and not planar.state.message


def test_where_nothing_holds_the_values_are_of_one_objective(planar: Session) -> None:
    now, start = planar.state.value, planar.state.start_value
    planar.move(moved(planar, 5.0))
    planar.change({"objective": aims.objective_table(planar.state.problem, "isotropy")})
    planar.move({"object.mass": 3.0})
    assert not planar.state.reached
    assert planar.state.solution.objective.kind == "volume"
    assert (planar.state.value, planar.state.start_value) == (now, start)
    planar.move(moved(planar, 0.0))
    problem = copose.load(PLANAR, objective="isotropy", set={"object.mass": 3.0})
    told = copose.evaluate(problem, planar.state.start.joints)
    assert planar.state.solution.objective.kind == "isotropy"
    assert planar.state.start_value == pytest.approx(told.objective.after, abs=1e-12)


@pytest.mark.parametrize("broken", ["follow", "solve"])
def test_what_is_refused_late_changes_nothing(
    planar: Session, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    before = planar.state

    def refuse(*_: object, **__: object) -> None:
        raise copose.InputError("refused")

    monkeypatch.setattr(Planner, broken, refuse)
    with pytest.raises(copose.InputError):
        planar.change({"object.mass": 3.0})
    assert planar.state.problem == before.problem and planar.state.solution is before.solution
    assert planar.changes == {} and not planar.state.undoable
    monkeypatch.setattr(Planner, "follow", refuse)
    with pytest.raises(copose.InputError):
        planar.move({"object.mass": 3.0})
    assert planar.changes == {}


def test_an_optimum_is_gone_to_and_left_alone(planar: Session) -> None:
    other = planar.state.optima[1]
    planar.choose(other.joints)
    assert planar.state.value == pytest.approx(other.objective, abs=1e-9)
    assert not planar.state.searched
    planar.search(Aim("low", 1))
    assert planar.state.value > other.objective


def test_bases_and_grasps_follow_the_hand(planar: Session) -> None:
    arm = planar.state.problem.arms[1]
    x, y = arm.base.position
    planar.move({key("arms", arm.name, "base"): {"position": [x + 0.02, y], "angle": 0.0}})
    assert planar.state.reached
    assert planar.state.solution.after.arms[arm.name].skeleton[0][0] == pytest.approx(x + 0.02)
    told = copose.evaluate(planar.state.problem, planar.state.solution.after.joints)
    assert planar.state.value == pytest.approx(told.objective.after, abs=1e-9)


def test_numbers_of_the_aim_are_followed() -> None:
    file = PROBLEMS / "paper-fig2.toml"
    session, _ = session_of(file)
    session.change({"objective": aims.objective_table(session.state.problem, "task-compatibility")})
    planners = list(session._planners)
    for azimuth in (0.0, 30.0, 120.0):
        along = aims.pointing(["x", "y"], "linear", azimuth, 0.0)
        table = aims.objective_table(session.state.problem, "task-compatibility", along)
        session.move({"objective": table, "object.mass": 1.0 + azimuth / 100})
        told = copose.evaluate(session.state.problem, session.state.solution.after.joints)
        assert session.state.value == pytest.approx(told.objective.after, abs=1e-9)
    session.search()
    assert all(planner in planners for planner in session._planners)


def test_one_direction_takes_the_place_of_two() -> None:
    both = [{"direction": [1.0, 0.0]}, {"direction": [0.0, 1.0]}]
    session, _ = session_of(PLANAR, objective={"kind": "task-compatibility", "directions": both})
    table = aims.objective_table(session.state.problem, "task-compatibility", [1.0, 0.0])
    session.move({"objective": table})
    problem = copose.load(PLANAR, objective="task-compatibility", direction=[1.0, 0.0])
    told = copose.evaluate(problem, session.state.solution.after.joints)
    assert session.state.value == pytest.approx(told.objective.after, abs=1e-9)
    told = copose.evaluate(problem, session.state.start.joints)
    assert session.state.start_value == pytest.approx(told.objective.after, abs=1e-12)


def test_an_infeasible_problem_opens_too() -> None:
    session, _ = session_of(PLANAR, **{"object.position": [9.0, 0.0]})
    assert not session.state.reached
    assert session.state.posture is session.state.solution.nearest_miss
    assert session.state.message.startswith("infeasible")
    session.move({"object.position": list(copose.load(PLANAR).object.position)})
    session.search()
    assert session.state.reached and session.state.value is not None
    start = session.state.start.joints
    told = copose.evaluate(copose.load(PLANAR), start)
    assert told.status == "solved"
    assert session.state.start_value == pytest.approx(told.objective.after, abs=1e-12)
    session.change({"object.mass": 0.5})
    told = copose.evaluate(copose.load(PLANAR, set={"object.mass": 0.5}), start)
    assert session.state.start_value == pytest.approx(told.objective.after, abs=1e-12)


def test_free_cells_are_shown_where_the_file_has_them() -> None:
    session, _ = session_of(PROBLEMS / "panda-second-base.toml")
    assert (
        session.state.problem.arms[1].base
        == copose.load(PROBLEMS / "panda-second-base.toml").arms[1].base
    )
    assert not any(arm.freedom.base.ranges for arm in session.state.problem.arms)


def test_a_case_is_a_task_of_its_own() -> None:
    file = PROBLEMS / "panda-three-cases.toml"
    cases = copose.load(file).cases
    session, _ = session_of(file)
    assert session.state.problem.cases == ()
    assert session.state.problem.object.position == cases[0].position
    x, y, z = cases[0].position
    session.move({"object.position": [x, y + 0.01, z]})
    assert session.state.problem.object.position == (x, y + 0.01, z)
    session.pick(cases[2].name)
    assert session.state.problem.object.position == cases[2].position
    solved = copose.solve(session.state.problem)
    assert session.state.value == pytest.approx(solved.objective.after, abs=1e-8)


def test_the_arms_of_one_robot_move_with_one_base() -> None:
    baxter = copose.load(PROBLEMS / "baxter-box.toml")
    names = tuple(arm.name for arm in baxter.arms)
    assert robot_mates(baxter, names[0]) == names
    changes = Gizmo("base", names[0]).changes(baxter, Pose.from_rpy((0.1, 0.2, 0.0)))
    assert list(changes) == [f"arms.{name}.base" for name in names]
    apart = copose.load(PROBLEMS / "two-panda-box.toml")
    assert robot_mates(apart, "right") == ("right",)


def test_a_grasp_is_dragged_in_the_world_and_kept_in_the_object() -> None:
    problem = copose.load(PROBLEMS / "two-panda-box.toml", set={"object.rpy": [0.1, 0.2, 0.3]})
    gizmo = Gizmo("grasp", "left")
    changed = copose.load(problem.source, set={
        "object.rpy": [0.1, 0.2, 0.3], **gizmo.changes(problem, gizmo.pose(problem))
    })  # fmt: skip
    for was, now in zip(problem.arms, changed.arms, strict=True):
        np.testing.assert_allclose(now.grasp.pose.rotation, was.grasp.pose.rotation, atol=1e-12)
        np.testing.assert_allclose(now.grasp.position, was.grasp.position, atol=1e-12)


@pytest.mark.parametrize(
    ("names", "direction"),
    [
        (("x", "y", "z", "roll", "pitch", "yaw"), (0.6, 0.0, 0.8, 0.0, 0.0, 0.0)),
        (("x", "y", "z", "roll", "pitch", "yaw"), (0.0, 0.0, 0.0, 0.0, -1.0, 0.0)),
        (("x", "y", "angle"), (0.0, 1.0, 0.0)),
        (("z",), (-1.0,)),
    ],
)
def test_angles_give_back_a_direction(names: tuple[str, ...], direction: tuple[float, ...]) -> None:
    np.testing.assert_allclose(aims.pointing(names, *aims.angles(names, direction)), direction,
                               atol=1e-12)  # fmt: skip


def test_of_moves_the_newest_counts_and_all_else_waits_its_turn() -> None:
    done: list[object] = []
    gate, rested = threading.Event(), threading.Event()
    worker = Worker(rested.set, done.append, rest_s=0.01)
    worker.do(lambda: gate.wait(10))
    for k in range(100):
        worker.move(lambda k=k: done.append(k))
    worker.do(lambda: done.append("task"))
    worker.move(lambda: done.append("last"))
    gate.set()
    assert worker.settle(10)
    assert done == [99, "task", "last"]
    assert rested.is_set()
    worker.do(lambda: 1 / 0)
    assert worker.settle(10)
    assert isinstance(done[-1], ZeroDivisionError)
    worker.end()


def test_a_worker_goes_on_where_its_failure_cannot_be_told(
    capsys: pytest.CaptureFixture[str],
) -> None:
    done: list[object] = []

    def failed(error: Exception) -> None:
        raise RuntimeError("nowhere to tell it")

    worker = Worker(lambda: None, failed)
    worker.do(lambda: 1 / 0)
    worker.do(lambda: done.append("next"))
    assert worker.settle(10)
    worker.end()
    assert done == ["next"]
    assert "nowhere to tell it" in capsys.readouterr().err


def test_a_search_makes_way_for_the_hand() -> None:
    session, _states = session_of(PROBLEMS / "paper-fig2.toml")
    session.told = lambda state: None
    value = session.state.value
    session.search(None, lambda now: session.interrupt())
    assert session.state.value == value


def test_only_objectives_that_the_problem_can_have_are_offered() -> None:
    """Each that is offered can be solved for, each that is not is refused."""
    for file, expected in ((PLANAR, 6), (PROBLEMS / "two-panda-box.toml", 8)):
        session, _ = session_of(file)
        problem = session.state.problem
        kinds = aims.offered(session.document, session.state.solution)
        assert len(kinds) == expected
        for kind in aims.KINDS:
            table = {"objective": aims.objective_table(problem, kind)}
            if kind in kinds:
                copose.Planner(session.document.problem(table))
            else:
                with pytest.raises(copose.InputError):
                    copose.Planner(session.document.problem(table))


def test_a_kind_that_comes_back_has_its_directions_and_weights() -> None:
    opened = copose.load(PROBLEMS / "push-x.toml")
    table = aims.objective_of_kind(opened, opened, opened.objective.kind)
    other = copose.load(PROBLEMS / "push-x.toml", set={"objective": {"kind": "volume"}})
    back = Document.of(other).problem({"objective": table})
    assert back.objective == opened.objective
    assert aims.objective_of_kind(opened, opened, "isotropy")["kind"] == "isotropy"


def test_optima_of_another_place_are_not_offered(planar: Session) -> None:
    assert planar.state.optima
    planar.move(moved(planar, 0.01))
    assert planar.state.optima == ()
    planar.search()
    assert planar.state.optima


def test_a_search_that_finds_nothing_better_moves_no_arm(planar: Session) -> None:
    shown = planar.state.solution
    planar.search()
    assert planar.state.solution is shown and planar.state.searched
