"""Motions are what they say, by arithmetic that shares nothing with what planned them."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from baselines_path import Tracker

import copose
import path_problems
from copose.motion import plan
from copose.results import to_json
from copose.robots import load_arms
from made_motions import motion_of
from object_path import ObjectPath, axis_angle, from_rpy
from path_truth import faults

SMALL: dict[str, Callable[[], dict]] = {
    "hinged": path_problems.hinged,
    "hinged, worst": lambda: path_problems.hinged(aggregate="worst"),
    "single hinged": path_problems.single_hinged,
    "gripped": path_problems.gripped,
    "carried": lambda: path_problems.carried(25),
    "balled": lambda: path_problems.balled(25),
    "panda": lambda: path_problems.alone("panda"),
    "xarm7": lambda: path_problems.alone("xarm7"),
}


@cache
def planned(name: str) -> dict:
    """The motion of a small problem as JSON has it."""
    return json.loads(to_json(plan(copose.parse(SMALL[name]()))))


def tracked(tables: dict) -> dict:
    """The first least-norm motion that keeps the limits, from random postures."""
    tracker = Tracker(tables)
    names = {arm.name: list(arm.joint_names) for arm in load_arms(copose.parse(tables))}
    motions = (tracker.follow(start, hold=False) for start in tracker.starts(40, 0))
    motion = next(motion for motion in motions if motion.reason is None)
    return motion_of(tables, names, motion, tracker)


@pytest.mark.parametrize("planar", [False, True])
def test_the_objects_velocities_are_derivatives_of_its_pose(planar: bool) -> None:
    tables = path_problems.hinged() if planar else path_problems.alone("panda")
    tables["path"]["waypoints"].insert(1, {})
    tables["path"]["waypoints"].append({"position": [0.1, 0.1] if planar else [0.3, 0.1, 0.2]})
    path = ObjectPath(tables, 3.0)
    h = 1e-5
    for t in np.random.default_rng(0).uniform(h, 3 - h, 40):
        before, now, after = path.at(t - h), path.at(t), path.at(t + h)
        assert np.allclose((after.position - before.position) / (2 * h), now.velocity, atol=1e-7)
        axis, angle = axis_angle(after.rotation @ before.rotation.T)
        assert np.allclose(axis * angle / (2 * h), now.omega, atol=1e-7)
        rate = (after.velocity - before.velocity) / (2 * h)
        assert np.allclose(rate, now.acceleration, atol=1e-6)
        assert np.allclose((after.omega - before.omega) / (2 * h), now.alpha, atol=1e-6)
    for end in path.ends:
        assert not np.any([path.at(end).velocity, path.at(end).omega])
    assert path.at(3.0).position == pytest.approx(path.places[-1][0], abs=1e-15)
    assert len(set(path.ends)) == len(path.ends) - 1


def test_the_way_of_the_object_is_straight_and_the_shortest_turn() -> None:
    tables = path_problems.hinged()
    tables["path"]["waypoints"] = [{"angle": 3.0}, {"angle": -3.0}, {"position": [1.0, 0.1]}]
    path = ObjectPath(tables, 1.0)
    turn, length = 2 * math.pi - 6, 1.0
    assert path.ends[1] == pytest.approx(0.3 * turn / (0.3 * turn + length))
    half = path.at(path.ends[1] / 2)
    assert half.rotation == pytest.approx(from_rpy(0, 0, math.pi), abs=1e-12)
    assert half.omega[2] == pytest.approx(15 / 8 * turn / path.ends[1])
    assert path.at((1 + path.ends[1]) / 2).position == pytest.approx([0.5, 0.1, 0.0])


@pytest.mark.parametrize(
    "tables",
    [
        path_problems.hinged(), path_problems.single_hinged(), path_problems.gripped(),
        path_problems.carried(), path_problems.balled(), path_problems.alone("xarm7"),
    ],
    ids=lambda tables: tables["name"] + " " + tables["task"]["space"],
)  # fmt: skip
def test_least_norm_motions_have_no_fault(tables: dict) -> None:
    assert faults(tables, tracked(tables)) == []


@pytest.mark.parametrize("name", SMALL)
def test_planned_motions_have_no_fault(name: str) -> None:
    assert faults(SMALL[name](), planned(name)) == []


@pytest.mark.few(4)
@pytest.mark.parametrize("seed", [0, 2, 3, 4, 6, 8, 11, 12, 16, 18, 20, 26])
def test_motions_of_drawn_planar_problems_have_no_fault(seed: int) -> None:
    tables = path_problems.drawn(seed)
    assert faults(tables, json.loads(to_json(plan(copose.parse(tables))))) == []


def test_what_tracking_comes_to_is_told() -> None:
    for name in ("hinged", "hinged, worst", "xarm7"):
        motion, tables = planned(name), SMALL[name]()
        tables["path"]["knots"] = len(motion["time"])
        tracker = Tracker(tables)
        first = np.concatenate(list(motion["knots"][0]["joints"].values()))
        alone = tracker.follow(first, hold=False)
        # Both follow in steps; the planner's are the coarser.
        assert motion["objective"]["before"] == pytest.approx(
            alone.aggregate(tracker.mode), abs=5e-4
        )
        assert motion["objective"]["before"] <= motion["objective"]["after"] + 1e-9


def joint(motion: dict, k: int, arm: str) -> None:
    motion["knots"][k]["joints"][arm][1] += 1e-4


def speed(motion: dict, k: int, arm: str) -> None:
    motion["knots"][k]["velocity"][arm][0] += 1e-4


def acceleration(motion: dict, k: int, arm: str) -> None:
    motion["knots"][k]["acceleration"][arm][2] += 1e-3


def torque(motion: dict, k: int, arm: str) -> None:
    row = motion["knots"][k]["torque"][arm]
    largest = int(np.argmax(np.abs(row)))
    row[largest] *= 1.01


def swap(motion: dict, k: int, arm: str) -> None:
    knots = motion["knots"]
    knots[k], knots[k + 1] = knots[k + 1], knots[k]


def object_(motion: dict, k: int, arm: str) -> None:
    motion["knots"][k]["object"]["position"][1] += 1e-6


def value(motion: dict, k: int, arm: str) -> None:
    motion["knots"][k]["objective"] += 1e-6


def aggregate(motion: dict, k: int, arm: str) -> None:
    motion["objective"]["after"] += 1e-6


def roughness(motion: dict, k: int, arm: str) -> None:
    motion["smoothness"] *= 1.001


def opening(motion: dict, k: int, arm: str) -> None:
    motion["between_knots_error"] /= 2


def time(motion: dict, k: int, arm: str) -> None:
    motion["time"][k] += 1e-6


def limit(motion: dict, k: int, arm: str) -> None:
    motion["limits"][arm][0]["velocity"] = 1.0


@pytest.mark.parametrize("name", ["hinged", "gripped", "carried"])
@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (joint, "open by"), (speed, "m/s or rad/s off"), (acceleration, "m/s² or rad/s² off"),
        (torque, "under its torques the joints"), (torque, "under its torques the object"),
        (swap, "off its path"), (object_, "off its path"), (value, "objective"),
        (aggregate, "aggregate"), (roughness, "S is"), (opening, "between knots the chain"),
        (time, "uniform"), (limit, "limit velocity"),
    ],
)  # fmt: skip
def test_what_is_spoiled_is_found(name: str, spoil: Callable, word: str) -> None:
    motion = copy.deepcopy(planned(name))
    spoil(motion, 7, list(motion["joint_names"])[-1])
    assert any(word in fault for fault in faults(SMALL[name](), motion))


def test_beyond_a_limit_is_found() -> None:
    motion = planned("gripped")
    for key, values in (
        ("position_limits", [[-2.8, 2.8], [-0.3, 0.1], [-2.6, 2.6], [-2.2, 2.2]]),
        ("velocity_limits", [0.01] * 4), ("acceleration_limits", [0.01] * 4),
    ):  # fmt: skip
        tables = SMALL["gripped"]()
        tables["arms"][0][key] = values
        assert any("beyond its limit" in fault for fault in faults(tables, motion))


def test_an_object_without_torques_has_none() -> None:
    # A tip beside the centre of mass cannot keep a free object from spinning.
    tables = path_problems.single_hinged()
    tables["arms"][0]["grasp"] = {"position": [0.1, 0.0]}
    motion = json.loads(to_json(plan(copose.parse(tables))))
    assert motion["knots"][5]["torque"] is None
    assert faults(tables, motion) == []
