"""Exports read back by the programs that they are for: tips are where the result has them."""

from __future__ import annotations

import csv
import io
import json
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yaml

import copose
from cells import planar, tables, toml
from copose import InputError
from copose.commands.command_line import main
from copose.commands.export_file import TO
from copose.formats import exported_text
from copose.formats.registry import FORMATS
from copose.results import Motion, Solution, read_result, to_json
from copose.robots.files.file_paths import resolve
from test_motion_report import made, nowhere


@cache
def held() -> Solution:
    """Baxter at the posture that it starts from, where the grasps are taught."""
    cell = tables("baxter-box")
    for arm in cell["arms"]:
        arm["start"] = [x + 0.01 * i for i, x in enumerate(arm["start"])]
        del arm["grasp"]
    del cell["object"]["position"]
    return copose.evaluate(copose.parse(cell))


@cache
def robot() -> pin.Model:
    return pin.buildModelFromUrdf(str(resolve(tables("baxter-box")["arms"][0]["urdf"], Path(), {})))


def misses(positions: dict[str, float] | np.ndarray, solution: Solution) -> float:
    """How far Pinocchio has the tips from where the result has them, m."""
    model, data = robot(), robot().createData()
    q = pin.neutral(model)
    if isinstance(positions, dict):
        for name, position in positions.items():
            # One coordinate a joint, as this robot has no continuous ones on its arms.
            q[model.joints[model.getJointId(name)].idx_q] = position
    else:
        q = positions
    pin.framesForwardKinematics(model, data, q)
    return max(
        np.abs(data.oMf[model.getFrameId(f"{arm}_gripper")].translation - there.skeleton[-1]).max()
        for arm, there in solution.after.arms.items()
    )


def named(solution: Solution) -> dict[str, float]:
    """Positions by joint, of a robot whose joints all have names of their own."""
    return {
        joint: position
        for arm, joints in solution.joint_names.items()
        for joint, position in zip(joints, solution.after.joints[arm], strict=True)
    }


