"""Cells of real robots and planar arms in which every arm holds the object by construction.

Joints are drawn first, by a seed; bases and grasps are then placed so that the tips are where the
grasps are. The draw is returned beside the problem's tables: a closed posture that is known.
"""

from __future__ import annotations

import copy
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import copose
from copose.robots import finite_range, load_arms

TESTS = Path(__file__).parents[1] / "tests"
if str(TESTS) not in sys.path:
    sys.path.append(str(TESTS))

from reference import UrdfArm  # noqa: E402

Tables = dict[str, Any]
Joints = dict[str, list[float]]

_EXAMPLES = "example-robot-data://"
_UR = f"{_EXAMPLES}ur_description/urdf"
_TORSO = {"torso_lift_joint": 0.1}

ROBOTS: dict[str, Tables] = {
    "panda": {"urdf": f"{_EXAMPLES}panda_description/urdf/panda.urdf", "tip": "panda_hand"},
    "xarm7": {"urdf": f"{_EXAMPLES}xarm_description/urdf/xarm7.urdf", "tip": "link7"},
    "ur5": {"urdf": f"{_UR}/ur5_robot.urdf", "tip": "tool0"},
    "ur10": {"urdf": f"{_UR}/ur10_robot.urdf", "tip": "tool0"},
    "kinova": {
        "urdf": f"{_EXAMPLES}kinova_description/robots/kinova.urdf",
        "tip": "j2s6s200_end_effector",
    },
    "z1": {"urdf": f"{_EXAMPLES}z1_description/urdf/z1.urdf", "tip": "link06"},
    "talos": {
        "urdf": f"{_EXAMPLES}talos_data/robots/talos_left_arm.urdf",
        "tip": "gripper_left_base_link",
    },
}
_SIDES: dict[str, Tables] = {}
for _side in ("left", "right"):
    _SIDES[f"pr2-{_side}"] = {
        "urdf": f"{_EXAMPLES}pr2_description/urdf/pr2.urdf",
        "tip": f"{_side[0]}_gripper_tool_frame",
        "locked": _TORSO,
    }
    _SIDES[f"tiago-{_side}"] = {
        "urdf": f"{_EXAMPLES}tiago_description/robots/tiago_dual.urdf",
        "tip": f"arm_{_side}_7_link",
        "locked": _TORSO,
    }
    _SIDES[f"baxter-{_side}"] = {
        "urdf": f"{_EXAMPLES}baxter_description/urdf/baxter.urdf",
        "tip": f"{_side}_gripper",
    }
ROBOTS |= _SIDES

_TRIES = 300
_BETWEEN_HANDS = 0.3


def placement(pose: pin.SE3) -> Tables:
    """A pose as a problem file writes it, nothing rounded."""
    return {
        "position": pose.translation.tolist(),
        "rpy": pin.rpy.matrixToRpy(pose.rotation).tolist(),
    }


def cell(name: str, robots: tuple[str, ...], seed: int, **extra: Any) -> tuple[Tables, Joints]:
    """Robots round an object in space, and joints that hold it.

    Free-standing robots get a base within 0.25 m of fitting; the two arms of one robot stay where
    they are, and the object goes between their hands, of the draws whose distance is nearest 0.3 m.

    Args:
        name: of the problem.
        robots: by their names in ``ROBOTS``.
        seed: of the draws.
        extra: further tables of the problem file; ``space`` is the task space.
    """
    rng = np.random.default_rng(seed)
    space = extra.pop("space", "spatial")
    turn = pin.rpy.rpyToMatrix(*rng.uniform(-1, 1, 3))
    place = pin.SE3(turn, rng.uniform(-0.3, 0.3, 3))
    thing = {"mass": float(rng.uniform(0.3, 4)), "inertia": [0.02, 0.03, 0.025]}
    arms = [
        copy.deepcopy(ROBOTS[robot]) | {"name": f"arm{i + 1}", "grasp": {"position": [0, 0, 0]}}
        for i, robot in enumerate(robots)
    ]
    for i, (table, robot) in enumerate(zip(arms, robots, strict=True)):
        if robot not in _SIDES:
            table["base"] = {"position": [float(i), 0, 0], "rpy": [0, 0, float(rng.uniform(-3, 3))]}
    tables = {
        "format": 1,
        "name": name,
        "task": {"space": space},
        "object": thing | placement(place),
        "arms": arms,
    }
    loaded = load_arms(copose.parse(tables))
    models = [
        UrdfArm(table, list(arm.joint_names)) for table, arm in zip(arms, loaded, strict=True)
    ]
    bounds = [finite_range(arm.lower, arm.upper) for arm in loaded]

    def draw() -> list[Any]:
        return [rng.uniform(low, high) for low, high in bounds]

    joints = draw()
    if any(robot in _SIDES for robot in robots):
        joints = min((draw() for _ in range(_TRIES)), key=lambda qs: _spread(models, qs))
        centre = np.mean(
            [model.at(q)[0].translation for model, q in zip(models, joints, strict=True)], 0
        )
        place = pin.SE3(turn, centre)
        tables["object"] = thing | placement(place)
    for table, arm, q in zip(arms, loaded, joints, strict=True):
        names = list(arm.joint_names)
        if "base" in table:
            near = place.translation + rng.uniform(-0.25, 0.25, 3)
            off = near - UrdfArm(table, names).at(q)[0].translation
            table["base"]["position"] = (np.array(table["base"]["position"]) + off).tolist()
        table["grasp"] = placement(place.inverse() * UrdfArm(table, names).at(q)[0])
    return tables | extra, {
        table["name"]: q.tolist() for table, q in zip(arms, joints, strict=True)
    }


