"""MuJoCo models against MuJoCo: a robot of two arms in three files, and what is refused."""

from __future__ import annotations

import re
import sys
from functools import cache
from pathlib import Path

import casadi as ca
import mujoco
import numpy as np
import pytest

import copose
from copose import InputError
from copose.collision import Scene, configurations
from copose.commands.command_line import main
from copose.mechanics import System
from copose.problem import parse
from copose.robots import Arm, load_arms

GRAVITY = np.array([0.5, -1.0, -9.81])
# Whole motors have rotors of their own from MuJoCo 4 on.
ROTOR = 'armature="0.002"' if hasattr(mujoco.MjModel, "actuator_armature") else ""

MAIN = f"""<mujoco model="bench">
  <compiler angle="radian" autolimits="true"/>
  <option gravity="{" ".join(map(str, GRAVITY))}"/>
  <include file="parts/defaults.xml"/>
  <asset>
    <mesh name="wedge" vertex="0 0 0  0.2 0 0  0 0.15 0  0 0 0.1  0.2 0.15 0" scale="1 0.8 1"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <geom name="column" type="box" size="0.1 0.3 0.4" pos="0 0 0.4" contype="2" conaffinity="2"/>
    <include file="parts/arms.xml"/>
  </worldbody>
  <include file="parts/drives.xml"/>
  <keyframe>
    <key name="first" qpos="{"0 " * 18}"/>
    <key name="home" qpos="{"0.1 0.2 0.05 0.3 -0.4 0.5 0.6 0.02 0.01 " * 2}"/>
  </keyframe>
</mujoco>
"""
DEFAULTS = """<mujocoinclude><default>
  <joint armature="0.05" damping="0.3"/>
  <geom density="700"/>
  <default class="wrist"><joint armature="0.01" range="-2.5 2.5"/></default>
  <default class="drawn"><geom contype="0" conaffinity="0" mass="0"/></default>
</default></mujocoinclude>
"""
# {s} is the side. The shoulder has two joints with anchors of their own, one with a reference.
ARM = """<body name="{s}/shoulder" pos="0.15 {y} 0.9" euler="{roll} 0.2 -0.1">
  <joint name="{s}/1" axis="0 0 1" range="-3 2" ref="0.3"/>
  <joint name="{s}/2" axis="0.3 1 0" pos="0.02 0 -0.03" range="-2 2.2" armature="0.2"/>
  <geom type="capsule" size="0.05" fromto="0 0 0 0.1 0.05 0.2"/>
  <geom class="drawn" type="box" size="1 1 1"/>
  <body name="{s}/upper" pos="0.1 0.05 0.25" quat="0.9 0.1 -0.3 0.2">
    <inertial pos="0.01 -0.02 0.1" mass="2" fullinertia="0.02 0.03 0.025 0.001 -0.002 0.003"/>
    <joint name="{s}/lift" type="slide" axis="0 1 2" range="-0.1 0.2" ref="-0.05" armature="1.5"/>
    <geom type="cylinder" size="0.04 0.08" pos="0 0 0.1"/>
    <body name="{s}/fore" pos="0 0.02 0.25" gravcomp="0.5">
      <joint name="{s}/4" axis="0 1 0" pos="0 0.01 0" stiffness="2"/>
      <geom type="mesh" mesh="wedge" pos="0 0 0.05"/>
      <body name="{s}/spin" pos="0.05 0 0.2">
        <joint name="{s}/5" class="wrist" axis="0 0 1"/>
        <geom type="ellipsoid" size="0.04 0.05 0.09" pos="0 0 0.05"/>
        <body name="{s}/bend" pos="0 0 0.1" euler="0.3 0 0">
          <joint name="{s}/6" class="wrist" axis="1 0 0" frictionloss="0.1"/>
          <geom type="sphere" size="0.05"/>
          <include file="parts/hand_{s}.xml"/>
        </body>
      </body>
    </body>
  </body>
</body>
"""
HAND = """<mujocoinclude><body name="{s}/hand" pos="0.01 0.02 0.09">
  <joint name="{s}/7" class="wrist" axis="0 0 1"/>
  <geom type="box" size="0.05 0.03 0.02"/>
  <site name="{s}/tcp" pos="0 0 0.1" euler="0 0.4 0.2"/>
  <site name="{s}/hand" pos="0.01 0 0.05" euler="1 0 0"/>
  <body name="{s}/thumb" pos="0 0.02 0.03">
    <joint name="{s}/f1" type="slide" axis="0 1 0" range="0 0.05" ref="0.004"/>
    <geom type="box" size="0.01 0.01 0.03" pos="0 0 0.03"/>
  </body>
  <body name="{s}/finger" pos="0 -0.02 0.03">
    <joint name="{s}/f2" type="slide" axis="0 -1 0" range="-0.1 0.1" ref="0.01"/>
    <geom type="box" size="0.01 0.01 0.03" pos="0 0 0.03"/>
  </body>
</body></mujocoinclude>
"""
DRIVES = """<actuator>
  <motor joint="{s}/1" gear="-50" ctrlrange="-1 1"/>
  <position joint="{s}/2" kp="100" ctrlrange="-0.1 0.1" forcerange="-30 30" gear="2"/>
  <general joint="{s}/lift" gainprm="3" ctrlrange="-100 80" gear="2" forcerange="-500 500"/>
  <motor joint="{s}/4" forcerange="-20 20" gear="10" rotor/>
  <motor joint="{s}/6" ctrlrange="-9 9"/>
  <velocity joint="{s}/6" kv="5" forcerange="-7 7"/>
  <motor joint="{s}/7"/>
  <position tendon="{s}/grip" kp="5"/>
</actuator>
<tendon><fixed name="{s}/grip"><joint joint="{s}/f1" coef="1"/><joint joint="{s}/f2" coef="1"/>
</fixed></tendon>
<equality><joint joint1="{s}/f2" joint2="{s}/f1" polycoef="0.002 0.8 3"/></equality>
<contact><exclude body1="{s}/upper" body2="{s}/bend"/></contact>
"""
# By joint, the torque limits that follow, and the armature.
LIMITS = {
    "1": 50.0, "2": 60.0, "lift": 480.0, "4": 150.0, "5": np.inf, "6": 7.0, "7": np.inf,
}  # fmt: skip
FREE = [*LIMITS]


