"""Robots as their files are found in the wild: what is passed over, and what is refused by name."""

from __future__ import annotations

import concurrent.futures
import math
import os
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import copose
from cells import planar
from copose.errors import InputError
from copose.loader import load, parse
from copose.robots import Arm, load_arms
from test_robots import INERTIAL, LIMIT, problem_of, refused, robot

SPHERE = '<geometry><sphere radius="0.05"/></geometry>'


def gripper(first: str = "", second: str = "", third: str = "") -> str:
    """Three sliding fingers on the last link, with chosen extra elements in their joints."""
    return "".join(
        f'<link name="{name}">{INERTIAL}</link><joint name="{name}" type="prismatic">'
        f'<parent link="{on}"/><child link="{name}"/><origin xyz="0 0 0.1" rpy="0.3 0 0.2"/>'
        f'<axis xyz="1 2 0"/>{LIMIT}{extra}</joint>'
        for name, on, extra in (("f1", "l6", first), ("f2", "l6", second), ("f3", "f2", third))
    )


def arms_of(text: str, folder: Path, **arm: object) -> tuple[Arm, ...]:
    return load_arms(_problem(text, folder, **arm))


def same(one: Arm, other: Arm) -> bool:
    """Whether two arms move alike within the same limits."""
    limits = ("lower", "upper", "velocity", "effort")
    return one.fingerprint == other.fingerprint and all(
        getattr(a, what) == getattr(b, what)
        for a, b in zip(one.joints, other.joints, strict=True)
        for what in limits
    )


def within(more: str) -> str:
    """The plain robot with something more in every link."""
    return PLAIN.replace("</link>", f"{more}</link>")


def wheel(joint: str, kind: str = "revolute", inertial: str = "") -> str:
    """The plain robot with a link beside its chain."""
    return robot(
        more=f'<link name="w">{inertial}</link><joint name="w" type="{kind}">'
        f'<parent link="base"/><child link="w"/>{joint}</joint>'
    )


PLAIN = robot()
HEAD = '<robot name="r">'
ODD = {
    "default namespace": PLAIN.replace(HEAD, '<robot name="r" xmlns="http://www.ros.org">'),
    "unbound prefix": robot(more="<gz:plugin><gz:x/></gz:plugin>"),
    "unbound prefix of an attribute": PLAIN.replace(HEAD, '<robot name="r" a:b="c">'),
    "no name of its own": PLAIN.replace(HEAD, "<robot>"),
    "xacro left over": robot(more='<xacro:property name="a" value="1"/>'),
    "comment with dashes": PLAIN.replace(HEAD, f"<!-- a -- b --->{HEAD}<!-- <link/> -->"),
    "blank before the declaration": f'\n <?xml version="1.1" encoding="klingon"?>\n{PLAIN}',
    "unnamed material": within(f"<visual>{SPHERE}<material/></visual>"),
    "materials twice": robot(more='<material name="k"/><material name="k"/>'),
    "capsule without version": within(
        '<collision><geometry><capsule radius="1" length="2"/></geometry></collision>'
    ),
    "odd scale": within(
        '<visual><geometry><mesh filename="a.stl" scale="1 x"/></geometry></visual>'
    ),
    "transmission": robot(more='<transmission><joint name="j0"/></transmission>'),
    "sensor": robot(more='<sensor name="s"><origin xyz="?"/></sensor>'),
    "blanks": PLAIN.replace('xyz="0 0.02 0.15"', 'xyz=" 0\n+.02\t1.5e-1 "'),
    "wheel without effort": wheel('<limit lower="-1" upper="1" velocity="2"/>'),
    "wheel with broken numbers": wheel(
        '<limit lower="x" upper="1"/><axis xyz="0 0 0"/><origin xyz="nan 0 0"/>',
        inertial=INERTIAL.replace("0.01", "?"),
    ),
    "wheel of no kind": wheel('<mimic joint="gone" multiplier="?"/>', kind=""),
    "wheel that follows nothing": wheel('<mimic joint="gone"/>'),
}


