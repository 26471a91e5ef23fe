"""What another simulator makes of a motion's torques: the arms carry the box along its path."""

from __future__ import annotations

import copy
import json
from functools import cache

import copose
import path_problems
from copose.motion import plan
from copose.results import to_json
from path_truth import faults
from playback import played


@cache
def motion() -> dict:
    """Two Pandas carry a box."""
    return json.loads(to_json(plan(copose.parse(path_problems.carried()))))


def test_two_pandas_carry_the_box_by_the_torques_that_are_told() -> None:
    tables = path_problems.carried()
    assert faults(tables, motion()) == []
    went = played(tables, motion())
    assert went.off.max() < 2e-3
    assert went.turned.max() < 5e-3
    assert went.share < 0.05
    assert went.opening < 1e-5


def test_wrong_torques_are_felt() -> None:
    tables, spoiled = path_problems.carried(), copy.deepcopy(motion())
    for knot in spoiled["knots"]:
        knot["torque"] = {arm: [0.9 * x for x in row] for arm, row in knot["torque"].items()}
    assert played(tables, spoiled).share > 0.05
    tables["object"]["mass"] = 6.0
    assert played(tables, motion()).share > 0.05


def test_one_arm_alone_carries_its_part() -> None:
    tables = path_problems.alone("xarm7")
    went = played(tables, json.loads(to_json(plan(copose.parse(tables)))))
    assert went.off.max() < 2e-3 and went.turned.max() < 5e-3
    assert went.share < 0.05
