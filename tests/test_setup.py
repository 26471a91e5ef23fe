"""Problem files made from robots: which arms are found, where things are put, what is written."""

from __future__ import annotations

import itertools
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import copose
from cells import PANDA, two_pandas
from copose.collision.links.link_shapes import LinkShapes
from copose.commands.command_line import main
from copose.robots import load_arms
from copose.robots.files.file_paths import EXAMPLES, resolve
from copose.robots.files.urdf_tree import read_tree
from copose.setup.chains import chain_to, find_chains
from copose.setup.grasps import Hand, toward
from copose.setup.problem_writer import ProblemText
from copose.setup.robot_entries import RobotEntry, named_arms

FOLDER = resolve(PANDA, Path(), {}).parents[2]
UR5 = f"{EXAMPLES}ur_description/urdf/ur5_robot.urdf"
SO100 = f"{EXAMPLES}so_arm_description/urdf/so100.urdf"
BAXTER = f"{EXAMPLES}baxter_description/urdf/baxter.urdf"


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def numbered(name: str, count: int, first: int = 1) -> list[str]:
    return [name.format(i) for i in range(first, first + count)]


TALOS = "talos_data/robots/talos_full_v2.urdf"
ARMS = {
    "panda_description/urdf/panda.urdf": {"panda_hand_tcp": numbered("panda_joint{}", 7)},
    TALOS: {
        f"gripper_{side}_base_link": numbered(f"arm_{side}_{{}}_joint", 7)
        for side in ("left", "right")
    },
    # A hand of five fingers, some of which bear no finger's name; the lift carries a head too.
    "tiago_description/robots/tiago.urdf": {"arm_tool_link": numbered("arm_{}_joint", 7)},
    "b1_description/urdf/b1-z1.urdf": {"gripperStator": numbered("joint{}", 6)},
    "anymal_b_simple_description/robots/anymal.urdf": {},
    "double_pendulum_description/urdf/double_pendulum.urdf": {},
    "iris_description/robots/iris.urdf": {},
}


@pytest.mark.parametrize("file", ARMS)
def test_arms_are_found_and_nothing_else(file: str) -> None:
    found = find_chains(read_tree(FOLDER / file, {}, {}))
    joints = {chain.tip: [joint.name for joint in chain.joints] for chain in found}
    assert joints == ARMS[file]
    assert [chain.side for chain in found] == (
        ["left", "right"] if file == TALOS else [""] * len(found)
    )


def test_what_arms_share_is_locked_within_its_range() -> None:
    for file, shared in (
        (TALOS, {"torso_1_joint": 0.0, "torso_2_joint": 0.0}),
        ("tiago_description/robots/tiago_dual.urdf", {"torso_lift_joint": 0.175}),
    ):
        tree = read_tree(FOLDER / file, {}, {})
        chains = find_chains(tree)
        for chain in chains:
            assert {joint.name: at for joint, at, _ in chain.locked} == shared
            again = chain_to(tree, chain.tip, [other.tip for other in chains])
            assert {joint.name for joint, *_ in again.locked} == {*shared}
            assert [j.name for j in again.joints] == [j.name for j in chain.joints]


def test_an_srdf_beside_a_robot_names_its_tips(here: Path) -> None:
    shutil.copy(resolve(PANDA, Path(), {}), here / "panda.urdf")

    def tip() -> str:
        (arm,) = named_arms([RobotEntry.of("panda.urdf", here)], [])
        return arm.chain.tip

    assert tip() == "panda_hand_tcp"
    text = '<robot name="{}"><group name="arm"><chain base_link="b" tip_link="{}"/></group></robot>'
    for robot, link, found in (
        ("panda", "panda_link8", "panda_link8"),
        ("another", "panda_link8", "panda_hand_tcp"),
        ("panda", "panda_link3", "panda_hand_tcp"),
    ):
        (here / "p.srdf").write_text(text.format(robot, link))
        assert tip() == found
    (here / "p.srdf").write_text("<robot")
    assert tip() == "panda_hand_tcp"


HANDS = [
    (PANDA, "panda_hand", "+z"),
    (UR5, "tool0", "+z"),
    (UR5, "ee_link", "+x"),
    (UR5, "wrist_3_link", "+y"),
    (f"{EXAMPLES}xarm_description/urdf/xarm7.urdf", "link_eef", "+z"),
]