@pytest.mark.parametrize("name", ODD)
def test_a_robot_is_not_refused_over_what_is_not_needed(name: str, tmp_path: Path, capfd) -> None:
    (plain,) = arms_of(PLAIN, tmp_path)
    (arm,) = arms_of(ODD[name], tmp_path)
    assert ODD[name] != PLAIN and same(arm, plain)
    captured = capfd.readouterr()
    assert captured.err == "" and captured.out == ""


@pytest.mark.parametrize(
    ("encoding", "mark"),
    [
        ("utf-8", "\ufeff"),
        ("utf-16", ""),
        ("utf-16-le", "\ufeff"),
        ("utf-16-be", ""),
        ("utf-32", ""),
        ("iso-8859-1", ""),
        ("windows-1252", ""),
        ("shift_jis", ""),
    ],
)
@pytest.mark.parametrize("declared", [True, False])
def test_encodings(encoding: str, mark: str, declared: bool, tmp_path: Path) -> None:
    """Whatever a file declares; where it does not, what its first bytes say, or Latin-1."""
    letter = "テ" if encoding == "shift_jis" else "ö"
    head = f'{mark}<?xml version="1.0" encoding="{encoding}"?>' if declared else mark
    text = head + f"<!-- {letter} -->" + PLAIN.replace('"l6"', f'"l{letter}"')
    (tmp_path / "robot.urdf").write_bytes(text.encode(encoding))
    known = declared or encoding != "shift_jis"
    tip = f"l{letter}" if known else "l" + letter.encode(encoding).decode("latin-1")
    cell = problem_of("robot.urdf", tip=tip)
    (arm,) = load_arms(parse(cell, source=tmp_path / "p.toml"))
    (plain,) = arms_of(PLAIN, tmp_path)
    assert same(arm, plain)


def test_a_byte_order_mark_before_a_problem(tmp_path: Path) -> None:
    from cells import toml

    (tmp_path / "p.toml").write_bytes(b"\xef\xbb\xbf" + toml(planar()).encode())
    assert load(tmp_path / "p.toml").name == "cell"


def test_real_xacro_is_told(tmp_path: Path) -> None:
    """What xacro left matters where the robot cannot be read without it."""
    call = '<xacro:gripper parent="l6"/></robot>'
    notes = copose.check(_problem(PLAIN.replace("</robot>", call), tmp_path)).notes
    assert any("xacro left in it is passed over: xacro:gripper" in note for note in notes)
    for text, arm in (
        (PLAIN.replace("</robot>", call), {"tip": "finger"}),
        (PLAIN.replace('upper="2"', 'upper="${a}"').replace("</robot>", call), {}),
        (PLAIN.replace(f'<link name="l3">{INERTIAL}</link>', '<xacro:link name="l3"/>'), {}),
    ):
        assert "is xacro, not URDF; run: xacro robot.urdf" in refused(text, tmp_path, **arm)


def test_links_off_the_chain_matter_to_collisions(tmp_path: Path) -> None:
    shape = f"<collision>{SPHERE}</collision>"
    text = wheel('<origin xyz="?"/>', inertial=shape).replace("</inertial>", f"</inertial>{shape}")
    copose.check(_problem(text, tmp_path))
    asked = problem_of("robot.urdf") | {"constraints": {"collision": True}}
    with pytest.raises(InputError, match=r"arms\[0\] \(arm\): joint 'w': xyz of <origin> is '\?'"):
        copose.check(parse(asked, source=tmp_path / "p.toml"))


def _problem(text: str, folder: Path, **arm: object) -> copose.Problem:
    (folder / "robot.urdf").write_text(text)
    return parse(problem_of("robot.urdf", **arm), source=folder / "p.toml")