def bench(folder: Path) -> Path:
    """The model's files."""
    parts = folder / "robot/parts"
    parts.mkdir(parents=True)
    (folder / "robot/bench.xml").write_text(MAIN)
    (parts / "defaults.xml").write_text(DEFAULTS)
    sides = {"left": ("0.25", "-0.6"), "right": ("-0.25", "0.6")}
    arms = "".join(ARM.format(s=s, y=y, roll=roll) for s, (y, roll) in sides.items())
    arms = arms.replace('axis="0 1 0" pos="0 0.01 0"', 'axis="0 1 0" pos="0 0.01 0" '
                        'actuatorfrcrange="-150 150"')  # fmt: skip
    (parts / "arms.xml").write_text(f"<mujocoinclude>{arms}</mujocoinclude>")
    for s in sides:
        (parts / f"hand_{s}.xml").write_text(HAND.format(s=s))
    drives = "".join(DRIVES.format(s=s).replace("rotor", ROTOR) for s in sides)
    (parts / "drives.xml").write_text(f"<mujocoinclude>{drives}</mujocoinclude>")
    return folder / "robot/bench.xml"


TIPS = {"left": "left/tcp", "right": "right/hand (body)"}


def cell(**more: object) -> dict:
    """Both arms; the left one's fingers are open."""
    arms = [
        {
            "name": s, "mjcf": "robot/bench.xml", "tip": TIPS[s],
            "grasp": {"position": [0.0, 0.15 if s == "left" else -0.15, 0.0]},
            "locked": {"left/f1": 0.03},
        }
        for s in ("left", "right")
    ]  # fmt: skip
    thing = {"mass": 1.0, "inertia": [0.01] * 3, "position": [0.4, 0.0, 1.3]}
    tables = {"format": 1, "name": "x", "task": {"space": "spatial"}, "object": thing}
    return tables | {"arms": arms} | more


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    there = tmp_path_factory.mktemp("bench")
    bench(there)
    return there


@cache
def compiled(folder: Path) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(folder / "robot/bench.xml"))


