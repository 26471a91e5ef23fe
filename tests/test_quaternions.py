"""Orientations may be written as quaternions, wherever a pose stands."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import copose
from cells import planar, two_pandas
from copose.errors import InputError
from copose.motion.path.object_motion import ObjectMotion
from copose.problem import case_problems, moved, parse
from copose.problem.objects import Placement

TURN = [0.5, -0.5, 0.5, 0.5]


def turned(quaternion: object) -> dict:
    """Two Pandas with one orientation in every place that has one."""
    cell = two_pandas()
    cell["object"] |= {"quaternion": quaternion}
    cell["object"].pop("rpy", None)
    for arm in cell["arms"]:
        arm["base"] = {"position": [0.1, 0.2, 0.3], "quaternion": quaternion}
        arm["grasp"] = {"position": arm["grasp"]["position"], "quaternion": quaternion}
    shape = {"kind": "sphere", "radius": 0.1}
    cell["obstacles"] = [
        {"name": "o", "shape": shape, "position": [5, 0, 0], "quaternion": quaternion}
    ]
    cell["cases"] = [{"name": "c", "quaternion": quaternion}]
    return cell


def test_every_pose_takes_a_quaternion() -> None:
    rng = np.random.default_rng(0)
    drawn = [*rng.normal(size=(50, 4)), TURN, [0, 1, 0, 0], [-1, 0, 0, 0]]
    for quaternion in drawn:
        unit = np.array(quaternion) / np.linalg.norm(quaternion)
        # Off 1 by less than is refused: it is normalised.
        problem = parse(turned(list(unit * (1 + 9e-4))))
        wanted = Rotation.from_quat(unit, scalar_first=True).as_matrix()
        case = case_problems(problem)[0].object.pose
        poses = [problem.object.pose, problem.obstacles[0].pose, case]
        poses += [place.pose for arm in problem.arms for place in (arm.base, arm.grasp)]
        for pose in poses:
            assert np.abs(pose.rotation - wanted).max() < 1e-14
        assert np.abs(moved(problem, {"quaternion": unit}).object.pose.rotation - wanted).max() < (
            1e-14
        )


def test_waypoints_take_quaternions_and_hand_them_on() -> None:
    cell = two_pandas()
    cell["path"] = {"waypoints": [{"quaternion": TURN}, {"position": [0.5, 0.1, 0.5]}]}
    journey = ObjectMotion.of(parse(cell))
    wanted = Rotation.from_quat(TURN, scalar_first=True).as_matrix()
    for phase in (0.0, 0.5, 1.0):
        assert np.abs(journey.at(phase).pose.rotation - wanted).max() < 1e-14


def test_what_it_means_as_roll_pitch_yaw_is_what_freedom_offsets() -> None:
    cell, other = two_pandas(), two_pandas()
    cell["object"].pop("rpy", None)
    rpy = (0.3, -0.4, 0.5)
    x, y, z, w = Rotation.from_euler("xyz", rpy).as_quat()
    cell["object"]["quaternion"] = [-w, -x, -y, -z]
    other["object"]["rpy"] = list(rpy)
    problem = parse(cell)
    assert problem.object.rpy == pytest.approx(rpy, abs=1e-15)
    freed = {"roll": [-0.1, 0.1]}
    for each in (cell, other):
        each["object"]["freedom"] = freed
    one, two = (copose.Planner(parse(each)).problem.object for each in (cell, other))
    assert one.freedom == two.freedom and one.rpy == pytest.approx(two.rpy, abs=1e-15)


def test_planner_moves_an_object_by_quaternion_as_by_rpy() -> None:
    problem = parse(two_pandas())
    by_rpy = moved(problem, {"rpy": [0.1, 0.2, 0.3]})
    turn = Placement(rpy=(0.1, 0.2, 0.3)).pose.quaternion
    assert moved(problem, {"quaternion": turn}).object.rpy == pytest.approx(by_rpy.object.rpy)
    with pytest.raises(InputError, match="rpy and quaternion exclude each other"):
        moved(problem, {"quaternion": turn, "rpy": [0.0, 0.0, 0.0]})


PLACES = {
    "object": ("object", "object"),
    "base": ("arms[1] (right).base", "arms.1.base"),
    "grasp": ("arms[1] (right).grasp", "arms.1.grasp"),
    "obstacle": ("obstacles[0]", "obstacles.0"),
    "case": ("cases[0]", "cases.0"),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(
    ("written", "inside", "expected"),
    [
        ({"rpy": [0, 0, 0]}, "", "rpy and quaternion exclude each other; leave out one of them"),
        ({"quaternion": [1, 0.05, 0, 0]}, ".quaternion", "has norm 1.00125; a rotation [w, x, y"),
        ({"quaternion": [0, 0, 0, 0]}, ".quaternion", "has norm 0; a rotation"),
        ({"quaternion": [1, 0, 0]}, ".quaternion", "has 3 entries; 4 are needed"),
        ({"quaternion": [1, 0, 0, math.nan]}, ".quaternion[3]", "nan must be finite"),
    ],
    ids=["both", "norm", "zero", "short", "nan"],
)
def test_what_is_no_orientation(place: str, written: dict, inside: str, expected: str) -> None:
    cell = copy.deepcopy(turned(TURN))
    key, path = PLACES[place]
    node: object = cell
    for part in path.split("."):
        node = node[int(part)] if isinstance(node, list) else node[part]  # type: ignore[index]
    node.update(written)  # type: ignore[attr-defined]
    with pytest.raises(InputError) as caught:
        parse(cell)
    assert caught.value.key == f"{key}{inside}" and expected in caught.value.message


def test_the_plane_has_angles() -> None:
    cell = planar()
    cell["object"]["quaternion"] = TURN
    with pytest.raises(InputError, match=r"object\.quaternion: unknown key"):
        parse(cell)