ORIGIN, AXIS = 'xyz="0 0.02 0.15" rpy="0.1 0 0"', 'axis xyz="0 1 0"'
BROKEN = [
    (ORIGIN, 'xyz="0 0.02"', "'j0': xyz of <origin> is '0 0.02'; 3 numbers within"),
    (ORIGIN, 'xyz="0 0 1e400"', "joint 'j0': xyz of <origin> is '0 0 1e400'"),
    (ORIGIN, 'xyz="0 0 1_0"', "joint 'j0': xyz of <origin> is '0 0 1_0'"),
    (ORIGIN, 'rpy="0,1 0 0"', "joint 'j0': rpy of <origin> is '0,1 0 0'"),
    (AXIS, 'axis xyz="0 1"', "joint 'j1': xyz of <axis> is '0 1'; 3 numbers within"),
    (AXIS, "axis", "joint 'j1': <axis> has no xyz"),
    (LIMIT, LIMIT.replace('"-2"', '"a"'), "'j0': lower of <limit> is 'a'; a number is needed"),
    (LIMIT, LIMIT.replace('"2"', '"nan"'), "joint 'j0': upper of <limit> is 'nan'"),
    (LIMIT, "", "joint 'j0': <joint> has no <limit>; correct it, or give position_limits"),
    ('<mass value="1"/>', "", "link 'l0': <inertial> has no <mass>"),
    ('<mass value="1"/>', '<mass value="-1"/>', "link 'l0': its mass is -1, below zero"),
    ('izz="0.01"', "", "link 'l0': <inertia> has no izz"),
    ('izz="0.01"', 'izz="inf"', "link 'l0': izz of <inertia> is 'inf'; a number within ±1e+09 is"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "expected"), BROKEN, ids=range(len(BROKEN)))
def test_what_is_needed_is_named(old: str, new: str, expected: str, tmp_path: Path) -> None:
    message = refused(PLAIN.replace(old, new, 1), tmp_path)
    assert "arms[0] (arm): " in message and expected in message


def test_all_faults_are_told_at_once(tmp_path: Path) -> None:
    text = robot(
        kinds={2: "floating"}, limits={3: ""}, inertial={4: INERTIAL.replace("mass", "mas")},
        extra={5: '<mimic joint="j0"/>'},
    ).replace(AXIS, "axis")  # fmt: skip
    message = refused(text, tmp_path)
    for part in ("'j1': <axis>", "'j2' on the chain is floating", "'j3': <joint>",
                 "'l4': <inertial>", "'j5' mimics 'j0'"):  # fmt: skip
        assert part in message
    every = refused(PLAIN.replace("axis xyz", "axis xy").replace("mass", "mas"), tmp_path)
    assert len(every) <= 580 and every.endswith(" more)") and "'j0'" in every and "'j4'" in every


@pytest.mark.parametrize("free", [0, 1])
def test_effort_is_told_of_all_joints_that_lack_it(free: int, tmp_path: Path) -> None:
    limits = dict.fromkeys((2, 5), '<limit lower="-1" upper="1" velocity="1"/>')
    problem = problem_of("robot.urdf") | {"objective": {"kind": "payload"}}
    (tmp_path / "robot.urdf").write_text(robot(limits=limits))
    if free:
        problem["arms"][0]["locked"] = {"j2": 0.0}
        problem["task"]["space"] = "spatial-linear"
    named = "'j5' has none" if free else "'j2', 'j5' have none"
    with pytest.raises(InputError, match=rf"arms\[0\] \(arm\).torque_limits: .* joint; {named}"):
        copose.check(parse(problem, source=tmp_path / "p.toml"))


HUGE = ["1e6", "1e16", "3.4e38", "1.7976931348623157e308", "1e400", "inf"]


