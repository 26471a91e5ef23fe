"""URDFs: where they are found, what is lumped, what is refused and how it is named."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import copose
from cells import PANDA, two_pandas
from copose.errors import InputError
from copose.loader import load, parse
from copose.robots import Arm, load_arms
from reference import example

INERTIAL = (
    '<inertial><origin xyz="0 0 0.1"/><mass value="1"/>'
    '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
)
LIMIT = '<limit lower="-2" upper="2" effort="10" velocity="3"/>'
AXES = ["0 0 1", "0 1 0", "1 0 0", "0 1 1", "0 -1 0", "0 0 -1", "1 1 1"]


def robot(
    *,
    kinds: dict[int, str] | None = None,
    inertial: dict[int, str] | None = None,
    limits: dict[int, str] | None = None,
    extra: dict[int, str] | None = None,
    more: str = "",
) -> str:
    """A seven-joint arm as URDF, with chosen joints and links made different."""
    parts = ['<link name="base"/>']
    for i in range(7):
        kind = (kinds or {}).get(i, "revolute")
        parts.append(
            f'<joint name="j{i}" type="{kind}"><parent link="{"base" if i == 0 else f"l{i - 1}"}"/>'
            f'<child link="l{i}"/><origin xyz="0 0.02 0.15" rpy="0.1 0 0"/>'
            f'<axis xyz="{AXES[i]}"/>{(limits or {}).get(i, LIMIT)}'
            f"{(extra or {}).get(i, '')}</joint>"
            f'<link name="l{i}">{(inertial or {}).get(i, INERTIAL)}</link>'
        )
    return f'<robot name="r">{"".join(parts)}{more}</robot>'


def problem_of(urdf: str, **arm: object) -> dict:
    table = {"name": "arm", "urdf": urdf, "tip": "l6", "grasp": {"position": [0, 0, 0]}} | arm
    thing = {"mass": 1.0, "inertia": [0.01] * 3, "position": [0.1, 0.1, 0.6]}
    return {
        "format": 1, "name": "x", "task": {"space": "spatial"}, "object": thing, "arms": [table],
    }  # fmt: skip


def arms_of(text: str, folder: Path, **arm: object) -> tuple[Arm, ...]:
    (folder / "robot.urdf").write_text(text)
    problem = parse(problem_of("robot.urdf", **arm), source=folder / "p.toml")
    return copose.check(problem).arms


def refused(text: str, folder: Path, **arm: object) -> str:
    with pytest.raises(InputError) as caught:
        arms_of(text, folder, **arm)
    assert str(folder / "p.toml") in str(caught.value)
    return str(caught.value)


def test_every_kind_of_joint_and_any_axis(tmp_path: Path) -> None:
    (arm,) = arms_of(robot(kinds={1: "continuous", 3: "prismatic"}), tmp_path)
    assert [joint.kind for joint in arm.joints] == ["revolute"] * 3 + ["prismatic"] + [
        "revolute"
    ] * 3
    for joint, axis in zip(arm.joints, AXES, strict=True):
        wanted = np.array([float(x) for x in axis.split()])
        assert np.allclose(joint.axis, wanted / np.linalg.norm(wanted))
    assert arm.joints[1].lower == -np.inf and arm.joints[1].upper == np.inf
    assert (arm.joints[0].lower, arm.joints[0].upper) == (-2, 2)
    assert (arm.joints[0].effort, arm.joints[0].velocity) == (10, 3)


def test_a_continuous_joint_without_limits_has_none(tmp_path: Path) -> None:
    (arm,) = arms_of(robot(kinds={2: "continuous"}, limits={2: ""}), tmp_path)
    assert arm.joints[2].effort == np.inf and arm.joints[2].velocity == np.inf


def test_limits_of_the_file_take_the_place_of_the_urdfs(tmp_path: Path) -> None:
    limits = [[-1, 1]] * 6 + [[-np.inf, 2]]
    (arm,) = arms_of(robot(), tmp_path, position_limits=limits, torque_limits=[1.0] * 7)
    assert arm.upper[0] == 1 and arm.lower[6] == -np.inf
    assert [joint.effort for joint in arm.joints] == [1.0] * 7


def test_links_beyond_locked_joints_are_lumped(tmp_path: Path) -> None:
    more = (
        f'<link name="f">{INERTIAL}</link><joint name="finger" type="prismatic"><parent link="l6"/>'
        f'<child link="f"/><origin xyz="0 0 0.2"/><axis xyz="1 0 0"/>{LIMIT}</joint>'
    )
    (bare,) = arms_of(robot(), tmp_path)
    (held,) = arms_of(robot(more=more), tmp_path)
    (moved,) = arms_of(robot(more=more), tmp_path, locked={"finger": 0.5})
    assert held.joints[6].body.mass == bare.joints[6].body.mass + 1
    assert np.allclose(held.joints[6].body.com, [0, 0, (0.1 + 0.3) / 2])
    assert np.allclose(moved.joints[6].body.com, [0.25, 0, 0.2])
    assert [(joint.name, joint.position) for joint in moved.locked] == [("finger", 0.5)]


def test_a_locked_joint_on_the_chain_keeps_its_place(tmp_path: Path) -> None:
    (arm,) = arms_of(robot(), tmp_path, locked={"j2": 0.4})
    assert arm.joint_names == ("j0", "j1", "j3", "j4", "j5", "j6")
    assert [(joint.name, joint.position) for joint in arm.locked] == [("j2", 0.4)]


def test_doubtful_locks_are_told(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(robot())
    cell = problem_of("robot.urdf", locked={"j2": 2.5})
    notes = copose.check(parse(cell, source=tmp_path / "p.toml")).notes
    assert any("'j2'" in note and "outside its limits -2 … 2" in note for note in notes)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"kinds": {3: "floating"}}, "joint 'j3' on the chain is floating"),
        ({"kinds": {3: "planar"}}, "joint 'j3' on the chain is planar"),
        ({"extra": {4: '<mimic joint="j1"/>'}}, "joint 'j4' mimics 'j1', which is free"),
        ({"inertial": dict.fromkeys(range(7), "")}, "has no inertials: none of l0, l1"),
        ({"inertial": {6: ""}}, "joint 'j6' moves next to no inertia"),
        ({"inertial": {6: INERTIAL.replace("0.01", "-9")}}, "inertia of link 'l6' is negative"),
        ({"limits": {2: '<limit effort="1" velocity="1"/>'}}, "'j2' has no range in the URDF"),
    ],
    ids=["floating", "planar", "mimic", "no-inertials", "one-massless", "negative", "no-range"],
)
def test_what_cannot_be_used_is_named(change: dict, expected: str, tmp_path: Path) -> None:
    assert expected in refused(robot(**change), tmp_path)


def test_a_joint_without_an_axis_is_named(tmp_path: Path) -> None:
    text = robot().replace('xyz="0 1 0"', 'xyz="0 0 0.0"')
    assert "joint 'j1': its axis is '0 0 0.0', which has no direction" in refused(text, tmp_path)


def test_ranges_beyond_a_turn_from_zero(tmp_path: Path) -> None:
    limits = {0: '<limit lower="3.5" upper="6" effort="1" velocity="1"/>'}
    (arm,) = arms_of(robot(limits=limits), tmp_path)
    assert (arm.lower[0], arm.upper[0]) == (3.5, 6)


@pytest.mark.parametrize("name", ["finger", "universe", "root_joint"])
def test_links_and_joints_may_share_a_name(name: str, tmp_path: Path) -> None:
    """Pinocchio's frames may not; two of the example robots are built so."""
    more = (
        f'<link name="{name}">{INERTIAL}</link><joint name="{name}" type="prismatic">'
        f'<parent link="l6"/><child link="{name}"/><axis xyz="1 0 0"/>{LIMIT}</joint>'
    )
    (arm,) = arms_of(robot(more=more), tmp_path)
    assert [joint.name for joint in arm.locked] == [name]
    (arm,) = arms_of(robot(more=more), tmp_path, tip=name)
    assert arm.joint_names[-1] == name