@pytest.mark.parametrize(("urdf", "tip", "axis"), HANDS)
def test_hands_approach_as_their_makers_say(urdf: str, tip: str, axis: str) -> None:
    entry = RobotEntry.of(urdf, Path())
    cell = two_pandas()
    cell["arms"] = [{"name": "a", "urdf": urdf, "tip": tip, "grasp": {"position": [0, 0, 0]}}]
    (arm,) = load_arms(copose.parse(cell))
    hand = Hand.of(entry.robot, LinkShapes.of(entry.robot), arm, {})
    assert hand.name == axis and not hand.guess
    if tip == "panda_hand":
        # The maker's point between the fingertips is 0.1034 m ahead, a centimetre before their end.
        assert hand.reach == pytest.approx(0.1034, abs=0.015)
    for direction in (np.array([1.0, 0, 0]), np.array([0, 0, -1.0]), np.array([0.6, 0.0, 0.8])):
        frames = [toward(hand, direction, roll).rotation for roll in (0.0, 0.7)]
        for R in frames:
            np.testing.assert_allclose(R @ hand.axis, direction, atol=1e-12)
            np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
            assert np.linalg.det(R) == pytest.approx(1)
        assert np.linalg.norm(pin.log3(frames[0].T @ frames[1])) == pytest.approx(0.7)


def test_two_pandas_face_each_other_across_what_they_hold(here: Path, capsys) -> None:
    assert main(["init", PANDA, PANDA]) == 0
    out, err = capsys.readouterr()
    assert "written to two-panda.toml" in out and err == ""
    text = (here / "two-panda.toml").read_text()
    assert Path(re.match(r"#:schema (.*)", text)[1]).is_file()
    problem = copose.load("two-panda.toml")
    left, right = problem.arms
    assert (left.name, right.name) == ("left", "right")
    # What a random posture reaches, by Pinocchio, is within what the bases are 0.6 apart of.
    model = pin.buildModelFromUrdf(str(resolve(PANDA, Path(), {})))
    data, reach = model.createData(), 0.0
    rng = np.random.default_rng(5)
    for _ in range(300):
        q = rng.uniform(model.lowerPositionLimit, model.upperPositionLimit)
        pin.framesForwardKinematics(model, data, q)
        tip = data.oMf[model.getFrameId("panda_hand_tcp")].translation
        reach = max(reach, float(np.linalg.norm(tip - data.oMi[1].translation)))
    assert right.base.position[0] == pytest.approx(2 * 0.6 * reach, rel=0.05)
    assert right.base.rpy == pytest.approx((0, 0, np.pi)) and left.base.position == (0, 0, 0)
    for start in copose.check(problem).starts:
        assert start.given and start.closed
        # The fingers of the Panda point along z, and so towards the object.
        inwards = -start.arm.grasp.position / np.linalg.norm(start.arm.grasp.position)
        np.testing.assert_allclose(start.arm.grasp.rotation[:, 2], inwards, atol=1e-12)
        assert abs(start.arm.grasp.position[0]) == pytest.approx(
            problem.object.shape.size[0] / 2, abs=0.02
        )
    # Every guess is told, and stands under a comment.
    guesses = re.findall(r"^  (?:(\w+): )?(\w+)(?: = |: )", out, re.M)
    lines = text.splitlines()
    commented = [after.split(" ")[0] for line, after in itertools.pairwise(lines)
                 if line.startswith("# guessed: ")]  # fmt: skip
    assert commented == [key for _, key in guesses] and len(commented) > 10
    assert copose.solve(problem, effort="low").status == "solved"
    assert main(["init", PANDA, PANDA, "--quiet"]) == 2
    assert "two-panda.toml: is there already; --overwrite" in capsys.readouterr().err
    assert main(["init", PANDA, PANDA, "--overwrite", "--quiet"]) == 0
    assert (here / "two-panda.toml").read_text() == text


def test_robots_of_a_folder_are_named_from_the_file_s(here: Path) -> None:
    for name in ("one", "other"):
        (here / "robots").mkdir(exist_ok=True)
        shutil.copy(resolve(UR5, Path(), {}), here / "robots" / f"{name}.urdf")
    made = here / "cells" / "pair.toml"
    robots = ["robots/one.urdf", "robots/other.urdf"]
    wishes = ["--mass", "3", "--size", "0.4,0.2,0.1", "--space", "spatial-linear"]
    assert main(["init", *robots, "-o", str(made), *wishes]) == 0
    problem = copose.load(made)
    assert [arm.urdf for arm in problem.arms] == ["../robots/one.urdf", "../robots/other.urdf"]
    assert problem.name == "one-other" and problem.task.space == "spatial-linear"
    thing = problem.object
    assert thing.mass == 3 and thing.shape.size == (0.4, 0.2, 0.1)
    assert np.diag(thing.inertia) == pytest.approx([0.0125, 0.0425, 0.05])
    assert all(start.closed for start in copose.check(problem).starts)