@pytest.mark.parametrize("size", HUGE)
@pytest.mark.parametrize("sides", [(-1, 1), (-1, 0), (0, 1)])
def test_huge_position_limits_are_none(size: str, sides: tuple, tmp_path: Path) -> None:
    low, high = (f"{'-' if side < 0 else ''}{size}" if side else None for side in sides)
    limit = f'<limit lower="{low or -1}" upper="{high or 1}" effort="1" velocity="1"/>'
    (arm,) = arms_of(robot(limits={4: limit}), tmp_path)
    joint = arm.joints[4]
    assert (joint.lower, joint.upper) == (-np.inf if low else -1, np.inf if high else 1)
    told = "arm 'arm': position limits of 1e6 and more count as none: j4"
    assert arm.notes == ((told,) if math.isfinite(float(size)) else ())
    limits = [[-1.0, 1.0]] * 4 + [[float(low or -1), float(high or 1)]] + [[-1.0, 1.0]] * 2
    (given,) = arms_of(PLAIN, tmp_path, position_limits=limits)
    assert (given.joints[4].lower, given.joints[4].upper) == (joint.lower, joint.upper)
    if math.isfinite(float(size)):
        cell = planar()
        cell["arms"][1]["position_limits"] = [
            [-1, 1],
            [float(low or -1), float(high or 1)],
            [-1, 1],
        ]
        other = load_arms(parse(cell))[1]
        joint = other.joints[1]
        assert (joint.lower, joint.upper) == (-np.inf if low else -1, np.inf if high else 1)
        assert other.notes == (told.replace("'arm'", "'a2'").replace("j4", "joint2"),)


def test_notes_on_limits_are_told_with_results(tmp_path: Path) -> None:
    limit = '<limit lower="-1e9" upper="1" effort="0" velocity="1"/>'
    problem = _problem(robot(limits={4: limit}), tmp_path)
    notes = load_arms(problem)[0].notes
    assert len(notes) == 2 and set(notes) <= set(copose.check(problem).notes)


@pytest.mark.parametrize(
    "limit", [LIMIT.replace('"2"', '"1e9"'), LIMIT.replace('"-2"', '"-1e16"'), ""]
)
def test_a_prismatic_joint_needs_limits(limit: str, tmp_path: Path) -> None:
    sliding = robot(kinds={3: "prismatic"}, limits={3: limit})
    message = refused(sliding, tmp_path)
    assert "joint 'j3'" in message and "position_limits" in message
    limits = [[-1.0, 1.0]] * 3 + [[-np.inf, 1.0]] + [[-1.0, 1.0]] * 3
    assert "prismatic joint 'j3' needs" in refused(sliding, tmp_path, position_limits=limits)
    (arm,) = arms_of(sliding, tmp_path, position_limits=[[-1.0, 1.0]] * 7)
    assert arm.joints[3].upper == 1


@pytest.mark.parametrize("value", ["0", "-1", "-inf", "x", "nan"])
def test_limits_that_are_not_above_zero_are_not_given(value: str, tmp_path: Path) -> None:
    limits = {3: f'<limit lower="-2" upper="2" effort="{value}" velocity="{value}"/>'}
    (arm,) = arms_of(robot(limits=limits), tmp_path)
    assert arm.joints[3].effort == arm.joints[3].velocity == np.inf
    for what, note in zip(("velocity", "effort"), arm.notes, strict=True):
        assert f"'arm': limits of {what} that are not above zero" in note and "j3 (" in note
    given = [5.0] * 3 + [1e12] + [math.inf] + [-math.inf] + [2]
    (arm,) = arms_of(robot(limits=limits), tmp_path, torque_limits=given, velocity_limits=[1.0] * 7)
    assert [joint.effort for joint in arm.joints] == [5, 5, 5, 1e12, np.inf, np.inf, 2]
    assert arm.notes == ()