def stand(model: mujoco.MjModel, joints: dict[str, np.ndarray]) -> mujoco.MjData:
    """The model at joint positions by side; left fingers open as locked, right ones at rest."""
    data = mujoco.MjData(model)
    for s, q in joints.items():
        for name, x in zip(FREE, q, strict=True):
            data.qpos[model.joint(f"{s}/{name}").qposadr[0]] = x
        x = 0.03 if s == "left" else 0.0
        data.qpos[model.joint(f"{s}/f1").qposadr[0]] = x
        data.qpos[model.joint(f"{s}/f2").qposadr[0]] = (
            0.01 + 0.002 + 0.8 * (x - 0.004) + 3 * (x - 0.004) ** 2
        )
    mujoco.mj_forward(model, data)
    return data


def drawn(rng: np.random.Generator, arms: tuple[Arm, ...]) -> dict[str, np.ndarray]:
    low, high = (np.clip([getattr(arm, end) for arm in arms], -3, 3) for end in ("lower", "upper"))
    return dict(zip(TIPS, rng.uniform(low, high), strict=True))


def test_mechanics_are_mujocos(folder: Path) -> None:
    model = compiled(folder)
    problem = parse(cell(), folder / "p.toml")
    arms = load_arms(problem)
    assert [arm.joint_names for arm in arms] == [tuple(f"{s}/{j}" for j in FREE) for s in TIPS]
    functions = {}
    for arm in System.of(problem.space, arms).arms:
        outputs = [arm.tip.position, arm.tip.rotation, arm.J, arm.M, arm.gravity_torques(GRAVITY)]
        functions[arm.arm.name] = ca.Function("all", [arm.q], outputs)
    rng = np.random.default_rng(1)
    full, linear, angular = np.zeros((model.nv, model.nv)), np.zeros((3, model.nv)), None
    for _ in range(200):
        joints = drawn(rng, arms)
        data = stand(model, joints)
        mujoco.mj_fullM(model, data, full) if ROTOR else mujoco.mj_fullM(model, full, data.qM)
        for s, q in joints.items():
            dofs = [int(model.joint(f"{s}/{name}").dofadr[0]) for name in FREE]
            angular = np.zeros((3, model.nv))
            if s == "left":
                there = data.site("left/tcp")
                mujoco.mj_jacSite(model, data, linear, angular, there.id)
                position, rotation = there.xpos, there.xmat
            else:
                there = data.body("right/hand")
                mujoco.mj_jacBody(model, data, linear, angular, there.id)
                position, rotation = there.xpos, there.xmat
            J = np.vstack([linear, angular])[:, dofs]
            truth = (position, rotation, J, full[np.ix_(dofs, dofs)], data.qfrc_bias[dofs])
            mine = functions[s](q)
            for ours, theirs in zip(mine, truth, strict=True):
                found = np.array(ours)
                assert np.abs(found - np.reshape(theirs, found.shape)).max() <= 1e-9


def test_limits_and_rotors(folder: Path) -> None:
    model = compiled(folder)
    notes = copose.check(copose.parse(cell(), folder / "p.toml")).notes
    for arm in load_arms(parse(cell(), folder / "p.toml")):
        assert [joint.effort for joint in arm.joints] == [*LIMITS.values()]
        ranges = [model.joint(joint.name).range for joint in arm.joints]
        ends = [(joint.lower, joint.upper) for joint in arm.joints]
        assert ends == [(-np.inf, np.inf) if not any(r) else tuple(r) for r in ranges]
        rotors = [0.05, 0.2, 1.5, 0.05 + (0.2 if ROTOR else 0), 0.01, 0.01, 0.01]
        assert np.allclose([joint.armature for joint in arm.joints], rotors, rtol=0, atol=1e-12)
        assert np.allclose(arm.start, [0.1, 0.2, 0.05, 0.3, -0.4, 0.5, 0.6], rtol=0, atol=0)
        s = arm.name
        for told in (
            f"arm {s!r}: the smaller side of torque ranges that are not symmetric counts: "
            f"{s}/lift (-600 … 480)",
            f"arm {s!r}: the weakest of several actuators counts: {s}/6 (2)",
            f"arm {s!r}: springs, damping and friction are left out: "
            + ", ".join(f"{s}/{name}" for name in FREE),
            f"arm {s!r}: gravity compensation is left out: {s}/fore",
        ):
            assert told in notes
    assert "keyframe 'home' of bench.xml is the start of arms 'left', 'right'" in notes
    assert not any("gears are ignored" in note for note in notes)