def test_an_example_robot_whose_link_and_joint_share_a_name() -> None:
    cell = problem_of(
        "example-robot-data://so_arm_description/urdf/so100.urdf", tip="gripper",
        grasp={"position": [0, 0, 0]},
    )  # fmt: skip
    cell["task"]["space"] = "spatial-linear"
    assert load_arms(parse(cell))[0].n == 5


def test_armature_makes_up_for_a_massless_last_link(tmp_path: Path) -> None:
    (arm,) = arms_of(robot(inertial={6: ""}), tmp_path, armature=[0.1] * 7)
    assert arm.joints[6].armature == 0.1


def test_a_mimic_joint_may_be_locked(tmp_path: Path) -> None:
    (arm,) = arms_of(robot(extra={4: '<mimic joint="j1"/>'}), tmp_path, locked={"j4": 0.2})
    assert "j4" not in arm.joint_names


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<robot name='r'><link", "is not XML"),
        ("<html/>", "is not a URDF: its root is <html>"),
        ("<robot name='r'/>", "it has no links"),
        ("<robot name='r'><link name='a'/><link name='b'/></robot>", "it has 2 root links: a, b"),
        (robot().replace('<parent link="l2"/>', '<parent link="x"/>'), "joint 'j3' names the link"),
        (robot().replace('name="l3"', 'name="l2"'), "appears twice"),
        (
            robot().replace("<mass value", "<mass weight"),
            "link 'l0': <mass> has no value; link 'l1'",
        ),
        (
            "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:arm/></robot>",
            "is xacro, not URDF; run: xacro robot.urdf > robot_expanded.urdf",
        ),
    ],
    ids=["xml", "html", "empty", "two-roots", "lost-link", "twice", "weight", "xacro"],
)
def test_broken_urdfs(text: str, expected: str, tmp_path: Path, capfd) -> None:
    message = refused(text, tmp_path)
    assert expected in message and message.count("\n") == 0
    captured = capfd.readouterr()
    assert captured.err == "" and captured.out == ""


