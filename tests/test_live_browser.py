"""The live page in a browser: what a mouse does, what is drawn, what the panel says.

Truth is what `copose.solve` and `copose.evaluate` say of the problem that is shown, and elementary
sums over links.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

pytest.importorskip("viser")

import copose
import reference
from browser import Chromium, View
from copose.live.page import Page
from copose.live.scene.gizmos import Gizmo
from copose.poses import Pose
from copose.report.look import LOOK
from copose.viewer.names import rgb

PROBLEMS = Path(__file__).parent.parent / "problems"
PLANAR = PROBLEMS / "paper-fig2.toml"
SPATIAL = PROBLEMS / "two-panda-box.toml"
# Size of the browser's window, pixels.
SIZE = (700, 420)
# Values are shown with so many digits behind the point.
SHOWN = 1e-6
# Of a mesh of the scene its colour, 0 to 255.
_COLOR = """name => window.__viserSceneTree.getState()[name].message.props.color"""
# The numbers beside the joints' bars, from top to bottom.
_BARS = """() => [...document.querySelectorAll(".copose-joint")]
  .map(row => Number(row.children[2].innerText))"""


@dataclass(frozen=True)
class Hand:
    """A page, a browser's view of it, and what a hand does there.

    Attributes:
        page: the page.
        view: of it.
        ends: what Python has heard of gizmos that were let go.
    """

    page: Page
    view: View
    ends: list[object] = field(default_factory=list)

    def open(self, *nodes: str) -> None:
        """Open the page, and hide what viser says about slow drawing: it covers the scene."""
        self.view.open(self.page.address, "/object", "/drag/object", *nodes)
        self.view.page.add_style_tag(content=".mantine-Notifications-root {display: none}")

        @self.gizmo.on_update
        async def _(event: Any) -> None:
            if event.phase == "end":
                self.ends.append(event)

        self.settle()

    @property
    def gizmo(self) -> Any:
        """What drags the object; viser keeps it where no one else looks."""
        return self.page.server.scene._handle_from_transform_controls_name["/drag/object"]

    def text(self, name: str) -> str:
        """What the panel says at one of its places: now, start, gain or message."""
        found = f"() => document.getElementById('copose-{name}')?.innerText ?? ''"
        return self.view.page.evaluate(found)

    def until(self, name: str, words: str) -> None:
        """Wait until the panel says these words."""
        self.view.until(
            "([id, words]) => document.getElementById(id)?.innerText.includes(words)",
            [f"copose-{name}", words],
        )

    def click(self, locator: Any) -> None:
        """Click where something is; under software rendering nothing ever counts as stable."""
        locator.wait_for(state="visible")
        locator.evaluate("node => node.scrollIntoView({block: 'center'})")
        box = locator.bounding_box()
        self.view.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)

    def tab(self, name: str) -> None:
        """Turn to a tab of the panel."""
        self.click(self.view.page.get_by_role("tab", name=name, exact=True))

    def press(self, name: str) -> None:
        """Press a button of the panel."""
        self.click(self.view.page.get_by_role("button", name=name))

    def save(self, kind: str, offered: str, file: Path, told: str = "written to") -> None:
        """Save a file under another name than the one that is offered."""
        self.view.page.locator(f'input[value="{offered}"]').fill(str(file))
        # Text goes to Python once it has been left alone for a moment.
        name = next(each for each in controls(self.page) if each.label == kind)
        self.view.eventually(lambda: name.value == str(file))
        self.press(f"Save {kind}")
        for words in (str(file), told):
            self.view.until("words => document.body.innerText.includes(words)", words)

    def color(self) -> tuple[int, ...]:
        """The object's, 0 to 255."""
        return tuple(self.view.page.evaluate(_COLOR, "/object/shape"))

    def drag(self, dx: float, dy: float = 0.0) -> None:
        """Drag the object along x or y by its gizmo's arrow, and wait until all is at rest."""
        self.pull(np.array([dx, dy, 0.0]))
        self.settle()

    def pull(self, way: np.ndarray) -> None:
        """Drag the object by the arrow of one axis, until Python has heard of it."""
        heard = len(self.ends)
        grip = self.page.state.problem.object.pose.position
        grip = grip + 0.8 * self.gizmo.scale * (way != 0)
        self.view.drag(self.view.pixel(grip), self.view.pixel(grip + way), 3)
        self.view.eventually(lambda: len(self.ends) > heard, 15.0)

    def settle(self) -> None:
        """Wait until the page is at rest, and the browser shows it."""
        assert self.page.settle()
        state = self.page.state
        self.until("now", f"{state.value:.6f}")
        self.view.draw()

    def drawn(self, arm: str) -> np.ndarray:
        """Where the browser draws an arm's joints and its tip, x and y, (n + 1, 2)."""
        n = len(self.page.state.solution.after.joints[arm])
        names = [*(f"joint{j + 1}" for j in range(n)), "tip"]
        return np.array([self.view.pose(f"/arms/{arm}/{name}")[:2] for name in names])