def test_distances_are_mujocos(folder: Path) -> None:
    model = compiled(folder)
    problem = parse(cell(constraints={"collision": True}), folder / "p.toml")
    arms = load_arms(problem)
    scene = Scene.of(problem, arms)
    bodies = scene.bodies(arms, 0.0)
    named = [[solid.name.partition("/")[2] for solid in scene.solids if solid.parts]]
    assert "world" in named[0] and not any("tcp" in name for name in named[0])
    pairs = {frozenset(name.partition("/")[2] for name in bodies.names(p)) for p in bodies.every}
    assert frozenset(("left/upper", "left/spin")) in pairs
    assert frozenset(("left/upper", "left/bend")) not in pairs
    assert not any("world" in pair for pair in pairs)
    told = " ".join(scene.notes)
    assert "bench.xml: planes and height fields are not tested (of world)" in told
    assert "collisions of 2 pairs of links are ignored by <exclude> of bench.xml" in told
    assert "pairs of links are ignored by contype and conaffinity of bench.xml" in told
    rng, counted = np.random.default_rng(2), 0
    for _ in range(6):
        joints = drawn(rng, arms)
        data = stand(model, joints)
        bases = [arm.base for arm in arms]
        x = configurations(arms, bases, [*joints.values()], problem.object.pose)
        found = bodies.distances(bodies.placed(x)[0], bodies.every)
        for p, distance in zip(bodies.every, found, strict=True):
            links = [name.partition("/")[2].removesuffix(" (body)") for name in bodies.names(p)]
            truth, round_ = apart(model, data, *links)
            if truth > 1e-3:
                counted += 1
                assert truth - (0.01 if round_ else 1e-5) <= distance <= truth + 1e-5, links
    assert counted > 300


def apart(model: mujoco.MjModel, data: mujoco.MjData, *names: str) -> tuple[float, bool]:
    """How far two bodies are apart, and whether an ellipsoid is one of their geoms."""
    geoms = [
        [g for g in range(model.ngeom)
         if model.geom_bodyid[g] == model.body(name).id and model.geom_contype[g]]
        for name in names
    ]  # fmt: skip
    least = min(
        mujoco.mj_geomDistance(model, data, a, b, 10.0, None) for a in geoms[0] for b in geoms[1]
    )
    return least, any(model.geom_type[g] == 4 for some in geoms for g in some)


# Of every joint: parent's frame to its own, its axis, its range, torque; then mass and com of its
# link, principal moments and the way in which they lie.
LINKS = [
    ((0, 0, 0.3), (0, 0, 0.2), (0, 0, 1), (-2.9, 2.9), 90, 3, (0, 0.02, 0.05), (0.03, 0.02, 0.02)),
    ((0, 0.1, 0.1), (0.3, 0, 0), (0, 1, 0), (-2, 2), 80, 3, (0.01, 0, 0.1), (0.04, 0.04, 0.01)),
    ((0, -0.1, 0.3), (0, 0.2, 0), (0, 1, 0), (-2.6, 2.6), 70, 2, (0, 0, 0.1), (0.02, 0.02, 0.01)),
    ((0, 0, 0.25), (0, 0, 0.1), (0, 0, 1), (-3, 3), 30, 1, (0, 0.01, 0), (0.01, 0.008, 0.009)),
    ((0.02, 0, 0.1), (0, 0, 0), (0, 1, 0), (-2, 2), 20, 1, (0, 0, 0.02), (0.01, 0.008, 0.009)),
    ((0, 0, 0.1), (0.1, 0.2, 0.3), (1, 0, 0), (-3, 3), 10, 0.5, (0, 0, 0.02), (2e-3, 2e-3, 2e-3)),
]  # fmt: skip
TURN = (0.3, -0.2, 0.5)


def text(numbers: tuple) -> str:
    return " ".join(map(repr, numbers))


