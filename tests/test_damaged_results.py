"""Damaged results: refused by file and key, or read, drawn and judged; never a traceback."""

from __future__ import annotations

import contextlib
import copy
import functools
import io
import json
import math
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import copose
from cells import planar, toml
from copose.commands.command_line import main
from copose.results import to_json
from path_problems import hinged
from test_fuzz import places

EXAMPLES = int(os.environ.get("COPOSE_FUZZ", "5"))
NUMBERS = [0, -1, 0.5, 1e-320, 1e-9, 1e7, 1e15, -1e99, 1e160, 1.7e308, 10**400, math.nan, True]
VALUES = [None, "", "x", "a1", "joint1", "$a_b$", "\x1b[31m", "\ud800", [], {}, [0.0], [[1.0, 2.0]]]


def heavy_cell() -> dict:
    """A cell whose evaluation states all that a result has."""
    cell = planar(world={"gravity": [0.0, -9.81]}, name="cell")
    for arm in cell["arms"]:
        arm["torque_limits"] = [30.0, 20.0, 10.0]
    cell["object"]["shape"] = {"kind": "disk", "radius": 0.1}
    obstacle = {"name": "wall", "position": [0.0, -0.5], "shape": {"kind": "box", "size": [1, 0.1]}}
    return cell | {"obstacles": [obstacle], "objective": {"kind": "isotropy"}}


@functools.cache
def evaluated() -> tuple[copose.Problem, dict]:
    """A problem and the result of evaluating its best posture."""
    problem = copose.parse(heavy_cell())
    best = copose.solve(problem, effort="low")
    return problem, json.loads(to_json(copose.evaluate(problem, best)))


@functools.cache
def placed() -> tuple[copose.Problem, dict]:
    """A problem with cases, and its result."""
    cell = heavy_cell() | {"objective": {"kind": "volume"}}
    cell["cases"] = [{"name": "low"}, {"name": "high", "position": [0.0, 0.15], "weight": 2.0}]
    problem = copose.parse(cell)
    return problem, json.loads(to_json(copose.solve(problem, effort="low")))


def at(answer: dict, path: tuple) -> tuple[dict | list, str | int]:
    """The table or array that holds a place, and its key there."""
    *above, key = path
    node = answer
    for part in above:
        node = node[part]
    return node, key


@st.composite
def damaged(draw: st.DrawFn, good: dict) -> dict:
    """A result of which one to three places are not as they were."""
    answer = copy.deepcopy(good)
    for _ in range(draw(st.sampled_from([1, 1, 1, 2, 3]))):
        if not places(answer):
            break
        node, key = at(answer, draw(st.sampled_from(places(answer))))
        how = draw(
            st.sampled_from(["number", "scale", "value", "remove", "repeat", "rename", "graft"])
        )
        if how == "scale" and isinstance(node[key], float):
            node[key] *= draw(st.sampled_from([-1.0, 0.999, 1e3, 1e30, 1e-30]))
        elif how == "remove":
            del node[key]
        elif how == "repeat" and isinstance(node, list):
            node.append(copy.deepcopy(node[key]))
        elif how == "rename" and isinstance(node, dict):
            node[draw(st.sampled_from(["x", "a1", "a3", "", "joints"]))] = node.pop(key)
        elif how == "graft":
            other, there = at(good, draw(st.sampled_from(places(good))))
            node[key] = copy.deepcopy(other[there])
        else:
            node[key] = copy.deepcopy(draw(st.sampled_from(NUMBERS if how == "number" else VALUES)))
    return answer


def outcome(problem: copose.Problem, good: dict, bad: dict) -> list[int]:
    """Exit statuses of what reads a damaged result, after looking at what is said and left."""
    statuses = []
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        Path("good.json").write_text(json.dumps(good))
        Path("bad.json").write_text(json.dumps(bad))
        Path("p.toml").write_text(toml(heavy_cell()))
        for arguments in (
            ["compare", "good.json", "bad.json"],
            ["evaluate", "p.toml", "--joints", "bad.json"],
        ):
            out, err = io.StringIO(), io.StringIO()
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                status = main(arguments)
            said = err.getvalue()
            assert status in (0, 2, 3) and said.count("\n") == (status != 0), said
            assert len(said) <= 600 and ("bad.json" in said) == (status == 2), said
            statuses.append(status)
        with contextlib.suppress(copose.InputError):
            solution = copose.read_solution("bad.json")
            copose.verify(problem, solution)
    return statuses


@pytest.mark.parametrize("make", [evaluated, placed])
def test_damaged_results_are_refused_or_judged(make) -> None:
    problem, good = make()

    @settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck))
    @given(damaged(good))
    def judge(bad: dict) -> None:
        outcome(problem, good, bad)

    judge()