def test_grasps_are_taught_by_joints(here: Path, capsys) -> None:
    left, right = [0.1, 0.2, -0.3, -1.9, 0.4, 2.0, 0.5], [-0.2, 0.3, 0.1, -1.7, -0.2, 1.8, 0.1]
    said = [
        f"--joints={name}={','.join(map(str, q))}" for name, q in (("left", left), ("b", right))
    ]
    tips = ["--tip", "left=panda_hand", "--tip", "b=panda_link8"]
    assert main(["init", PANDA, PANDA, "-o", "p.toml", "--quiet", *tips, *said]) == 0
    written = tomllib.loads((here / "p.toml").read_text())
    assert [arm["start"] for arm in written["arms"]] == [left, right]
    assert not any("grasp" in arm for arm in written["arms"])
    problem = copose.load("p.toml")
    model = pin.buildModelFromUrdf(str(resolve(PANDA, Path(), {})))
    data, tips_ = model.createData(), []
    for arm, q in zip(problem.arms, (left, right), strict=True):
        pin.framesForwardKinematics(model, data, np.array([*q, 0, 0]))
        base = pin.SE3(pin.rpy.rpyToMatrix(np.array(arm.base.rpy)), np.array(arm.base.position))
        tips_.append(base * data.oMf[model.getFrameId(arm.tip)])
    middle = (tips_[0].translation + tips_[1].translation) / 2
    np.testing.assert_allclose(problem.object.position, middle, atol=1e-6)
    for arm, tip in zip(problem.arms, tips_, strict=True):
        grasp = arm.grasp.pose
        np.testing.assert_allclose(grasp.rotation, tip.rotation, atol=1e-9)
        np.testing.assert_allclose(
            grasp.position, tip.translation - problem.object.position, atol=1e-9
        )
    assert copose.evaluate(problem).status == "solved"


def test_what_cannot_be_closed_is_written_and_told(here: Path, capsys) -> None:
    assert main(["init", SO100, SO100, "-o", "p.toml", "--size", "9,9,9", "--quiet"]) == 3
    err = capsys.readouterr().err
    assert err.startswith(
        "copose: no posture that closes was found: arm 'left' misses its grasp by "
    )
    assert "arm 'right'" in err and err.count("\n") == 1
    assert "start" not in tomllib.loads((here / "p.toml").read_text())["arms"][0]


@pytest.mark.parametrize(
    "robot", ["panda_description/urdf/panda", "ur_description/urdf/ur10_robot"]
)
def test_an_arm_by_itself_holds_what_is_above_its_table(here: Path, robot: str) -> None:
    assert main(["init", f"example-robot-data://{robot}.urdf", "-o", "one.toml"]) == 0
    thing = copose.load("one.toml").object
    assert thing.position[2] >= thing.shape.size[2] / 2


def test_arms_of_few_joints_hold_by_ball_joints(here: Path) -> None:
    assert main(["init", SO100, SO100, "-o", "p.toml", "--quiet"]) == 0
    problem = copose.load("p.toml")
    assert problem.task.space == "spatial-linear"
    assert all(start.closed for start in copose.check(problem).starts)


def test_nothing_in_a_name_ends_a_comment() -> None:
    text = ProblemText()
    text.put("tip", "a\nb = 1", "a\nb = 1\x85c = 2", "\r[d]")
    text.remark("joints: e\n[f]")
    assert tomllib.loads(text.text) == {"tip": "a\nb = 1"}


WRONG = [
    (["nothing.urdf"], "nothing.urdf: no such file"),
    ([PANDA, "--tip", "panda_hnad"], "--tip: 'panda_hnad' is no link of the robots; did you mean"),
    ([f"{EXAMPLES}a1_description/urdf/a1.urdf"], "has no arm that is found; name the link"),
    ([PANDA, "--joints", "x=1"], "--joints: no arm is called 'x'"),
    ([PANDA, "--joints", "panda_hand_tcp=1"], "has 1 entries; 7 are needed, for panda_joint1"),
    ([PANDA, PANDA, "--joints", "left=0,0,0,-1,0,1,0"], "--joints: are missing for arm 'right'"),
    ([PANDA, "--joints", "left"], "argument --joints: 'left': ARM=Q1,Q2,… is needed"),
    ([PANDA, "--size", "1,2"], "argument --size: '1,2': three numbers above zero are needed"),
    ([PANDA, "--mass", "nan"], "argument --mass: 'nan': numbers apart by commas are needed"),
    ([PANDA, "--space", "planar"], "argument --space: invalid choice: 'planar'"),
    ([PANDA, "--tip", "panda_link2"], "has 2 free joints (panda_joint1, panda_joint2); 3 are"),
]


@pytest.mark.parametrize(("arguments", "expected"), WRONG)
def test_mistakes_are_two_and_write_nothing(arguments, expected, here: Path, capsys) -> None:
    assert main(["init", *arguments]) == 2
    err = capsys.readouterr().err
    assert expected in err and err.count("\n") == 1 and not list(here.iterdir())