def twins(folder: Path) -> None:
    """One arm as a URDF and as a MuJoCo model."""
    parts, opened = ['<robot name="twin"><link name="base"/>'], []
    for i, (xyz, rpy, axis, ends, torque, mass, com, moments) in enumerate(LINKS):
        place = f'<origin xyz="{text(xyz)}" rpy="{text(rpy)}"/>'
        parts.append(
            f'<joint name="j{i}" type="revolute"><parent link="{f"l{i - 1}" if i else "base"}"/>'
            f'<child link="l{i}"/>{place}<axis xyz="{text(axis)}"/>'
            f'<limit lower="{ends[0]}" upper="{ends[1]}" effort="{torque}" velocity="3"/></joint>'
            f'<link name="l{i}"><inertial><origin xyz="{text(com)}" rpy="{text(TURN)}"/>'
            f'<mass value="{mass}"/><inertia ixx="{moments[0]}" iyy="{moments[1]}" '
            f'izz="{moments[2]}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
        opened.append(
            f'<body name="l{i}" pos="{text(xyz)}" euler="{text(rpy)}">'
            f'<joint name="j{i}" axis="{text(axis)}" range="{text(ends)}" '
            f'actuatorfrcrange="{-torque} {torque}"/>'
            f'<inertial pos="{text(com)}" euler="{text(TURN)}" mass="{mass}" '
            f'diaginertia="{text(moments)}"/>'
        )
    (folder / "twin.urdf").write_text("".join(parts) + "</robot>")
    (folder / "twin.xml").write_text(
        '<mujoco><compiler angle="radian" eulerseq="XYZ"/><worldbody>'
        + "".join(opened) + "</body>" * len(LINKS) + "</worldbody></mujoco>"
    )  # fmt: skip


def pair(file: str) -> dict:
    """Two of the arm hold a box."""
    arms = [
        {
            "name": name, file.partition(".")[2].replace("xml", "mjcf"): file, "tip": "l5",
            "base": {"position": [x, 0, 0], "rpy": [0, 0, yaw]},
            "grasp": {"position": [x / 3, 0, 0], "rpy": [0, np.copysign(np.pi / 2, -x), yaw]},
        }
        for name, x, yaw in (("left", -0.45, 0.0), ("right", 0.45, np.pi))
    ]  # fmt: skip
    thing = {"mass": 2.0, "inertia": [0.02, 0.02, 0.02], "position": [0, 0, 0.7]}
    thing["shape"] = {"kind": "box", "size": [0.3, 0.2, 0.2]}
    return {
        "format": 1, "name": "twins", "task": {"space": "spatial"}, "object": thing, "arms": arms,
        "ellipsoid": {"gravity": True, "torque_scaling": "limits"},
    }  # fmt: skip


def test_a_urdf_and_its_twin_give_one_result(tmp_path: Path) -> None:
    twins(tmp_path)
    urdf, mjcf = (
        copose.solve(copose.parse(pair(file), tmp_path / "p.toml"), effort="low")
        for file in ("twin.urdf", "twin.xml")
    )
    assert urdf.status == mjcf.status == "solved"
    for one, other in ((urdf.before, mjcf.before), (urdf.after, mjcf.after)):
        for name in ("left", "right"):
            assert np.abs(np.subtract(one.joints[name], other.joints[name])).max() < 1e-9
        assert np.allclose(one.ellipsoid.gram, other.ellipsoid.gram, rtol=1e-9, atol=0)
        assert np.allclose(one.ellipsoid.center, other.ellipsoid.center, rtol=1e-9, atol=1e-9)
    assert urdf.after.ellipsoid.log_volume > urdf.before.ellipsoid.log_volume


# Three links; {} is what stands in one of the places.
SMALL = """<mujoco><worldbody><body name="a">{a}
<geom size="0.1" pos="0 0 0.2"/><body name="b" pos="0 0 0.4"><joint name="j2" axis="1 0 0"/>{b}
<geom size="0.1" pos="0 0 0.2"/><site name="s"/><body name="c" pos="0 0 0.4">{c}
<joint name="j3" axis="0 1 0"/><geom size="0.1" mass="1" pos="0 0 0.2"/><site name="t"/>
</body></body></body></worldbody>{end}</mujoco>
"""
CABLE = """<tendon><spatial name="cable"><site site="s"/><site site="t"/></spatial></tendon>
<actuator><motor tendon="cable"/></actuator>"""
FOLLOWS = '<equality><joint joint1="j3" joint2="j2"/></equality>'


@pytest.mark.parametrize(
    ("parts", "arm", "expected"),
    [
        ({"b": '<joint name="bb" type="ball"/>'}, {}, "'bb' on the chain is a ball joint; revol"),
        ({"a": "<freejoint/>"}, {}, "joint 'joint1' on the chain is a free joint; revolute"),
        ({"end": CABLE}, {}, "joint 'j3' is driven by the tendon 'cable', which gives it no t"),
        ({"end": FOLLOWS}, {}, "joint 'j3' mimics 'j2', which is free; lock one of them"),
        ({"c": "<geom/>"}, {}, "is no model that MuJoCo can read: size 0 must be positive"),
        ({"c": "<gone/>"}, {}, "can read: XML Error: Schema violation: unrecognized element"),
        ({"end": "<"}, {}, "m.xml is no model that MuJoCo can read: XML parse error"),
        ({"c": '<body name="n" pos="nan 0 0"/>'}, {}, "m.xml: body 'n' has a number that is not"),
        ({"c": '<body name="n" pos="0 1e12 0"/>'}, {}, "beyond ±1e+09"),
        ({}, {"tip": "u"}, "'u' is no link of m.xml"),
        ({}, {"tip": "world"}, "no free joint between 'world' and 'world'"),
        ({}, {"locked": {"j4": 0.0}}, "'j4' is no movable joint of m.xml; did you mean"),
        ({}, {"mjcf": "gone.xml"}, "gone.xml: no such file"),
        ({}, {"mjcf": "u.urdf"}, "u.urdf is no MuJoCo model: its root is <robot>, not <mujoco>;"),
        ({}, {"mjcf": "text"}, "text is no MuJoCo model: its root is <>, not <mujoco>"),
        ({}, {"urdf": "m.xml"}, "has urdf and mjcf; give the one that its robot is read from"),
        ({}, {"mjcf": None}, "urdf is missing, or mjcf for a MuJoCo model"),
        ({}, {"urdf": "m.xml", "mjcf": None}, "<mujoco>, not <robot>; name a MuJoCo model by mjcf"),
        ({}, {"xacro_args": {"a": "b"}}, "xacro_args have no effect: m.xml is no .xacro"),
    ],
)  # fmt: skip
def test_refused(parts: dict, arm: dict, expected: str, tmp_path: Path, monkeypatch, capfd) -> None:
    monkeypatch.chdir(tmp_path)
    small(tmp_path, **parts)
    (tmp_path / "u.urdf").write_text('<!-- <mujoco> --><robot name="r"/>')
    (tmp_path / "text").write_text("no XML")
    with pytest.raises(InputError) as error:
        load_arms(parse(three(**arm), tmp_path / "p.toml"))
    message = str(error.value)
    assert expected in message and "arms[0] (arm)" in message and "\n" not in message
    # MuJoCo's own warnings go nowhere.
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.xml", "text", "u.urdf"]
    assert capfd.readouterr() == ("", "")


def small(folder: Path, **parts: str) -> None:
    blank = dict.fromkeys(("b", "c", "end"), "") | {"a": '<joint name="j1" range="-90 90"/>'}
    (folder / "m.xml").write_text(SMALL.format(**blank | parts))


def three(**arm: object) -> dict:
    table = {"name": "arm", "mjcf": "m.xml", "tip": "t", "grasp": {"position": [0, 0, 0]}} | arm
    table = {key: value for key, value in table.items() if value is not None}
    thing = {"mass": 1.0, "position": [0.1, 0.1, 0.8]}
    return {
        "format": 1, "name": "x", "task": {"space": "spatial-linear"}, "object": thing,
        "arms": [table],
    }  # fmt: skip


def test_what_is_off_the_chain_does_not_matter(tmp_path: Path) -> None:
    loose = '<joint name="j1"/><body name="loose"><joint type="ball"/><geom size="0.1"/></body>'
    small(tmp_path, a=loose, end=FOLLOWS.replace("j3", "j1"))
    with pytest.raises(InputError, match="'j1' mimics 'j2', which is free"):
        load_arms(parse(three(), tmp_path / "p.toml"))
    with pytest.raises(InputError, match=r"has 2 free joints \(j2, j3\); space"):
        load_arms(parse(three(locked={"j1": 0.1}), tmp_path / "p.toml"))


def test_without_mujoco(tmp_path: Path, monkeypatch) -> None:
    small(tmp_path)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InputError, match=r"not installed; pip install 'copose\[mjcf\]'"):
        load_arms(parse(three(), tmp_path / "p.toml"))