def pinocchios(text: str, positions: dict[str, float]) -> tuple[pin.Model, pin.Data]:
    """A robot by Pinocchio, which knows what mimics, with its leaders at some positions."""
    model = pin.buildModelFromXML(text, mimic=True)
    data, q = model.createData(), pin.neutral(model)
    for name, value in positions.items():
        q[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    return model, data


@pytest.mark.parametrize("at", [0.0, 0.4])
def test_followers_stand_where_their_leaders_put_them(at: float, tmp_path: Path) -> None:
    """Against Pinocchio, and the closed form of a leader that follows another."""
    mimic = '<mimic joint="f1" multiplier="-0.5" offset="0.3"/>'
    text = robot(more=gripper(second=mimic, third='<mimic joint="f1" multiplier="2"/>'))
    (arm,) = arms_of(text, tmp_path, locked={"f1": at} if at else {})
    assert {j.name: j.position for j in arm.locked} == {"f1": at, "f2": 0.3 - at / 2, "f3": 2 * at}
    model, data = pinocchios(text, {"f1": at})
    last = data.oMi[model.getJointId("j6")]
    mass, moment = 0.0, np.zeros(3)
    for name in ("l6", "f1", "f2", "f3"):
        place = last.inverse() * data.oMf[model.getFrameId(name, pin.FrameType.BODY)]
        mass, moment = mass + 1.0, moment + place.act(np.array([0.0, 0.0, 0.1]))
    assert arm.joints[6].body.mass == mass
    assert np.allclose(arm.joints[6].body.com, moment / mass, rtol=0, atol=1e-14)
    chained = robot(more=gripper(second=mimic, third='<mimic joint="f2" multiplier="3"/>'))
    (arm,) = arms_of(chained, tmp_path, locked={"f1": at})
    assert arm.locked[-1].position == pytest.approx(3 * (0.3 - at / 2))
    (own,) = arms_of(chained, tmp_path, locked={"f1": at, "f2": 0.1})
    assert [j.position for j in own.locked] == pytest.approx([at, 0.1, 0.3])


def test_followers_on_the_chain_stand_too(tmp_path: Path) -> None:
    """The tip on a finger whose leader is off the chain."""
    text = robot(more=gripper(second='<mimic joint="f1" multiplier="1.5" offset="-0.1"/>'))
    (arm,) = arms_of(text, tmp_path, tip="f2", locked={"f1": 0.4})
    model, data = pinocchios(text, {"f1": 0.4})
    tip = data.oMf[model.getFrameId("f2", pin.FrameType.BODY)]
    place = data.oMi[model.getJointId("j6")].inverse() * tip
    assert arm.n == 7
    assert np.allclose(arm.tip.position, place.translation, rtol=0, atol=1e-14)
    assert np.allclose(arm.tip.rotation, place.rotation, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("extra", "parts"),
    [
        ({"first": '<mimic joint="j3"/>'}, ["joint 'f1' mimics 'j3', which is free"]),
        ({"first": '<mimic joint="f2"/>', "second": '<mimic joint="j3"/>'}, ["'f1'", "'f2'"]),
        ({"first": '<mimic joint="gone"/>'}, ["'f1' mimics 'gone', which is no movable joint"]),
        ({"third": '<mimic joint="f3"/>'}, ["joint 'f3' mimics itself"]),
        ({"first": '<mimic joint="f2"/>', "second": '<mimic joint="f1"/>'}, ["'f1', 'f2' mimic"]),
        ({"second": '<mimic joint="f1" multiplier="x"/>'}, ["'f2': multiplier of <mimic> is 'x'"]),
    ],
)  # fmt: skip
def test_followers_that_cannot_stand(extra: dict, parts: list[str], tmp_path: Path) -> None:
    text = robot(more=gripper(**extra))
    message = refused(text, tmp_path)
    assert all(part in message for part in parts)
    arms_of(text, tmp_path, locked={"f1": 0.1, "f2": 0.0, "f3": 0.0})


def test_quaternions_of_origins(tmp_path: Path) -> None:
    half = math.sqrt(0.5)
    turned = f'xyz="0 0.02 0.15" quat_xyzw="0 0 {2 * half} {2 * half}"'
    (arm,) = arms_of(PLAIN.replace(ORIGIN, turned), tmp_path)
    expected = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    assert np.allclose(arm.joints[3].placement.rotation, expected, rtol=0, atol=1e-15)
    message = refused(PLAIN.replace(ORIGIN, 'quat_xyzw="0 0 0 0"', 1), tmp_path)
    assert "joint 'j0': quat_xyzw is zero" in message


def kinematic(text: str, folder: Path, **tables: object) -> tuple[copose.Problem, np.ndarray]:
    """A robot that holds the object where its tip is at a start, and the tip's Jacobian there."""
    model = pin.buildModelFromXML(robot())
    q, data = np.array([0.3, -0.5, 0.4, 0.7, -0.6, 0.2, 0.1]), model.createData()
    tip = model.getFrameId("l6", pin.FrameType.BODY)
    J = pin.computeFrameJacobian(model, data, q, tip, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    cell = problem_of("robot.urdf", start=q.tolist()) | tables
    cell["object"] |= {
        "position": data.oMf[tip].translation.tolist(),
        "rpy": pin.rpy.matrixToRpy(data.oMf[tip].rotation).tolist(),
    }
    (folder / "robot.urdf").write_text(text)
    return parse(cell, source=folder / "p.toml"), J


@pytest.mark.parametrize("inertial", ["", INERTIAL.replace("izz", "zz")])
def test_kinematics_need_no_inertials(inertial: str, tmp_path: Path) -> None:
    bare = robot(inertial=dict.fromkeys(range(7), inertial))
    problem, J = kinematic(bare, tmp_path, objective={"kind": "velocity-volume"})
    solution = copose.evaluate(problem)
    assert solution.status == "solved" and solution.after is not None
    expected = 0.5 * np.linalg.slogdet(J @ J.T)[1] + 3 * math.log(math.pi) - math.log(6)
    assert solution.objective.after == pytest.approx(expected, abs=1e-9)
    assert solution.after.ellipsoid.gram is None
    assert solution.after.log_volumes == {"pseudoinverse": None, "torque-optimal": None}
    assert solution.after.arms["arm"].ellipsoid.gram is None
    assert solution.after.payload is None and solution.after.static_torque is None
    assert any("no dynamic ellipsoid" in note and "'arm'" in note for note in solution.notes)
    assert copose.verify(problem, solution) == ()
    for tables in (
        {},
        {"objective": {"kind": "velocity-volume"}, "constraints": {"static_torque": True}},
    ):
        with pytest.raises(InputError, match=r"inertials|izz"):
            copose.check(kinematic(bare, tmp_path, **tables)[0])


def test_searches_need_no_inertials(tmp_path: Path) -> None:
    """The best posture is the one that the same arm with inertials has; a path has no torques."""
    answers = []
    for text in (robot(), robot(inertial=dict.fromkeys(range(7), ""))):
        problem, _ = kinematic(text, tmp_path, objective={"kind": "velocity-volume"})
        answers.append(copose.solve(problem, effort="low").objective.after)
    assert answers[0] == pytest.approx(answers[1], abs=1e-9)


def test_packages_by_the_problem_file(tmp_path: Path, monkeypatch) -> None:
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)
    place = tmp_path / "elsewhere/some folder"
    (place / "urdf").mkdir(parents=True)
    (place / "urdf/arm.urdf").write_text(PLAIN)
    cell = problem_of("package://pack/urdf/arm.urdf", packages={"pack": "../elsewhere/some folder"})
    source = tmp_path / "problems/p.toml"
    assert load_arms(parse(cell, source=source))[0].n == 7
    del cell["arms"][0]["packages"]
    with pytest.raises(InputError) as caught:
        load_arms(parse(cell, source=source))
    for way in ("packages = { pack = ", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "not set"):
        assert way in str(caught.value)
    cell["arms"][0]["packages"] = {"pack": "nowhere"}
    with pytest.raises(InputError, match=rf"tried {tmp_path}/problems/nowhere"):
        load_arms(parse(cell, source=source))


def test_packages_of_meshes(tmp_path: Path, monkeypatch) -> None:
    import struct

    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    corners = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    triangles = b"".join(
        struct.pack("<12fH", 0, 0, 0, *(x for i in face for x in corners[i]), 0) for face in faces
    )
    (tmp_path / "m").mkdir()
    (tmp_path / "m/a.stl").write_bytes(b"\0" * 80 + struct.pack("<I", 4) + triangles)
    shape = '<geometry><mesh filename="package://pack/a.stl"/></geometry>'
    text = robot(inertial=dict.fromkeys(range(7), f"{INERTIAL}<collision>{shape}</collision>"))
    (tmp_path / "robot.urdf").write_text(text)
    cell = problem_of("robot.urdf") | {"constraints": {"collision": True}}
    with pytest.raises(InputError) as caught:
        copose.check(parse(cell, source=tmp_path / "p.toml"))
    message = str(caught.value)
    for part in ("'pack' was not found; name its folder by packages", "ROS_PACKAGE_PATH",
                 "AMENT_PREFIX_PATH (tried", str(tmp_path / "pack")):  # fmt: skip
        assert part in message
    cell["arms"][0]["packages"] = {"pack": "m"}
    assert not any("pack" in n for n in copose.check(parse(cell, source=tmp_path / "p.toml")).notes)


def test_all_common_joints_are_told_with_what_to_paste(tmp_path: Path) -> None:
    branch = (
        f'<link name="g">{INERTIAL}</link><joint name="g 1" type="revolute"><parent link="l2"/>'
        f'<child link="g"/><axis xyz="1 0 0"/>{LIMIT}</joint>'
    )
    cell = problem_of("robot.urdf", locked={"j1": 0.5})
    cell["task"]["space"] = "spatial-linear"
    cell["arms"].append(cell["arms"][0] | {"name": "other", "tip": "g", "locked": {}})
    (tmp_path / "robot.urdf").write_text(robot(more=branch))
    with pytest.raises(InputError) as caught:
        load_arms(parse(cell, source=tmp_path / "p.toml"))
    assert caught.value.key == "arms[1] (other).locked"
    assert "both hang on j0, j1, j2, and" in str(caught.value)
    assert "locked = { j0 = 0.0, j1 = 0.5, j2 = 0.0 }" in str(caught.value)


def test_scalars_of_numpy_are_numbers() -> None:
    cell = planar()
    cell["search"] = {"seed": np.int64(3)}
    cell["object"]["mass"] = np.float32(0.5)
    cell["constraints"] = {"static_torque": np.bool_(False)}
    problem = parse(cell)
    assert (problem.search.seed, problem.object.mass) == (3, 0.5)
    assert type(problem.search.seed) is int
    with pytest.raises(InputError, match=r"search.seed: 3\.0 must be a whole number"):
        parse(cell | {"search": {"seed": np.float64(3)}})
    planner = copose.Planner(problem)
    one, other = (planner.solve(seed=seed, effort="low") for seed in (np.int64(5), 5))
    assert one.search.seed == 5 and one.objective == other.objective


@pytest.mark.parametrize("free", [True, False])
def test_a_chain_of_two_thousand_links(free: bool, tmp_path: Path) -> None:
    count = 2000
    parts = [f'<link name="k{i}">{INERTIAL}</link>' for i in range(count)]
    parts += [
        f'<joint name="i{i}" type="revolute"><parent link="k{i}"/><child link="k{i + 1}"/>'
        f'<origin xyz="0 0 1e-3"/><axis xyz="{i % 2} 0 {1 - i % 2}"/>{LIMIT}</joint>'
        for i in range(count - 1)
    ]
    text = f'<robot name="long">{"".join(parts)}</robot>'
    locked = {} if free else {f"i{i}": 0.001 for i in range(count - 1) if i % 250}
    began = time.process_time()
    if free:
        message = refused(text, tmp_path, tip=f"k{count - 1}")
        assert "has 1999 free joints; at most 32 can be used" in message
    else:
        (arm,) = arms_of(text, tmp_path, tip=f"k{count - 1}", locked=locked)
        assert arm.n == 8 and len(arm.locked) == 1991
    assert time.process_time() - began < 5


def test_threads_read_robots_and_leave_stderr_alone(tmp_path: Path) -> None:
    problem = _problem(PLAIN, tmp_path)
    before = os.fstat(2)
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: load_arms(problem)[0].fingerprint, range(40)))
    after = os.fstat(2)
    assert (after.st_dev, after.st_ino) == (before.st_dev, before.st_ino)
    assert len(set(found)) == 1