def test_a_broken_robot_of_the_examples() -> None:
    cell = problem_of("example-robot-data://ur_description/urdf/ur3.urdf")
    with pytest.raises(InputError, match=r"ur3.urdf is broken: it has no links"):
        load_arms(parse(cell))


def test_xacro_by_its_ending(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "xacro", None)
    (tmp_path / "arm.urdf.xacro").write_text("<robot/>")
    with pytest.raises(InputError, match=r"run: xacro arm.urdf.xacro > arm_expanded.urdf"):
        load_arms(parse(problem_of("arm.urdf.xacro"), source=tmp_path / "p.toml"))


def test_relative_paths_start_at_the_problem_file(tmp_path: Path) -> None:
    folder = tmp_path / "robots"
    folder.mkdir()
    shutil.copy(example("panda_description/urdf/panda.urdf"), folder / "panda.urdf")
    cell = two_pandas()
    for arm in cell["arms"]:
        arm["urdf"] = "robots/panda.urdf"
    from cells import toml

    (tmp_path / "p.toml").write_text(toml(cell))
    here, there = load_arms(load(tmp_path / "p.toml")), load_arms(parse(two_pandas()))
    assert here[0].joint_names == there[0].joint_names
    with pytest.raises(
        InputError, match=r"p.toml: arms\[0\] \(left\).urdf: .*nope.urdf: no such file"
    ):
        cell["arms"][0]["urdf"] = "nope.urdf"
        load_arms(parse(cell, source=tmp_path / "p.toml"))


@pytest.mark.parametrize("layout", ["ros1", "ros1-itself", "ros1-nested", "ament"])
def test_packages_are_found(layout: str, tmp_path: Path, monkeypatch) -> None:
    place = {
        "ros1": "src/panda_description",
        "ros1-itself": "src/panda_description",
        "ros1-nested": "src/repository/panda_description",
        "ament": "install/share/panda_description",
    }[layout]
    (tmp_path / place / "urdf").mkdir(parents=True)
    source = example("panda_description/urdf/panda.urdf")
    shutil.copy(source, tmp_path / place / "urdf/panda.urdf")
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    if layout == "ament":
        monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path / 'install'}")
    else:
        entry = place if layout == "ros1-itself" else "src"
        monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path / entry}")
    cell = two_pandas()
    cell["arms"] = cell["arms"][:1]
    cell["arms"][0]["urdf"] = "package://panda_description/urdf/panda.urdf"
    assert load_arms(parse(cell))[0].n == 7
    cell["arms"][0]["urdf"] = "package://panda_description/urdf/pnda.urdf"
    with pytest.raises(
        InputError, match=r"package 'panda_description' has no file 'urdf/pnda.urdf'"
    ):
        load_arms(parse(cell))
    cell["arms"][0]["urdf"] = "package://other/urdf/panda.urdf"
    with pytest.raises(
        InputError, match=r"was not found; .* by ROS_PACKAGE_PATH or by AMENT_PREFIX_PATH"
    ):
        load_arms(parse(cell))


