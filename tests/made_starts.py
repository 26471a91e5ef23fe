"""Problems whose arms have a start and no grasp, and the same with the grasps written out."""

from __future__ import annotations

import copy

import numpy as np
import pinocchio as pin

from cells import ROBOTS, planar
from copose.problem import parse
from copose.robots import load_arms
from reference import UrdfArm

NAMES = ("panda", "ur5", "kinova", "xarm7", "pr2-left", "tiago-right")


def drawn(name: str, space: str, rng: np.random.Generator, between: bool) -> tuple[dict, dict]:
    """Two arms of a robot (planar: of links) in random postures round an object.

    Returns:
        The tables without grasps, and with those that Pinocchio, in the plane a sum of complex
        numbers, has at the start. Where the object is between the tips only these say where.
    """
    if space.startswith("planar"):
        return _planar(space, rng, between)
    arms = [copy.deepcopy(ROBOTS[name]) | {"name": f"arm{i}"} for i in range(2)]
    for arm in arms:
        turn = pin.Quaternion(pin.rpy.rpyToMatrix(*rng.uniform(-3, 3, 3)))
        arm["base"] = {
            "position": rng.uniform(-1, 1, 3).tolist(),
            "quaternion": [turn.w, turn.x, turn.y, turn.z],
        }
    turn = pin.rpy.rpyToMatrix(*rng.uniform(-3, 3, 3))
    thing = {"mass": 2.0, "inertia": [0.02, 0.03, 0.025]}
    thing["rpy"] = pin.rpy.matrixToRpy(turn).tolist()
    held = [arm | {"grasp": {"position": [0, 0, 0]}} for arm in arms]
    somewhere = thing | {"position": [0, 0, 0]}
    cell = {"format": 1, "name": "x", "task": {"space": space}, "object": somewhere, "arms": held}
    tips = []
    for table, arm in zip(arms, load_arms(parse(cell)), strict=True):
        q = rng.uniform(np.fmax(arm.lower, -np.pi), np.fmin(arm.upper, np.pi))
        table["start"] = q.tolist()
        placed = pin.XYZQUATToSE3(
            np.array([*table["base"]["position"], *np.roll(table["base"]["quaternion"], -1)])
        )
        inner = UrdfArm(
            {k: v for k, v in table.items() if k != "base"} | {"grasp": {"position": [0, 0, 0]}},
            list(arm.joint_names),
        ).at(q)[0]
        tips.append(placed * inner)
    middle = (tips[0].translation + tips[1].translation) / 2
    if not between:
        middle = middle + rng.uniform(-0.3, 0.3, 3)
        thing["position"] = middle.tolist()
    there = pin.SE3(turn, middle)
    written = []
    for arm, tip in zip(arms, tips, strict=True):
        grasp = there.inverse() * tip
        q = pin.Quaternion(grasp.rotation)
        turned = {"quaternion": [q.w, q.x, q.y, q.z]}
        written.append(arm | {"grasp": {"position": grasp.translation.tolist(), **turned}})
    taught = cell | {"object": thing, "arms": arms}
    return taught, cell | {"object": thing | {"position": middle.tolist()}, "arms": written}


def _planar(space: str, rng: np.random.Generator, between: bool) -> tuple[dict, dict]:
    taught = planar(2, 4, space)
    angle = float(rng.uniform(-3, 3))
    thing = {"mass": 0.5, "inertia": 0.01, "angle": angle}
    tips = []
    for arm in taught["arms"]:
        del arm["grasp"]
        x, y = rng.uniform(-1, 1, 2).tolist()
        arm["base"] = {"position": [x, y], "angle": float(rng.uniform(-3, 3))}
        arm["start"] = rng.uniform(-3, 3, 4).tolist()
        turns = arm["base"]["angle"] + np.cumsum(arm["start"])
        tips.append((x + 1j * y + 0.4 * np.exp(1j * turns).sum(), float(turns[-1])))
    middle = (tips[0][0] + tips[1][0]) / 2
    if not between:
        middle = middle + complex(*rng.uniform(-0.3, 0.3, 2))
        thing["position"] = [middle.real, middle.imag]
    written = []
    for arm, (tip, turn) in zip(taught["arms"], tips, strict=True):
        away = (tip - middle) * np.exp(-1j * angle)
        written.append(arm | {"grasp": {"position": [away.real, away.imag], "angle": turn - angle}})
    there = thing | {"position": [middle.real, middle.imag]}
    taught["object"] = thing
    return taught, taught | {"object": there, "arms": written}