def test_from_init_to_a_picture(tmp_path: Path, monkeypatch, capsys) -> None:
    bench(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["init", "robot/bench.xml", "-o", "p.toml"]) == 0
    made = copose.load("p.toml")
    assert [arm.mjcf for arm in made.arms] == ["robot/bench.xml"] * 2
    assert [arm.tip for arm in made.arms] == ["left/tcp", "right/tcp"]
    file = Path("p.toml").read_text()
    assert main(["check", "p.toml", "--figure", "start.png"]) == 0
    assert "left/lift" in capsys.readouterr().out
    Path("p.toml").write_text(file + "\n[constraints]\ncollision = true\n")
    assert main(["solve", "p.toml", "-o", "out"]) == 0
    assert {path.name for path in Path("out").iterdir()} == {"result.json", "before_after.png"}
    assert not Path("MUJOCO_LOG.TXT").exists()


def test_names_that_two_things_could_have(tmp_path: Path) -> None:
    """Links between joints of one body, and joints that bind sites, are named here."""
    small(tmp_path, a='<joint name="t on c" pos="0.1 0 0"/>',
          c='<joint pos="0 0.2 0"/><body name="a:t on c"/><body name="s"/>')  # fmt: skip
    (arm,) = load_arms(parse(three(), tmp_path / "p.toml"))
    assert arm.joint_names == ("t on c", "j2", "joint3", "j3")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    data, q = mujoco.MjData(model), np.array([0.3, -0.5, 0.7, 0.2])
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    assert np.abs(arm.tip_at(q).position - data.site("t").xpos).max() < 1e-12