@pytest.fixture(scope="module")
def shown(chromium: Chromium) -> Iterator[Hand]:
    """A planar problem, which every test leaves as it was opened."""
    page = Page(copose.load(PLANAR), host="127.0.0.1", port=0)
    try:
        with chromium.view(SIZE) as view:
            hand = Hand(page, view)
            hand.open("/arms/a1/tip")
            yield hand
            assert view.foreign == [] and view.errors == []
    finally:
        page.stop()


@pytest.fixture
def hand(shown: Hand) -> Iterator[Hand]:
    shown.settle()
    yield shown
    while shown.page.state.undoable:
        shown.page.undo()
        assert shown.page.settle()
    shown.settle()


def controls(page: Page) -> list[Any]:
    """All controls that have a label; viser keeps them where no one else looks."""
    found = page.server.gui._gui_input_handle_from_uuid.values()
    return [each for each in found if hasattr(each, "label")]


def sums(problem: copose.Problem, arm: str, q: list[float]) -> np.ndarray:
    """Where an arm's joints and its tip are by the elementary sums, (n + 1, 2)."""
    spec = next(each for each in problem.arms if each.name == arm)
    lengths = np.array([link.length for link in spec.links])
    angles = spec.base.angle + np.cumsum(q)
    steps = lengths[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.array(spec.base.position) + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def check_arms(hand: Hand) -> None:
    state = hand.page.state
    for arm, q in state.solution.after.joints.items():
        np.testing.assert_allclose(hand.drawn(arm), sums(state.problem, arm, q), atol=1e-5)


def check_tips(hand: Hand) -> None:
    """Tips are drawn where Pinocchio has them."""
    solution = hand.page.state.solution
    names = {arm: list(joints) for arm, joints in solution.joint_names.items()}
    truth = reference.Problem(hand.page.state.problem.source, names)
    for arm, q in solution.after.joints.items():
        tip, drawn = truth.arms[arm].at(q)[0], hand.view.pose(f"/arms/{arm}/tip")
        np.testing.assert_allclose(drawn[:3], tip.translation, atol=1e-5)
        rotation = pin.Quaternion(*drawn[3:]).toRotationMatrix()
        np.testing.assert_allclose(rotation, tip.rotation, atol=1e-5)


def test_a_page_opens_without_the_world(hand: Hand) -> None:
    solved = copose.solve(copose.load(PLANAR))
    assert hand.view.foreign == [] and hand.view.errors == []
    assert len(hand.view.requests) >= 2
    assert float(hand.text("now")) == pytest.approx(solved.objective.after, abs=SHOWN)
    assert float(hand.text("start")) == pytest.approx(solved.objective.before, abs=SHOWN)
    assert hand.text("message") == "the best that a search finds here"
    check_arms(hand)


def test_a_drag_moves_the_arms(hand: Hand) -> None:
    value, bars, places = hand.text("now"), hand.view.page.evaluate(_BARS), hand.drawn("a1")
    hand.drag(0.08)
    hand.drag(0.0, -0.06)
    problem = hand.page.state.problem
    assert problem.object.position == pytest.approx([0.58, 0.44], abs=0.01)
    assert hand.text("now") != value
    solved = copose.solve(problem)
    assert float(hand.text("now")) == pytest.approx(solved.objective.after, abs=SHOWN)
    assert hand.text("message").startswith("the best that a search finds")
    joints = np.concatenate(list(hand.page.state.solution.after.joints.values()))
    np.testing.assert_allclose(hand.view.page.evaluate(_BARS), joints, atol=6e-4)
    assert np.abs(joints - bars).max() > 0.01
    assert np.abs(hand.drawn("a1") - places).max() > 0.01
    check_arms(hand)
    hand.press("Undo")
    hand.press("Undo")
    hand.until("now", value)


def test_beyond_reach_is_told_and_undone(hand: Hand) -> None:
    value = hand.text("now")
    assert hand.color() == rgb(LOOK.held_object)
    hand.drag(0.0, 1.5)
    told = r"infeasible: arm 'a1' cannot reach its grasp: the nearest its tip comes is [\d.]+ m;"
    hand.view.eventually(lambda: re.match(told, hand.text("message")) is not None)
    hand.view.eventually(lambda: hand.color() == rgb(LOOK.over))
    check_arms(hand)
    kept, place = hand.page.state.solution, hand.page.state.problem.object.pose
    far = Pose.make([0.5, 3.0, 0.0], place.rotation, place.quaternion)
    for phase in ("start", "update", "end"):
        hand.page.drag(Gizmo("object"), far, phase)
    hand.settle()
    assert kept.status == "solved" and hand.page.state.solution is kept
    check_arms(hand)
    hand.press("Undo")
    hand.press("Undo")
    hand.until("message", "the best that a search finds here")
    assert hand.text("now") == value
    hand.view.eventually(lambda: hand.color() == rgb(LOOK.held_object))


def test_the_objective_is_chosen_in_the_list(hand: Hand) -> None:
    page = hand.view.page
    hand.click(page.locator("input[role=combobox][value=volume]"))
    hand.click(page.locator("[role=option][value=isotropy]"))
    hand.view.eventually(lambda: hand.page.state.problem.objective.kind == "isotropy")
    hand.settle()
    solved = copose.solve(copose.load(PLANAR, objective="isotropy"))
    assert float(hand.text("now")) == pytest.approx(solved.objective.after, abs=SHOWN)
    assert float(hand.text("start")) == pytest.approx(solved.objective.before, abs=SHOWN)


def test_a_click_on_an_optimum_takes_the_arms_there(hand: Hand) -> None:
    other = hand.page.state.optima[1]
    assert other.objective < hand.page.state.value
    hand.tab("Search")
    hand.press(f"2: {other.objective:.6f}")
    hand.until("now", f"{other.objective:.6f}")
    hand.settle()
    assert hand.page.state.solution.after.joints == other.joints
    check_arms(hand)


def test_a_slider_takes_an_arm_along_its_self_motion(hand: Hand) -> None:
    before = hand.page.state.solution.after.joints
    hand.tab("By hand")
    slider = hand.view.page.locator("[role=slider]:visible").first
    slider.focus()
    hand.view.page.keyboard.press("Home")
    hand.view.eventually(lambda: hand.page.state.solution.after.joints != before)
    hand.settle()
    state = hand.page.state
    assert state.solution.after.joints["a2"] == before["a2"]
    told = copose.evaluate(state.problem, state.solution.after.joints)
    assert float(hand.text("now")) == pytest.approx(told.objective.after, abs=SHOWN)
    check_arms(hand)


def test_what_is_saved_is_what_is_shown(hand: Hand, tmp_path: Path) -> None:
    hand.drag(0.05)
    value = hand.page.state.value
    hand.tab("Save")
    file, result = tmp_path / "saved.toml", tmp_path / "result.json"
    hand.save("problem", "paper-fig2-live.toml", file)
    hand.save("result", "result.json", result)
    problem, solution = copose.load(file), copose.read_solution(result)
    assert copose.solve(problem).objective.after == pytest.approx(value, abs=1e-8)
    told = copose.evaluate(problem, solution.after.joints)
    assert solution.objective.after == value
    assert value == pytest.approx(told.objective.after, abs=1e-9)
    assert copose.verify(problem, solution) == ()
    assert "# What it shows: figure 2" in file.read_text()
    taken = PLANAR.read_bytes()
    hand.save("problem", str(file), PLANAR, "is there already")
    assert taken == PLANAR.read_bytes()


def test_a_second_browser_sees_the_same(hand: Hand, chromium: Chromium) -> None:
    with chromium.view(SIZE) as view:
        other = Hand(hand.page, view)
        other.open("/arms/a1/tip")
        assert other.text("now") == hand.text("now")
        other.drag(-0.06)
        hand.settle()
        assert hand.page.state.problem.object.position[0] < 0.46
        assert hand.text("now") == other.text("now")
        check_arms(hand)
        check_arms(other)
        assert view.foreign == [] and view.errors == []


def test_a_page_beside_another_has_robots_of_files(hand: Hand, chromium: Chromium) -> None:
    problem = copose.load(SPATIAL)
    page = Page(problem, host="127.0.0.1", port=0)
    try:
        with chromium.view(SIZE) as view:
            pandas = Hand(page, view)
            pandas.open("/arms/left/tip", "/arms/right/tip")
            assert "/drag/object/hint" in view.nodes()
            value, place = pandas.text("now"), problem.object.pose.position
            pandas.pull(np.array([0.0, 0.0, 0.06]))
            hand.drag(0.05)
            pandas.settle()
            assert page.state.problem.object.position[2] > place[2] + 0.03
            assert pandas.text("now") != value
            assert "/drag/object/hint" not in view.nodes()
            for each in (hand, pandas):
                solved = copose.solve(each.page.state.problem)
                assert float(each.text("now")) == pytest.approx(solved.objective.after, abs=SHOWN)
            check_tips(pandas)
            assert view.foreign == [] and view.errors == []
    finally:
        page.stop()


def test_an_exported_page_opens_from_a_file(chromium: Chromium, tmp_path: Path) -> None:
    problem = copose.load(PLANAR)
    solution, file = copose.solve(problem), tmp_path / "page.html"
    copose.export(solution, "html", file, problem=problem)
    with chromium.view(SIZE) as view:
        view.open(file.as_uri(), "/object", "/arms/a1/tip", "/arms/a2/tip")
        for arm, q in solution.after.joints.items():
            tip = view.pose(f"/arms/{arm}/tip")
            np.testing.assert_allclose(tip[:2], sums(problem, arm, q)[-1], atol=1e-5)
        assert view.foreign == [] and view.errors == []
