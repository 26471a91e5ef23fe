"""Problems that tests are built from."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path

import numpy as np

from copose.cell.cell import Cell
from copose.robots import finite_range
from copose.self_motion.kernels import ArmKernels, KernelInputsBuilder
from copose.self_motion.projection import CLOSED, project
from reference import PROBLEMS

PANDA = "example-robot-data://panda_description/urdf/panda.urdf"
FILES = sorted(PROBLEMS.glob("*.toml"))


def closed_postures(ready: Cell, i: int, count: int = 512, seed: int = 0) -> np.ndarray:
    """Random postures of arm i, drawn and projected within its limits, that hold the object."""
    kernels = ArmKernels.of(ready.system.arms[i], ready.resolution)
    goal = KernelInputsBuilder(ready.system, ready.resolution, ready.scales)(
        ready.parameters
    ).goals[i]
    low, high = finite_range(ready.lower[i], ready.upper[i])
    drawn = np.random.default_rng([seed, i]).uniform(low, high, (count, len(low)))
    q, gaps = project(kernels, drawn, goal, ready.lower[i], ready.upper[i])
    return q[gaps < CLOSED]


def tables(name: str) -> dict:
    """The tables of one of the shipped problems."""
    return tomllib.loads((PROBLEMS / f"{name}.toml").read_text())


def toml(value: object, prefix: str = "") -> str:
    """Tables as TOML text."""
    if isinstance(value, dict) and not prefix:
        plain = {k: v for k, v in value.items() if not isinstance(v, dict) and k != "arms"}
        lines = [f"{key(k)} = {toml(v, 'x')}" for k, v in plain.items()]
        for k, v in value.items():
            if isinstance(v, dict):
                lines.append(f"[{key(k)}]")
                lines += [f"{key(a)} = {toml(b, 'x')}" for a, b in v.items()]
        arms = value.get("arms", [])
        if isinstance(arms, list) and all(isinstance(arm, dict) for arm in arms) and arms:
            for arm in arms:
                lines.append("[[arms]]")
                lines += [f"{key(a)} = {toml(b, 'x')}" for a, b in arm.items()]
        elif "arms" in value:
            lines.insert(0, f"arms = {toml(arms, 'x')}")
        return "\n".join(lines) + "\n"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key(k)} = {toml(v, 'x')}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml(v, "x") for v in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + "".join(escape(c) for c in value) + '"'
    return repr(value)


def escape(c: str) -> str:
    if c in '"\\':
        return "\\" + c
    return c if ord(c) >= 32 and ord(c) != 127 else f"\\u{ord(c):04x}"


def key(name: str) -> str:
    return toml(name, "x")


def planar(
    n_arms: int = 2, n_links: int = 3, space: str = "planar-linear", **extra: object
) -> dict:
    """A small planar cell that closes easily."""
    import math

    link = {"length": 0.4, "mass": 1.0, "inertia": 0.03, "com": 0.2}
    arms = []
    for i in range(n_arms):
        turn = math.pi + 2 * math.pi * i / n_arms
        arms.append(
            {
                "name": f"a{i + 1}",
                "links": [dict(link) for _ in range(n_links)],
                "base": {"position": [0.7 * math.cos(turn), 0.7 * math.sin(turn)]},
                "grasp": {"position": [0.15 * math.cos(turn), 0.15 * math.sin(turn)],
                          "angle": turn + math.pi},
            }
        )  # fmt: skip
    thing = {"mass": 0.5, "inertia": 0.01, "position": [0.0, 0.1]}
    cell = {"format": 1, "name": "cell", "task": {"space": space}, "object": thing, "arms": arms}
    return cell | copy.deepcopy(extra)


def two_pandas(space: str = "spatial") -> dict:
    """The shipped two-Panda problem in another space."""
    cell = tables("two-panda-box")
    cell["task"]["space"] = space
    return cell


EXAMPLES = "example-robot-data://"
ROBOTS = {
    "panda": {"urdf": PANDA, "tip": "panda_hand"},
    "xarm7": {"urdf": f"{EXAMPLES}xarm_description/urdf/xarm7.urdf", "tip": "link7"},
    "ur5": {"urdf": f"{EXAMPLES}ur_description/urdf/ur5_robot.urdf", "tip": "tool0"},
    "ur10": {"urdf": f"{EXAMPLES}ur_description/urdf/ur10_robot.urdf", "tip": "tool0"},
    "z1": {"urdf": f"{EXAMPLES}z1_description/urdf/z1.urdf", "tip": "link06"},
    "kinova": {
        "urdf": f"{EXAMPLES}kinova_description/robots/kinova.urdf",
        "tip": "j2s6s200_end_effector",
    },
}
for side in ("left", "right"):
    ROBOTS[f"pr2-{side}"] = {
        "urdf": f"{EXAMPLES}pr2_description/urdf/pr2.urdf",
        "tip": f"{side[0]}_gripper_tool_frame",
        "locked": {"torso_lift_joint": 0.1},
    }
    ROBOTS[f"tiago-{side}"] = {
        "urdf": f"{EXAMPLES}tiago_description/robots/tiago_dual.urdf",
        "tip": f"arm_{side}_7_link",
        "locked": {"torso_lift_joint": 0.1},
    }


def random_cell(names: tuple[str, ...], space: str, seed: int) -> dict:
    """Robots round an object that all of them can hold: bases and grasps from random joints."""
    import numpy as np
    import pinocchio as pin

    from copose.problem import parse
    from copose.robots import load_arms
    from reference import UrdfArm

    rng = np.random.default_rng(seed)
    placed = pin.SE3(pin.rpy.rpyToMatrix(*rng.uniform(-1, 1, 3)), rng.uniform(-0.3, 0.3, 3))
    thing = {
        "mass": float(rng.uniform(0.3, 4)),
        "inertia": [0.02, 0.03, 0.025],
        "position": placed.translation.tolist(),
        "rpy": pin.rpy.matrixToRpy(placed.rotation).tolist(),
    }
    arms = [
        copy.deepcopy(ROBOTS[name]) | {"name": f"arm{i}", "grasp": {"position": [0, 0, 0]}}
        for i, name in enumerate(names)
    ]
    for i, (table, name) in enumerate(zip(arms, names, strict=True)):
        if not name.startswith(("pr2", "tiago")):
            yaw = float(rng.uniform(-3, 3))
            table["base"] = {"position": [float(i), 0, 0], "rpy": [0, 0, yaw]}
    cell = {"format": 1, "name": "random", "task": {"space": space}, "object": thing, "arms": arms}
    for table, arm in zip(arms, load_arms(parse(cell)), strict=True):
        q = rng.uniform(np.fmax(arm.lower, -np.pi), np.fmin(arm.upper, np.pi))
        if "base" in table:
            tip = UrdfArm(table, list(arm.joint_names)).at(q)[0]
            near = placed.translation + rng.uniform(-0.25, 0.25, 3)
            moved = np.array(table["base"]["position"]) + near - tip.translation
            table["base"]["position"] = moved.tolist()
        tip = UrdfArm(table, list(arm.joint_names)).at(q)[0]
        grasp = placed.inverse() * tip
        table["grasp"] = {
            "position": grasp.translation.tolist(),
            "rpy": pin.rpy.matrixToRpy(grasp.rotation).tolist(),
        }
    return cell


def flat_arm(folder: Path) -> dict:
    """A spatial cell with an arm that has rank 2 of 3 in every posture; writes its URDF."""
    inertial = (
        '<inertial><mass value="1"/>'
        '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
    )
    parts = ['<link name="l0"/>']
    for i in range(4):
        parts.append(
            f'<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
            '<origin xyz="0.3 0 0"/><axis xyz="0 0 1"/></joint>'
            f'<link name="l{i + 1}">{inertial}</link>'
        )
    (folder / "flat.urdf").write_text(f'<robot name="flat">{"".join(parts)}</robot>')
    arm = {"name": "arm", "urdf": "flat.urdf", "tip": "l4", "grasp": {"position": [0, 0, 0]}}
    thing = {"mass": 1.0, "position": [0.5, 0.4, 0.0]}
    return {
        "format": 1, "name": "flat", "task": {"space": "spatial-linear"}, "object": thing,
        "arms": [arm],
    }  # fmt: skip