def _spread(models: list[UrdfArm], joints: list[Any]) -> float:
    tips = [model.at(q)[0].translation for model, q in zip(models, joints, strict=True)]
    return abs(float(np.linalg.norm(tips[0] - tips[-1])) - _BETWEEN_HANDS)


def ring(
    name: str, robot: str, q: list[float], count: int, radius: float = 0.25, **extra: Any
) -> tuple[Tables, Joints]:
    """Identical arms evenly round a horizontal plate, each at its rim in the same posture.

    Args:
        name: of the problem.
        robot: by its name in ``ROBOTS``.
        q: the posture of every arm.
        count: number of arms.
        radius: of the plate, m.
        extra: further tables of the problem file.
    """
    free = copy.deepcopy(ROBOTS[robot])
    probe = {
        "format": 1, "name": name, "task": {"space": "spatial"},
        "object": {"mass": 1.0, "inertia": [1.0] * 3, "position": [0, 0, 0]},
        "arms": [free | {"name": "arm1", "grasp": {"position": [0, 0, 0]}}],
    }  # fmt: skip
    names = list(load_arms(copose.parse(probe))[0].joint_names)
    tip = UrdfArm(free, names).at(np.array(q))[0]
    reach = math.hypot(*tip.translation[:2])
    height = float(tip.translation[2])
    place = pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
    heading = math.atan2(tip.translation[1], tip.translation[0])
    arms = []
    for i in range(count):
        about = 2 * math.pi * i / count
        outward = np.array([math.cos(about), math.sin(about), 0.0])
        rotation = pin.rpy.rpyToMatrix(0.0, 0.0, about + math.pi - heading)
        base = pin.SE3(rotation, (radius + reach) * outward)
        arms.append(
            copy.deepcopy(ROBOTS[robot])
            | {
                "name": f"arm{i + 1}",
                "base": placement(base),
                "grasp": placement(place.inverse() * base * tip),
            }
        )
    thing = {
        "mass": 4.0,
        "inertia": [0.06, 0.06, 0.12],
        "position": [0.0, 0.0, height],
        "shape": {"kind": "cylinder", "radius": radius, "length": 0.02},
    }
    tables = {"format": 1, "name": name, "task": {"space": "spatial"}, "object": thing}
    return tables | {"arms": arms} | extra, {arm["name"]: list(q) for arm in arms}


def planar(
    name: str, links: int, count: int, seed: int, space: str, **extra: Any
) -> tuple[Tables, Joints]:
    """Planar arms round a plate, in postures drawn by a seed; bases stand where they then must.

    Args:
        name: of the problem.
        links: of every arm.
        count: number of arms.
        seed: of the draws.
        space: ``planar`` or ``planar-linear``.
        extra: further tables of the problem file.
    """
    rng = np.random.default_rng(seed)
    centre, angle = rng.uniform(-0.2, 0.2, 2), float(rng.uniform(-0.5, 0.5))
    thing = {"mass": 0.8, "inertia": 0.01, "position": centre.tolist(), "angle": angle}
    arms, joints = [], {}
    for i in range(count):
        lengths = rng.uniform(0.25, 0.4, links)
        q = rng.uniform(-2.0, 2.0, links)
        angles = np.cumsum(q)
        reach = np.array([lengths @ np.cos(angles), lengths @ np.sin(angles)])
        about = angle + 2 * math.pi * i / count
        rim = 0.15 * np.array([math.cos(about), math.sin(about)])
        base = (centre + rim - reach).tolist()
        back = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        grasp = {"position": (back @ rim).tolist(), "angle": float(angles[-1] - angle)}
        arms.append(
            {
                "name": f"arm{i + 1}",
                "links": [
                    {"length": float(a), "mass": float(2 * a), "inertia": float(a**3 / 6),
                     "com": float(a / 2)}
                    for a in lengths
                ],
                "base": {"position": base},
                "grasp": grasp,
                "position_limits": [[-2.6, 2.6]] * links,
            }
        )  # fmt: skip
        joints[f"arm{i + 1}"] = q.tolist()
    tables = {"format": 1, "name": name, "task": {"space": space}, "object": thing, "arms": arms}
    return tables | extra, joints