def test_example_robots_that_do_not_exist() -> None:
    for urdf, hint in [
        (
            PANDA.replace("panda_description", "pandda_description"),
            "did you mean 'panda_description'",
        ),
        (PANDA.replace("panda.urdf", "pand.urdf"), "did you mean 'urdf/panda.urdf'"),
        ("http://x/y.urdf", "is expected"),
    ]:
        with pytest.raises(InputError, match=hint):
            load_arms(parse(problem_of(urdf)))


def baxter(**changes: dict) -> dict:
    from cells import tables

    cell = tables("baxter-box")
    for arm in cell["arms"]:
        arm.update(changes.get(arm["name"], {}))
    return cell


def tiago(left: dict, right: dict) -> dict:
    cell = baxter()
    for arm, side, changes in zip(cell["arms"], ("left", "right"), (left, right), strict=True):
        arm.pop("start")
        arm["urdf"] = "example-robot-data://tiago_description/robots/tiago_dual.urdf"
        arm["tip"] = f"arm_{side}_7_link"
        arm.update(changes)
    return cell


def test_one_robot_twice() -> None:
    assert len(load_arms(parse(baxter()))) == 2
    torso = {"locked": {"torso_lift_joint": 0.1}}
    assert [arm.n for arm in load_arms(parse(tiago(torso, torso)))] == [7, 7]
    other_base = {"base": {"position": [2.0, 0, 0]}}
    assert [arm.n for arm in load_arms(parse(tiago({}, other_base)))] == [8, 8]


def test_one_robot_holds_a_joint_at_one_place() -> None:
    left, right = ({"locked": {"torso_lift_joint": height}} for height in (0.0, 0.3))
    with pytest.raises(InputError, match="hold joint 'torso_lift_joint' at different positions"):
        load_arms(parse(tiago(left, right)))


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ({}, {}),
        ({}, {"locked": {"torso_lift_joint": 0.0}}),
        ({}, {"root": "torso_lift_link", "base": "torso"}),
    ],
    ids=["both-free", "one-locked", "other-root"],
)
def test_arms_that_hang_on_one_joint_are_refused(left: dict, right: dict) -> None:
    if right.get("base") == "torso":
        import pinocchio as pin

        model = pin.buildModelFromUrdf(str(example("tiago_description/robots/tiago_dual.urdf")))
        data = model.createData()
        pin.framesForwardKinematics(model, data, pin.neutral(model))
        place = data.oMf[model.getFrameId("torso_lift_link", pin.FrameType.BODY)]
        right = dict(right, base={"position": [float(x) for x in place.translation]})
    with pytest.raises(
        InputError, match=r"both hang on torso_lift_joint, .*locked = { torso_lift_joint = 0.0 }"
    ):
        load_arms(parse(tiago(left, right)))


def test_gears_are_said_to_be_ignored() -> None:
    cell = two_pandas()
    assert any("gears are ignored" in note for note in copose.check(parse(cell)).notes)
    for arm in cell["arms"]:
        arm["armature"] = [0.1] * 7
    assert not any("gears" in note for note in copose.check(parse(cell)).notes)


def test_a_start_just_beyond_its_limit_is_clipped() -> None:
    cell = two_pandas()
    cell["arms"][0]["position_limits"] = [[-1, 1]] * 7
    cell["arms"][0]["start"] = [1 + 5e-7] + [0.0] * 6
    assert load_arms(parse(cell))[0].start[0] == 1.0
    cell["arms"][0]["start"] = [1 + 2e-6] + [0.0] * 6
    with pytest.raises(InputError, match=r"arms\[0\] \(left\).start\[0\]"):
        load_arms(parse(cell))


def test_loading_reads_a_changed_file_anew(tmp_path: Path) -> None:
    (first,) = arms_of(robot(), tmp_path)
    (second,) = arms_of(robot(limits={0: LIMIT.replace("-2", "-1.5")}), tmp_path)
    assert (first.lower[0], second.lower[0]) == (-2, -1.5)


def test_load_names_the_file(tmp_path: Path) -> None:
    from cells import toml

    file = tmp_path / "p.toml"
    file.write_text(toml(problem_of("none.urdf")))
    with pytest.raises(InputError, match=r"p\.toml"):
        load_arms(load(file))
