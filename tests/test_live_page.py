"""The live page through its handles, without a browser: what its controls lead to is recomputed."""

from __future__ import annotations

import base64
import io
import math
import re
import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("viser")

import copose
from copose.commands.command_line import main
from copose.live import handle
from copose.live.page import Page
from copose.live.scene.gizmos import Gizmo
from copose.poses import Pose

PROBLEMS = Path(__file__).parent.parent / "problems"
PLANAR = PROBLEMS / "paper-fig2.toml"
SPATIAL = PROBLEMS / "two-panda-box.toml"
# How far a value may be from that of `copose.solve`: two searches polish one optimum.
ALIKE = 1e-8


@pytest.fixture(scope="module")
def opened() -> Iterator[Page]:
    page = Page(copose.load(PLANAR), host="127.0.0.1", port=0)
    yield page
    page.stop()


@pytest.fixture
def page(opened: Page) -> Iterator[Page]:
    """The page as it was opened: every test ends with what an undo does."""
    assert opened.settle()
    yield opened
    assert opened.settle()
    while opened.state.undoable:
        opened.undo()
        assert opened.settle()
    assert opened.session.changes == {}


def beside(problem: copose.Problem, dx: float, dy: float = 0.0) -> Pose:
    place = problem.object.pose
    return Pose.make(np.add(place.position, [dx, dy, 0.0]), place.rotation, place.quaternion)


def drag(page: Page, pose: Pose) -> None:
    for phase in ("start", "update", "end"):
        page.drag(Gizmo("object"), pose, phase)
    assert page.settle()


def value(problem: copose.Problem) -> float:
    return copose.solve(problem).objective.after


def evaluated(page: Page) -> float:
    state = page.state
    return copose.evaluate(state.problem, state.solution.after.joints).objective.after


def control(page: Page, label: str) -> Any:
    """A control of the panel by its label; to set its value is what a hand does."""
    return next(each for each in controls(page) if each.label == label)


def controls(page: Page) -> list[Any]:
    """All controls that have a label; viser keeps them where no one else looks."""
    found = page.server.gui._gui_input_handle_from_uuid.values()
    return [each for each in found if hasattr(each, "label")]


def buttons(page: Page) -> list[Any]:
    """The buttons that are seen."""
    return [each for each in controls(page) if hasattr(each, "on_click") and each.visible]


def do(page: Page, label: str, value: object = True) -> None:
    """Set a control, or press a button, and wait for what it leads to."""
    control(page, label).value = value
    assert page.settle()


def live_threads() -> list[str]:
    return [each.name for each in threading.enumerate() if each.name == "copose live"]


def test_a_handle_opens_a_page_and_its_block_ends_it() -> None:
    problem, before = copose.load(PLANAR), live_threads()
    with copose.open_live(problem) as live:
        assert live.address.startswith("http://127.0.0.1:")
        assert live.settle()
        assert live.solution.objective.after == pytest.approx(value(problem), abs=ALIKE)
        assert live._repr_html_().startswith(f'<iframe src="{live.address}"')
        with urllib.request.urlopen(live.address) as answer:
            assert answer.status == 200 and b"<html" in answer.read()
        live.drag({"position": [0.53, 0.48]})
        assert live.settle()
        assert live.problem.object.position == pytest.approx([0.53, 0.48])
        assert live.solution.objective.after == pytest.approx(value(live.problem), abs=ALIKE)
        assert len(live_threads()) == len(before) + 1
    assert live_threads() == before
    with pytest.raises(OSError):
        urllib.request.urlopen(live.address, timeout=5)
    live.stop()


def test_a_page_may_end_while_it_searches() -> None:
    before = live_threads()
    page = Page(copose.load(SPATIAL), host="127.0.0.1", port=0)
    control(page, "Search").value = True
    page.stop()
    assert live_threads() == before


def test_a_drag_and_rest_find_what_solve_finds(page: Page) -> None:
    first = page.state
    drag(page, beside(page.state.problem, 0.06, -0.05))
    assert page.state.searched
    assert page.state.value == pytest.approx(value(page.state.problem), abs=ALIKE)
    assert page.state.value == pytest.approx(evaluated(page), abs=1e-9)
    do(page, "Undo")
    assert page.state.value == first.value
    assert page.state.problem.object.position == (0.5, 0.5)


