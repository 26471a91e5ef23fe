"""Problems with paths, small enough for tests."""

from __future__ import annotations

import copy

import numpy as np

from cells import planar, tables, two_pandas

GRAVITY = {"gravity": [0.0, -9.81]}


def along(cell: dict, *waypoints: dict, **settings: object) -> dict:
    """A problem with a path through waypoints."""
    return copy.deepcopy(cell) | {"path": {"waypoints": list(waypoints), **settings}}


def hinged(knots: int = 25, **settings: object) -> dict:
    """Two planar 3-joint arms on hinges carry and turn an object."""
    return along(
        planar(world=GRAVITY), {"position": [-0.1, 0.1]}, {"position": [0.15, 0.2], "angle": 0.5},
        knots=knots, **settings,
    )  # fmt: skip


def single_hinged(knots: int = 25, **settings: object) -> dict:
    """One planar 3-joint arm whose tip, on a hinge, carries a point mass."""
    cell = planar(1)
    cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
    return along(
        cell, {"position": [-0.1, 0.1]}, {"position": [0.15, 0.25]}, knots=knots, **settings
    )


def gripped(knots: int = 40, **settings: object) -> dict:
    """Two planar 4-joint arms with rigid grasps."""
    cell = tables("two-planar-4r")
    cell["world"] = GRAVITY
    return along(
        cell, {"position": [0.45, 0.5]}, {"position": [0.45, 0.45], "angle": -0.1}, knots=knots,
        **settings,
    )  # fmt: skip


def carried(knots: int = 50, **settings: object) -> dict:
    """Two Pandas carry a box 0.4 m sideways and 0.3 m up."""
    return along(
        two_pandas(), {"position": [0.5, -0.2, 0.6]}, {"position": [0.5, 0.2, 0.9]}, knots=knots,
        **settings,
    )  # fmt: skip


def balled(knots: int = 50, **settings: object) -> dict:
    """Two Pandas carry a stick without inertia by ball joints, and turn it."""
    cell = two_pandas("spatial-linear")
    del cell["object"]["inertia"]
    return along(
        cell, {"position": [0.5, -0.1, 0.5]}, {"position": [0.5, 0.1, 0.7], "rpy": [0.2, 0.1, 0.3]},
        knots=knots, **settings,
    )  # fmt: skip


def alone(robot: str, knots: int = 40, **settings: object) -> dict:
    """One 7-joint arm carries a part through three waypoints."""
    arm = {
        "panda": {"urdf": "panda_description/urdf/panda.urdf", "tip": "panda_hand"},
        "xarm7": {"urdf": "xarm_description/urdf/xarm7.urdf", "tip": "link7"},
    }[robot]
    arm = arm | {"name": "arm", "urdf": f"example-robot-data://{arm['urdf']}"}
    arm["grasp"] = {"position": [0.0, 0.0, 0.1], "rpy": [3.141592653589793, 0.0, 0.0]}
    thing = {"mass": 1.0, "inertia": [0.01, 0.012, 0.008], "position": [0.4, -0.1, 0.2]}
    cell = {
        "format": 1, "name": robot, "task": {"space": "spatial"}, "object": thing, "arms": [arm],
    }  # fmt: skip
    return along(
        cell, {}, {"position": [0.4, 0.15, 0.3]}, {"rpy": [0.0, 0.2, 0.5]}, knots=knots, **settings
    )


def drawn(seed: int) -> dict:
    """A planar problem of one to three arms with a path, limits and settings drawn by a seed."""
    rng = np.random.default_rng(seed)
    space = ("planar-linear", "planar")[seed % 2]
    arms = int(rng.integers(1, 4))
    links = 3 + seed % 2 + int(rng.integers(0, 2))
    cell = planar(arms, links, space, world=GRAVITY if rng.random() < 0.5 else {})
    if not cell["world"]:
        del cell["world"]
    if arms == 1 and space == "planar-linear":
        cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
    for arm in cell["arms"]:
        if rng.random() < 0.5:
            arm["velocity_limits"] = [float(x) for x in rng.uniform(2.0, 4.0, links)]
        if rng.random() < 0.5:
            arm["position_limits"] = [[-2.8, 2.8]] * links
        if rng.random() < 0.3:
            arm["acceleration_limits"] = [60.0] * links
        if rng.random() < 0.3:
            arm["armature"] = [0.02] * links
    if rng.random() < 0.3:
        cell["ellipsoid"] = {"resolution": "torque-optimal"}
    elif rng.random() < 0.3:
        cell["objective"] = {"kind": "worst-direction"}
    waypoints = [
        {"position": rng.uniform(-0.15, 0.15, 2).tolist(), "angle": float(rng.uniform(-0.4, 0.4))}
        for _ in range(int(rng.integers(2, 4)))
    ]
    return along(
        cell, *waypoints, knots=int(rng.integers(12, 40)), duration=float(rng.uniform(1.5, 3)),
        aggregate=("mean", "worst")[int(rng.integers(0, 2))],
        smoothness=float(rng.uniform(0.0, 0.05)),
    )  # fmt: skip


def trapped() -> dict:
    """Two planar arms; who follows from the start without looking ahead meets a limit of arm a1."""
    cell = planar(2)
    one, other = cell["arms"]
    one["position_limits"] = [[-1.9, 0.6], [-0.5, 2.2], [-0.7, 1.4]]
    one["start"], other["start"] = [-1.678, 2.2, 0.648], [2.98, -1.476, 2.461]
    one["velocity_limits"] = other["velocity_limits"] = [2.5, 2.5, 2.5]
    return along(cell, {"position": [-0.09, 0.17]}, {"position": [-0.22, 0.09]}, knots=20)


def cut_off() -> dict:
    """Two planar arms; limits cut a1's self-motion, and the best posture is on the other part."""
    cell = planar(2)
    cell["arms"][0]["position_limits"] = [[-2.3, 1.1], [-2.3, 1.8], [-2.7, 2.4]]
    cell["arms"][0]["start"] = [-1.367, 1.62, 1.112]
    return cell


def three_jointed(seed: int) -> dict:
    """One or two planar 3-joint arms on hinges with links, limits and a path drawn by a seed."""
    rng = np.random.default_rng([seed, 7])
    cell = planar(1 + seed % 2)
    if seed % 2 == 0:
        cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
    for arm in cell["arms"]:
        if rng.random() < 0.6:
            arm["velocity_limits"] = rng.uniform(1.5, 3, 3).tolist()
        if rng.random() < 0.6:
            low, high = rng.uniform(-3, -1.5, 3), rng.uniform(1.5, 3, 3)
            arm["position_limits"] = np.column_stack([low, high]).tolist()
        for link in arm["links"]:
            link["length"] = float(rng.uniform(0.3, 0.5))
            link["mass"] = float(rng.uniform(0.5, 1.5))
    waypoints = [{"position": rng.uniform(-0.2, 0.2, 2).tolist()} for _ in range(2 + seed % 3 // 2)]
    mode = "worst" if seed % 4 == 3 else "mean"
    return along(cell, *waypoints, knots=20, smoothness=0.02, aggregate=mode)