def test_starts(tmp_path: Path) -> None:
    key = '<keyframe><key qpos="{} 0.2 0.3"/><key name="other" qpos="0 0 0"/></keyframe>'
    for first, start, note in [
        (0.1, [0.1, 0.2, 0.3], "keyframe '1' of m.xml is the start of arm 'arm'"),
        (2.0, None, "arm 'arm': keyframe '1' of m.xml is no start: outside the limits of j1"),
    ]:
        small(tmp_path, end=key.format(first))
        (arm,) = load_arms(parse(three(), tmp_path / "p.toml"))
        assert note in arm.notes and (arm.start is None) == (start is None)
        assert start is None or arm.start.tolist() == start
        (arm,) = load_arms(parse(three(start=[0, 0.1, 0], armature=[1, 2, 3]), tmp_path / "p.toml"))
        assert arm.start.tolist() == [0, 0.1, 0] and not any("keyframe" in n for n in arm.notes)
        assert arm.geared and [joint.armature for joint in arm.joints] == [1, 2, 3]


def test_loops_and_looks(tmp_path: Path) -> None:
    loop = '<equality><connect body1="c" body2="a" anchor="0 0 0"/></equality>'
    small(tmp_path, end=loop)
    (arm,) = load_arms(parse(three(), tmp_path / "p.toml"))
    assert "arm 'arm': equality constraints between bodies are left out: a, c" in arm.notes
    file = tmp_path / "m.xml"
    seen = file.read_text().replace("<geom ", '<geom contype="0" conaffinity="0" ')
    file.write_text(seen)
    asked = three() | {"constraints": {"collision": True}}
    problem = parse(asked, tmp_path / "p.toml")
    scene = Scene.of(problem, load_arms(problem))
    assert "m.xml has no collision geometry; its visual geometry is tested" in scene.notes
    assert [solid.name for solid in scene.solids] == ["arm/a", "arm/b", "arm/c"]
    bare = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    file.write_text(re.sub("<geom [^>]*>", bare, seen))
    with pytest.raises(InputError, match=r"has no shape for any link.*needs geoms") as error:
        Scene.of(problem, load_arms(problem))
    assert error.value.key == "arms[0] (arm).mjcf"