def test_beyond_reach_is_told_and_undone(page: Page) -> None:
    last = page.state.solution
    drag(page, beside(page.state.problem, 5.0))
    assert not page.state.reached
    assert page.state.solution is last
    assert "arm 'a1' cannot reach its grasp" in page.state.message
    do(page, "Undo")
    assert page.state.reached and not page.state.message


@pytest.mark.parametrize("kind", ["isotropy", "worst-direction", "task-compatibility"])
def test_the_objective_list_leads_to_what_solve_finds(page: Page, kind: str) -> None:
    do(page, "objective", kind)
    along = [0.0, 1.0] if kind == "task-compatibility" else None
    solved = copose.solve(copose.load(PLANAR, objective=kind, direction=along))
    assert page.state.searched and page.state.solution.objective.kind == kind
    assert page.state.value == pytest.approx(solved.objective.after, abs=ALIKE)
    assert page.state.start_value == pytest.approx(solved.objective.before, abs=1e-12)
    assert page.state.value == pytest.approx(evaluated(page), abs=1e-9)
    do(page, "Undo")
    assert control(page, "objective").value == "volume"


def test_direction_sliders_turn_the_direction(page: Page) -> None:
    do(page, "objective", "task-compatibility")
    assert control(page, "azimuth, °").visible
    do(page, "azimuth, °", 30)
    along = [math.cos(math.pi / 6), 0.5]
    problem = copose.load(PLANAR, objective="task-compatibility", direction=along)
    assert page.state.value == pytest.approx(value(problem), abs=ALIKE)
    do(page, "Undo")
    assert control(page, "azimuth, °").value == 90
    assert page.state.problem.objective.kind == "task-compatibility"


def test_a_mass_is_followed_and_undone(page: Page) -> None:
    do(page, "object, kg", 3.0)
    problem = copose.load(PLANAR, set={"object.mass": 3.0})
    assert page.state.value == pytest.approx(value(problem), abs=ALIKE)
    do(page, "Undo")
    assert page.state.problem.object.mass == 0.05
    assert control(page, "object, kg").value == 0.05


def test_a_mass_that_is_being_typed_is_not_taken_away(page: Page) -> None:
    first = page.state
    do(page, "object, kg", 0.0)
    assert control(page, "object, kg").value == 0.0
    assert page.state is first
    do(page, "object, kg", 0.5)
    assert page.state.problem.object.mass == 0.5


@pytest.mark.parametrize("mass", [1e-9, 1e6])
def test_a_page_opens_with_any_mass(mass: float) -> None:
    with copose.open_live(copose.load(PLANAR, set={"object.mass": mass})) as live:
        assert live.state.reached


def test_an_optimum_is_gone_to(page: Page) -> None:
    other = page.state.optima[1]
    do(page, next(b.label for b in buttons(page) if b.label.startswith("2: ")))
    assert page.state.value == pytest.approx(other.objective, abs=1e-9)
    assert page.state.value == pytest.approx(evaluated(page), abs=1e-9)


def test_a_proof_is_shown_with_its_map(page: Page) -> None:
    do(page, "prove")
    do(page, "Search")
    proof = page.state.solution.search.proof
    assert proof.gap <= 1e-6
    shown = page.panel._search._proof.content
    assert proof.statement in shown
    picture = re.search('src="data:image/png;base64,([^"]+)"', shown)
    assert Image.open(io.BytesIO(base64.b64decode(picture[1]))).size == (600, 540)
    do(page, "prove", False)
    do(page, "Search")
    assert page.panel._search._proof.content == ""


def test_a_slider_takes_an_arm_along_its_self_motion(page: Page) -> None:
    first = page.state.solution.after.joints
    do(page, "a1", 0.25)
    joints = page.state.solution.after.joints
    assert joints["a2"] == first["a2"]
    assert np.abs(np.subtract(joints["a1"], first["a1"])).max() > 0.05
    assert page.state.reached
    assert page.state.value == pytest.approx(evaluated(page), abs=1e-9)
    do(page, "Undo")
    assert page.state.solution.after.joints == first