@pytest.mark.parametrize("make", [evaluated, placed])
def test_damaged_results_are_read_or_refused(make, tmp_path: Path) -> None:
    _, good = make()
    file = tmp_path / "bad.json"
    refused = []

    @settings(max_examples=10 * EXAMPLES, suppress_health_check=list(HealthCheck))
    @given(damaged(good))
    def read(bad: dict) -> None:
        file.write_text(json.dumps(bad))
        try:
            copose.read_solution(file)
        except copose.InputError as error:
            refused.append(str(error))

    read()
    assert len(refused) > 3 * EXAMPLES
    assert all(f"{file}: is no copose result (" in words for words in refused)


DAMAGES = [
    (
        ("after", "arms", "a1", "skeleton", 1),
        [0.0, 0.0],
        "a1.skeleton: not of 3 numbers",
    ),
    (("after", "arms", "a1", "skeleton", 1, 0), -1e308, "after.arms.a1.skeleton.1.0: -1e+308 is"),
    (("after", "arms", "a1", "skeleton", 1, 0), True, "after.arms.a1.skeleton.1.0: Input should"),
    (("after", "arms", "a1", "ellipsoid", "radii", 0), 0, "ellipsoid.radii: not one positive"),
    (("after", "arms", "a2", "ellipsoid", "axes", 1), [0.1], "ellipsoid.gram, axes: not of 2 rows"),
    (("after", "ellipsoid", "axes", 1, 0), 0.5, "after.ellipsoid.axes: not unit vectors"),
    (("after", "ellipsoid", "radii", 0), 1e4, "after.ellipsoid.gram: not that of radii and axes"),
    (("after", "ellipsoid", "radii"), None, "after.ellipsoid.radii: null, and others are not"),
    (("after", "ellipsoid", "log_volume"), 7.0, "after.ellipsoid.log_volume: not that of radii"),
    (("after", "ellipsoid", "center"), [0.0], "after.ellipsoid.center: not of 2 numbers"),
    (("after", "arms", "x"), {}, "after.arms.x.skeleton: Field required"),
    (("after", "closure_error", "x"), 0.0, "after.closure_error: not of the arms"),
    (("after", "closure_error", "a1"), -1.0, "after.closure_error: below zero"),
    (("after", "joints", "a1", 0), 1e300, "after.joints.a1.0: 1e+300 is larger than any can be"),
    (("after", "static_torque", "a1"), [0.1], "after.static_torque: not those that joint_names"),
    (("after", "wrenches", "hold", "a1", "wrench"), [1.0], "after.wrenches.hold: not of 2 numbers"),
    (("after", "exact_sets", "linear", "vertices", 0), [1.0], "vertices: not of 2 numbers each"),
    (("after", "log_volumes"), {}, "after.log_volumes: not those of"),
    (("problem", "space"), "spatial-linear", "not of the task space"),
    (("problem", "axes"), ["x", "x"], "problem.axes: not coordinates of the task space"),
    (("joint_names", "a1", 0), "joint2", "joint_names: not the different joints"),
    (("status",), "failed", "status: does not go with after"),
    (("unlimited", "a1"), ["x"], "unlimited: not joints that joint_names lists"),
]


@pytest.mark.parametrize(("path", "value", "words"), DAMAGES)
def test_damage_is_told_by_its_key(path: tuple, value: object, words: str, tmp_path: Path) -> None:
    _, good = evaluated()
    bad = copy.deepcopy(good)
    node, key = at(bad, path)
    node[key] = value
    (tmp_path / "bad.json").write_text(json.dumps(bad))
    with pytest.raises(copose.InputError) as caught:
        copose.read_solution(tmp_path / "bad.json")
    assert words in str(caught.value)


def test_damaged_motions_are_refused(tmp_path: Path) -> None:
    motion = copose.plan(copose.parse(hinged(knots=8)))
    good, file = json.loads(to_json(motion)), tmp_path / "bad.json"
    file.write_text(json.dumps(good))
    assert copose.read_motion(file) == motion
    for path, value, words in (
        (("time", 3), 1e3, "time: does not run forwards"),
        (("knots", 2, "velocity", "a1"), [0.0], "knots.2.velocity: not those"),
        (("knots", 2, "joints", "a1"), [0.0], "knots.2.joints: not those"),
        (("limits", "a1"), [], "limits: not those"),
        (("knots",), None, "status: does not go with knots"),
    ):
        bad = copy.deepcopy(good)
        node, key = at(bad, path)
        node[key] = value
        file.write_text(json.dumps(bad))
        with pytest.raises(copose.InputError, match=words):
            copose.read_motion(file)