def test_moveit_and_ros_put_the_tips_where_they_were() -> None:
    solution = held()
    state = yaml.safe_load(exported_text(solution, "moveit"))
    told = yaml.safe_load(exported_text(solution, "ros"))
    assert state == {"joint_state": told, "is_diff": True}
    assert told["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert told["velocity"] == told["effort"] == []
    positions = dict(zip(told["name"], told["position"], strict=True))
    assert positions == named(solution) and misses(positions, solution) < 1e-9
    assert misses({**positions, "left_s0": 0.0}, solution) > 0.01


def test_a_table_has_a_row() -> None:
    solution = held()
    header, row = csv.reader(io.StringIO(exported_text(solution, "csv")))
    positions = dict(zip((name.partition("/")[2] for name in header), map(float, row), strict=True))
    assert header[0] == "left/left_s0" and positions == named(solution)


def test_pinocchio_reads_the_group_state(tmp_path: Path) -> None:
    solution = held()
    file = tmp_path / "robot.srdf"
    copose.export(solution, "srdf", file)
    model = robot().copy()
    pin.loadReferenceConfigurations(model, str(file), False)
    found = {each.key(): each.data() for each in model.referenceConfigurations}
    assert misses(found["baxter-box"], solution) < 1e-9
    checked(ET.parse(file).getroot())


def checked(root: ET.Element) -> None:
    """What srdfdom asks: groups of joints or of groups, states of groups and of joints in them."""
    assert root.tag == "robot" and list(root.attrib) == ["name"]
    assert {each.tag for each in root} == {"group", "group_state"}
    groups: dict[str, set[str]] = {}
    for group in root.iter("group"):
        if "name" in group.attrib and group in list(root):
            assert len(group) and group.attrib["name"] not in groups
            members = {each.attrib["name"] for each in group if each.tag == "joint"}
            for each in group.findall("group"):
                members |= groups[each.attrib["name"]]
            groups[group.attrib["name"]] = members
    stated = set()
    for state in root.findall("group_state"):
        assert set(state.attrib) == {"name", "group"}
        joints = [each.attrib["name"] for each in state]
        assert {each.tag for each in state} == {"joint"} and len(set(joints)) == len(joints)
        assert set(joints) == groups[state.attrib["group"]]
        assert all(np.isfinite(float(each.attrib["value"])) for each in state)
        stated.add(state.attrib["group"])
    assert stated == set(groups)


def test_names_that_arms_share_have_their_arms_in_front() -> None:
    names = {"left": ("a", "b"), "right": ("b", "c")}
    solution = renamed(names)
    told = yaml.safe_load(exported_text(solution, "ros"))
    assert told["name"] == ["a", "left_b", "right_b", "c"]
    states = ET.fromstring(exported_text(solution, "srdf")).findall("group_state")
    assert [[each.attrib["name"] for each in state] for state in states] == [
        told["name"], ["a", "left_b"], ["right_b", "c"],
    ]  # fmt: skip
    with pytest.raises(InputError, match="two joints would be called 'left_b'"):
        exported_text(renamed({"left": ("left_b", "b"), "right": ("b", "c")}), "moveit")


def renamed(names: dict[str, tuple[str, str]], title: str = "x") -> Solution:
    after = held().after.model_copy(update={"joints": dict.fromkeys(names, (0.25, -1e-7))})
    problem = held().problem.model_copy(update={"name": title})
    return held().model_copy(update={"joint_names": names, "after": after, "problem": problem})


def test_odd_names_stay_what_they_are() -> None:
    odd = "é<&\"'>"
    root = ET.fromstring(exported_text(renamed({odd: ("a", odd)}, title=odd), "srdf"))
    assert root.attrib["name"] == odd and root.find("group").attrib["name"] == odd
    assert [each.attrib["name"] for each in root.find("group_state")] == ["a", odd]
    with pytest.raises(InputError, match="that XML cannot hold"):
        exported_text(renamed({"left": ("a", "\x01")}), "srdf")


# The crate comes before the robot, the right arm before the left, which the problem names first,
# and a ball joint between them; the lift is locked, the thumb follows the locked finger, the tail
# is in no chain.
HALL = """<mujoco model="hall"><compiler angle="radian"/>
<default><geom type="sphere" size="0.05"/></default>
<worldbody>
  <body name="crate" pos="2 0 0.5"><freejoint name="crate"/><geom/></body>
  <body name="pelvis" pos="0.3 0 1"><freejoint name="floating"/><geom/>
    <body name="tail"><joint name="tail" axis="0 1 0"/><geom/></body>
    <body name="torso" pos="0 0 0.1">
      <joint name="lift" type="slide" axis="0 0.6 0.8" range="-0.5 0.5" ref="0.1"/><geom/>
      {right}
      <body name="head" pos="0 0 0.4"><joint type="ball" name="neck"/><geom/></body>
      {left}
    </body>
  </body>
</worldbody>
<equality><joint joint1="thumb" joint2="finger" polycoef="0.01 2 0 0 0"/></equality>
<keyframe>
  <key name="first"/>
  <key name="home" qpos="1 2 3 0.6 0.8 0 0  0.5 -0.5 1 0.8 0 0.6 0  0.7  0.4
    0.1 0.2 0.3  0.6 0 0 0.8  0.4 0.5 0.6 0.7 0.8"/>
</keyframe></mujoco>"""
LIMB = """<body name="{s}/1" pos="0 {y} 0.3"><joint name="{s}/1" axis="0 0 1"/><geom/>
<body name="{s}/2" pos="0.1 0 0.05"><joint name="{s}/2" axis="0 1 0" ref="0.2"/><geom/>
<body name="{s}/3" pos="0.3 0 0"><joint name="{s}/3" axis="0 1 0" pos="0 0 0.02"/><geom/>
<site name="{s}/tcp" pos="0.2 0 0.05"/>{hand}</body></body></body>"""
HAND = """<body name="finger" pos="0.2 0 0"><joint name="finger" axis="1 0 0"/><geom/></body>
<body name="thumb" pos="0.2 0 0.1"><joint name="thumb" axis="1 0 0"/><geom/></body>"""
# By joint, what it is in the keyframe.
STAND = {
    "crate": [1, 2, 3, 0.6, 0.8, 0, 0], "floating": [0.5, -0.5, 1, 0.8, 0, 0.6, 0], "tail": [0.0],
    "lift": [0.25], "right/1": [-0.5], "right/2": [0.6], "right/3": [0.4],
    "neck": [0.6, 0, 0, 0.8], "left/1": [0.3], "left/2": [-0.2], "left/3": [0.7],
    "finger": [0.2], "thumb": [0.01 + 2 * 0.2],
}  # fmt: skip


def hall(folder: Path, apart: float = 0.0) -> dict:
    """Both arms of one robot, or of two where they stand apart."""
    limbs = {s: LIMB.format(s=s, y=y, hand=hand) for s, y, hand in
             (("left", 0.2, HAND), ("right", -0.2, ""))}  # fmt: skip
    (folder / "robot").mkdir()
    (folder / "robot/hall.xml").write_text(HALL.format(**limbs))
    arms = [
        {
            "name": s, "mjcf": "robot/hall.xml", "tip": f"{s}/tcp", "root": "pelvis",
            "locked": {"lift": 0.25, "finger": 0.2},
            "base": {"position": [0.2, 0.1 + apart * (s == "left"), 1.5], "rpy": [0.1, 0.2, 0.3]},
            "start": [x for name, (x, *_) in STAND.items() if name.startswith(s)],
        }
        for s in ("left", "right")
    ]  # fmt: skip
    space = {"task": {"space": "spatial-linear"}}
    cell = {"format": 1, "name": "home", "object": {"mass": 1.0}, "arms": arms} | space
    (folder / "cell.toml").write_text(toml(cell))
    return cell


def seen(folder: Path, key: str, base: dict) -> tuple[mujoco.MjModel, mujoco.MjData, pin.SE3]:
    """What MuJoCo has of a keyframe in a file beside the model, and the pelvis in the problem."""
    parts = "".join(f'<include file="{name}"/>' for name in ("robot/hall.xml", "keys.xml"))
    (folder / "all.xml").write_text(f"<mujoco>{parts}</mujoco>")
    model = mujoco.MjModel.from_xml_path(str(folder / "all.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    mujoco.mj_forward(model, data)
    pelvis = data.body("pelvis")
    place = pin.SE3(pin.rpy.rpyToMatrix(*base["rpy"]), np.array(base["position"]))
    return model, data, place * pin.SE3(pelvis.xmat.reshape(3, 3), pelvis.xpos).inverse()


def test_mujoco_stands_as_the_result_does(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    cell = hall(tmp_path)
    assert main(["evaluate", "cell.toml", "--quiet", "-o", "out"]) == 0
    solution = copose.read_solution("out/result.json")
    assert main(["export", "out/result.json", "--to", "mujoco", "-o", "keys.xml"]) == 0
    # The model has a keyframe that is called as the problem is.
    model, data, place = seen(tmp_path, "home'", cell["arms"][0]["base"])
    for s, there in solution.after.arms.items():
        assert np.abs(place * data.site(f"{s}/tcp").xpos - there.skeleton[-1]).max() < 1e-9
    for name, positions in STAND.items():
        address = model.joint(name).qposadr[0]
        assert data.qpos[address : address + len(positions)].tolist() == positions, name
    # What follows what is what MuJoCo itself wants.
    assert model.neq == 1 and data.nefc > 0 and abs(data.efc_pos[0]) < 1e-12


def test_robots_that_stand_apart_have_a_keyframe_each(tmp_path: Path) -> None:
    cell = hall(tmp_path, apart=0.5)
    problem = copose.load(tmp_path / "cell.toml")
    solution = copose.evaluate(problem)
    copose.export(solution, "mujoco", tmp_path / "keys.xml", problem=problem)
    for arm in cell["arms"]:
        s = arm["name"]
        _, data, place = seen(tmp_path, f"home {s}", arm["base"])
        found = place * data.site(f"{s}/tcp").xpos
        assert np.abs(found - solution.after.arms[s].skeleton[-1]).max() < 1e-9


def test_mujoco_needs_the_problem(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    hall(tmp_path)
    solution = copose.evaluate(copose.load("cell.toml"))
    Path("result.json").write_text(to_json(solution))
    Path("cell.toml").rename("moved.toml")
    export = ["export", "result.json", "--to", "mujoco", "--quiet"]
    assert main(export) == 2
    told = "copose: cell.toml: no such file (the result names this file; --problem names another)\n"
    assert capsys.readouterr().err == told and not Path("keyframe.xml").exists()
    assert main([*export, "--problem", "moved.toml"]) == 0
    assert Path("keyframe.xml").read_text() == exported_text(
        solution, "mujoco", problem=copose.load("moved.toml")
    )
    with pytest.raises(InputError, match="names no problem file"):
        exported_text(held(), "mujoco")
    with pytest.raises(InputError, match="arms or joints than the result"):
        exported_text(held(), "mujoco", problem=copose.load("moved.toml"))
    lifted = Path("moved.toml").read_text().replace("0.25", "0.3")
    Path("lifted.toml").write_text(lifted)
    with pytest.raises(InputError, match="has arm 'left' stand otherwise than the result; give"):
        exported_text(solution, "mujoco", problem=copose.load("lifted.toml"))
    with pytest.raises(InputError, match="is no MuJoCo model"):
        exported_text(held(), "mujoco", problem=copose.parse(tables("baxter-box")))
    assert main([*export, "--problem", "moved.toml", "-o", "moved.toml"]) == 2
    assert "moved.toml: is read; the export needs a file of its own" in capsys.readouterr().err


def test_motions() -> None:
    motion = made(space="spatial")
    trajectory = yaml.safe_load(exported_text(motion, "moveit"))
    assert list(trajectory) == ["joint_trajectory"]
    assert trajectory["joint_trajectory"] == yaml.safe_load(exported_text(motion, "ros"))
    rows = list(csv.reader(io.StringIO(exported_text(motion, "csv"))))
    assert [float(row[0]) for row in rows[1:]] == list(motion.time)
    for to in ("srdf", "mujoco"):
        with pytest.raises(InputError, match=f"is a motion, and {to} holds one posture; allowed"):
            exported_text(motion, to)
    with pytest.raises(InputError, match="a motion has no cases"):
        exported_text(motion, "csv", case="a")
    with pytest.raises(InputError, match=r"no motion to export, it is infeasible: .*its grasp"):
        exported_text(nowhere(), "csv")


def test_planar_arms_have_no_robot_file() -> None:
    cell = planar()
    for arm in cell["arms"]:
        arm["start"] = arm.get("start", [0.3] * len(arm["links"]))
        del arm["grasp"]
    solution = copose.evaluate(copose.parse(cell))
    assert yaml.safe_load(exported_text(solution, "ros"))["name"][0] == "a1_joint1"
    assert exported_text(solution, "csv").startswith("a1/joint1,")
    for result, to in ((solution, "moveit"), (solution, "srdf"), (made(), "mujoco")):
        with pytest.raises(InputError, match=f"no robot file, which {to} is about; allowed: ros, "):
            exported_text(result, to)


def test_of_cases_the_first_or_the_one_that_is_named() -> None:
    solution = held()
    data = {key: getattr(solution.after, key) for key in solution.after.model_fields_set}
    low, high = (
        copose.results.CasePosture(
            **data | {"joints": dict.fromkeys(("left", "right"), (x,) * 7)},
            name=name, weight=1.0, objective=None,
        )
        for name, x in (("low", 0.1), ("high", 0.2))
    )  # fmt: skip
    several = solution.model_copy(update={"after": None, "cases": (low, high)})
    assert exported_text(several, "csv") == exported_text(several, "csv", case="low")
    assert ",0.2," in exported_text(several, "csv", case="high")
    with pytest.raises(InputError, match="no case is called 'hihg'; did you mean 'high'"):
        exported_text(several, "csv", case="hihg")
    with pytest.raises(InputError, match="the result has no cases"):
        exported_text(solution, "csv", case="low")


def test_the_command_writes_beside_the_result(tmp_path: Path, capsys) -> None:
    file = tmp_path / "out/result.json"
    file.parent.mkdir()
    file.write_text(to_json(held()))
    for to, name in (("moveit", "robot_state.yaml"), ("srdf", "group_state.srdf"),
                     ("ros", "joint_state.yaml"), ("csv", "posture.csv")):  # fmt: skip
        assert main(["export", str(file), "--to", to]) == 0
        assert capsys.readouterr().out == f"written to {file.parent / name}\n"
        assert (file.parent / name).read_text() == exported_text(held(), to)
    alike = read_result(Path(__file__).parent / "snapshots/spatial.json")
    file.write_text(to_json(alike))
    assert main(["export", str(file), "--to", "ros"]) == 0
    told = "arms share joint names: theirs are ARM_JOINT here, such as left_panda_joint1\n"
    assert capsys.readouterr().out.startswith(told)
    file.write_text(to_json(made()))
    assert main(["export", str(file), "--to", "ros", "-o", str(tmp_path / "t.yaml")]) == 0
    assert (tmp_path / "t.yaml").read_text() == exported_text(made(), "ros")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--to", "gif"], "argument --to: invalid choice: 'gif' (choose from "),
        ([], "the following arguments are required: --to"),
        (["--to", "csv", "-o", "{file}"], "is read; the export needs a file of its own"),
        (["--to", "csv"], "has no posture to export, it is infeasible: arms are short"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, capsys, arguments, told) -> None:
    changes = {"status": "infeasible", "reason": "arms are short", "after": None}
    file = tmp_path / "result.json"
    solution = held().model_copy(update=changes) if arguments == ["--to", "csv"] else held()
    file.write_text(to_json(solution))
    assert main(["export", str(file), *(each.format(file=file) for each in arguments)]) == 2
    printed = capsys.readouterr().err
    assert told in printed
    assert printed.count("\n") == 1 and [*tmp_path.iterdir()] == [file]


@pytest.mark.parametrize("text", ["", "[]", "{", '{"knots": 3}', '{"format": 1}', "null"])
def test_what_is_no_result_is_refused(tmp_path: Path, capsys, text: str) -> None:
    (tmp_path / "r.json").write_text(text)
    assert main(["export", str(tmp_path / "r.json"), "--to", "csv"]) == 2
    assert "r.json: is no copose result (" in capsys.readouterr().err


def test_arms_in_two_orders_are_refused(tmp_path: Path) -> None:
    data = json.loads(to_json(made()))
    knot = data["knots"][0]
    knot["joints"] = dict(reversed(knot["joints"].items()))
    (tmp_path / "r.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"knots\.0\.joints: not those that joint_names lists"):
        read_result(tmp_path / "r.json")


def test_the_command_knows_the_formats() -> None:
    assert tuple(FORMATS) == TO
    with pytest.raises(InputError, match="'mujico' is no format; did you mean 'mujoco'"):
        exported_text(held(), "mujico")
    assert isinstance(made(), Motion)