def test_what_no_problem_has_is_told_and_nothing_changes(page: Page) -> None:
    shown = page.state.value
    do(page, "objective", "payload")
    assert "gravity" in page.state.message
    assert page.state.problem.objective.kind == "volume" and page.state.value == shown
    assert control(page, "objective").value == "volume"
    assert not page.state.undoable


def test_files_are_named_as_a_shell_names_them(
    page: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    message = page.state.message
    page.save("result", "~/here.json")
    assert page.settle()
    assert (tmp_path / "here.json").is_file()
    for name in ("", "  ", "a\0b"):
        page.save("result", name)
        assert page.settle()
        assert "is no name of a file" in page.panel._saved.content
    assert page.state.message == message


def test_in_the_plane_a_direction_has_one_angle(page: Page) -> None:
    do(page, "objective", "task-compatibility")
    assert control(page, "azimuth, °").visible and not control(page, "elevation, °").visible


def test_bodies_may_not_touch_once_that_is_asked_for() -> None:
    page = Page(copose.load(SPATIAL), host="127.0.0.1", port=0)
    try:
        assert page.settle()
        do(page, "collision")
        assert page.state.problem.constraints.collision and page.state.searched
        problem = copose.load(SPATIAL, set={"constraints.collision": True})
        assert page.state.value == pytest.approx(value(problem), abs=ALIKE)
        drag(page, beside(page.state.problem, 0.05, 0.02))
        state = page.state
        told = copose.evaluate(state.problem, state.solution.after.joints)
        assert told.status == "solved"
        assert state.value == pytest.approx(told.objective.after, abs=1e-9)
    finally:
        page.stop()


def test_an_infeasible_problem_opens_and_can_be_mended() -> None:
    problem = copose.load(PLANAR, set={"object.position": [9.0, 0.5]})
    with copose.open_live(problem) as live:
        assert live.settle()
        assert live.solution.status == "infeasible" and not live.state.reached
        assert "infeasible" in live.state.message
        live.drag({"position": [0.5, 0.5]})
        assert live.settle()
        assert live.state.reached
        assert live.solution.objective.after == pytest.approx(value(copose.load(PLANAR)), abs=ALIKE)


@pytest.fixture
def taken() -> Iterator[int]:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def test_a_taken_port_is_told_in_one_line(taken: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["live", str(PLANAR), "--no-browser", "--port", str(taken)]) == 2
    out, error = capsys.readouterr()
    assert out == "" and error.count("\n") == 1
    assert f"cannot serve on 127.0.0.1, port {taken}: Address already in use" in error
    with pytest.raises(copose.InputError, match="in use"):
        copose.open_live(copose.load(PLANAR), port=taken)


@pytest.mark.parametrize("name", ["viser", "tomlkit", "fast_simplification"])
def test_a_missing_extra_is_named_in_one_line(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(handle, "find_spec", lambda sought: None if sought == name else sought)
    assert main(["live", str(PLANAR), "--no-browser", "--port", "0"]) == 2
    out, error = capsys.readouterr()
    assert out == "" and error.count("\n") == 1
    assert "pip install 'copose[live]'" in error


def test_an_interrupt_ends_the_command_with_one_line() -> None:
    command = [sys.executable, "-W", "error", "-m", "copose", "live", str(PLANAR), "--no-browser",
               "--port", "0"]  # fmt: skip
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        said = process.stdout.readline()
        address = said.removeprefix("open at ").removesuffix("; ^C ends it\n")
        assert address.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(address) as answer:
            assert answer.status == 200
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=10)
    assert (process.returncode, out) == (130, "")
    assert error == "copose: interrupted: the page is closed\n"


def test_nothing_else_loads_what_the_page_is_made_with() -> None:
    script = (
        "import sys, copose, copose.commands.command_line; "
        "copose.open_live, copose.solve; "
        f"assert copose.commands.command_line.main(['check', {str(PLANAR)!r}]) == 0; "
        "print([m for m in ('viser', 'tomlkit', 'fast_simplification') if m in sys.modules])"
    )
    found = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert found.stdout.endswith("[]\n")
