"""Self-motions to move along and the objective over them, against Pinocchio, closed forms, other
ways to the same numbers, and the search."""

from __future__ import annotations

import base64
import io
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import copose
from cells import planar, tables
from copose.errors import InputError
from copose.live.plots.landscape_figure import curve_svg, short_name
from copose.live.plots.landscape_map import map_svg
from copose.problem import moved, parse
from reference import UrdfArm, pose

TURN = 2 * math.pi
LIMITS = [[-2.0, 2.0], [-1.9, 2.6], [-2.4, 2.2]]


def limited(**extra: object) -> dict:
    """Two arms with three joints each and one degree of freedom to spare, with limits."""
    cell = planar(**extra)
    for arm in cell["arms"]:
        arm["position_limits"] = LIMITS
    return cell


def tip(table: dict, q: np.ndarray) -> np.ndarray:
    """Where the tip of a planar arm is, by its links."""
    turn = table["base"].get("angle", 0.0) + np.cumsum(q)
    reach = np.array([link["length"] for link in table["links"]])
    return np.add(table["base"]["position"], (reach @ np.cos(turn), reach @ np.sin(turn)))


def off(table: dict, thing: dict, q: np.ndarray) -> float:
    """How far the tip of a planar arm is from its grasp."""
    held = np.array(thing["position"]) + table["grasp"]["position"]
    return float(np.abs(tip(table, q) - held).max())


def solved(cell: dict) -> tuple[copose.Planner, copose.Solution, dict]:
    planner = copose.Planner(parse(cell))
    solution = planner.solve(effort="low")
    assert solution.after is not None
    return planner, solution, {k: np.array(v) for k, v in solution.after.joints.items()}


@pytest.fixture(scope="module")
def pandas() -> tuple:
    cell = tables("two-panda-box")
    planner, solution, joints = solved(cell)
    return (
        cell,
        planner,
        solution,
        joints,
        planner.landscape(joints, "left", "right", branches=True),
    )


@pytest.fixture(scope="module")
def two_arms() -> tuple:
    cell = limited()
    planner, solution, joints = solved(cell)
    return cell, planner, solution, joints, planner.landscape(joints, "a1", "a2", branches=True)


def every_curve(curve) -> list:
    return [curve, *curve.others]


@given(part=st.floats(-1.5, 2.5), arm=st.sampled_from(["left", "right"]), which=st.integers(0, 1))
@settings(max_examples=60)
def test_postures_along_a_self_motion_hold_the_object(pandas, part, arm, which) -> None:
    cell, _, _, joints, landscape = pandas
    curve = landscape.first if arm == "left" else landscape.second
    curve = every_curve(curve)[which]
    table = next(each for each in cell["arms"] if each["name"] == arm)
    truth = UrdfArm(table, list(curve.joint_names))
    placed = pose(cell["object"]) * pose(table["grasp"])
    q = curve.at(part * curve.length)
    away = truth.at(q)[0].actInv(placed)
    assert np.abs(away.translation).max() < 1e-8
    assert np.abs(away.rotation - np.eye(3)).max() < 1e-8
    assert q.shape == joints[arm].shape
    # Round a loop they repeat.
    assert curve.loop
    apart = (curve.at((part + 1) * curve.length) - q) / TURN
    assert np.abs(apart - np.round(apart)).max() < 1e-8


def test_knots_are_evenly_spaced_postures_by_arc_length(pandas) -> None:
    landscape = pandas[4]
    for curve in every_curve(landscape.first):
        steps = np.diff(curve.positions)
        assert steps.max() < 2.1 * np.median(steps) and steps.min() > 0.4 * np.median(steps)
        dense = np.linspace(0, curve.length, 6001)
        q = curve.track.closed(dense)
        chords = np.linalg.norm(np.diff(q, axis=0), axis=1)
        assert chords.sum() == pytest.approx(curve.length, abs=1e-4)
        # Arc length is the parameter everywhere, not on the whole alone.
        assert np.abs(np.cumsum(chords) - dense[1:]).max() < 1e-3
        assert np.abs(curve.points[0] - curve.track.closed(np.zeros(1))[0]).max() < 1e-9


def test_values_are_those_that_measure_gives(pandas) -> None:
    _, planner, _, joints, landscape = pandas
    for curve, name, other in (
        (landscape.first, "left", "right"),
        (landscape.second, "right", "left"),
    ):
        rows = np.arange(0, len(curve.positions), 17)
        rest = np.tile(joints[other], (len(rows), 1))
        truth = planner.measure({name: curve.points[rows], other: rest})
        assert curve.objective[rows] == pytest.approx(truth.objective, abs=1e-9)
        assert max(error.max() for error in truth.closure_error.values()) < 1e-8
    a, b = np.array([3, 40, 77, 119]), np.array([0, 55, 90, 111])
    left, right = (
        landscape.first.postures(landscape.rows[a]),
        landscape.second.postures(landscape.columns[b]),
    )
    truth = planner.measure({"left": left, "right": right})
    assert landscape.values[a, b] == pytest.approx(truth.objective, abs=1e-9)


def test_the_best_of_all_maps_is_the_search_s(pandas) -> None:
    _, _, solution, _, landscape = pandas
    maps = [landscape, *landscape.others]
    assert len(maps) == len(every_curve(landscape.first)) * len(every_curve(landscape.second)) == 4
    grid = max(each.values[each.allowed].max() for each in maps if each.allowed.any())
    best = solution.objective.after
    assert best - 1e-3 < grid < best + 1e-9
    assert landscape.present is not None and landscape.best is not None
    assert landscape.present[2] == pytest.approx(best, abs=1e-9)
    assert landscape.best[2] >= landscape.present[2]
    # Of other self-motions none is where the arms are.
    assert all(each.present is None for each in landscape.others)


def test_the_present_posture_is_where_it_is_said_to_be(pandas, two_arms) -> None:
    for names, (_, _, _, joints, landscape) in (
        (("left", "right"), pandas),
        (("a1", "a2"), two_arms),
    ):
        for name, curve in zip(names, (landscape.first, landscape.second), strict=True):
            assert curve.arm == name and curve.present is not None
            assert np.abs(curve.at(curve.present) - joints[name]).max() < 1e-8
            assert curve.piece(curve.present) is not None
            assert {each.branch for each in every_curve(curve)} == set(range(1 + len(curve.others)))


@pytest.mark.parametrize("cell", ["pandas", "two_arms"])
def test_limits_cut_where_a_joint_meets_its_own(cell, request) -> None:
    _, planner, _, _, landscape = request.getfixturevalue(cell)
    arms = {arm.name: arm for arm in planner._model.cell.arms}
    met = 0
    for curve in (*every_curve(landscape.first), *every_curve(landscape.second)):
        arm = arms[curve.arm]
        for cut in curve.cuts:
            q = curve.track.closed(np.array([cut.position]))[0]
            limit = (arm.upper if cut.upper else arm.lower)[cut.joint]
            turns = (q[cut.joint] - limit) / TURN
            assert abs(turns - round(turns)) < 1e-8
            before, after = curve.within(np.array([cut.position - 1e-4, cut.position + 1e-4]))
            assert (before, after) == (not cut.entering, cut.entering)
            assert cut.position in curve.positions
            assert curve.at(cut.position)[cut.joint] == pytest.approx(limit, abs=1e-8)
            met += 1
        s = np.linspace(0, curve.length, 1501)
        q = curve.postures(s)
        beyond = np.maximum(arm.lower - q, q - arm.upper).max(axis=1)
        inside = curve.within(s)
        assert 0 < inside.mean() < 1
        assert beyond[inside].max() < 1e-9
        assert beyond[~inside].min() > 0
        assert np.array_equal(curve.inside, curve.within(curve.positions))
    assert met >= 8


@given(part=st.floats(0, 1), step=st.floats(1e-4, 0.2), which=st.integers(0, 3))
@settings(max_examples=80)
def test_moving_along_has_no_jumps(pandas, part, step, which) -> None:
    landscape = pandas[4]
    curve = (*every_curve(landscape.first), *every_curve(landscape.second))[which]
    low, high = max(curve.pieces, key=lambda piece: piece[1] - piece[0])
    here = low + part * (high - low - step)
    away = np.linalg.norm(curve.at(here + step) - curve.at(here))
    assert 0.6 * step < away < step * (1 + 1e-3)


@given(part=st.floats(0.02, 0.98), which=st.integers(0, 1))
@settings(max_examples=12)
def test_a_self_motion_is_the_same_from_any_posture_on_it(two_arms, part, which) -> None:
    _, planner, _, joints, landscape = two_arms
    curve = every_curve(landscape.first)[min(which, len(landscape.first.others))]
    low, high = max(curve.pieces, key=lambda piece: piece[1] - piece[0])
    s = low + part * (high - low)
    moved = joints | {"a1": curve.at(s)}
    again = planner.self_motion(moved, "a1")
    assert again.branch == curve.branch and again.length == pytest.approx(curve.length, abs=1e-4)
    assert again.present == pytest.approx(s, abs=2e-3)
    assert np.abs(again.at(again.present) - moved["a1"]).max() < 1e-8
    assert np.array(again.pieces) == pytest.approx(np.array(curve.pieces), abs=2e-3)
    # What is known need not be followed again.
    known = planner.self_motion(moved, "a1", known=landscape.first)
    assert known.branch == curve.branch and known.present == pytest.approx(s, abs=1e-6)
    assert known.positions is curve.positions or np.array_equal(known.positions, curve.positions)
    value = planner.measure({k: np.array(q)[None] for k, q in moved.items()}).objective[0]
    assert known.value == pytest.approx(value, abs=1e-9)


def test_self_motions_keep_their_numbers_and_their_way(pandas) -> None:
    """Wherever on them the arm is."""
    cell, planner, _, joints, landscape = pandas
    for name, curve in (("left", landscape.first), ("right", landscape.second)):
        other = curve.others[0]
        s = 0.3 * other.pieces[0][0] + 0.7 * other.pieces[0][1]
        again = planner.self_motion(joints | {name: other.at(s)}, name)
        assert again.branch == other.branch and again.present == pytest.approx(s, abs=1e-3)
        assert [each.branch for each in again.others] == [curve.branch]
        assert np.array(again.others[0].pieces) == pytest.approx(np.array(curve.pieces), abs=1e-3)
        table = next(arm for arm in cell["arms"] if arm["name"] == name)
        truth = UrdfArm(table, list(curve.joint_names))
        for each in (curve, other, again):
            ahead = np.gradient(each.points, each.positions, axis=0)
            A = [np.vstack([truth.at(q)[1], t]) for q, t in zip(each.points, ahead, strict=True)]
            assert np.linalg.det(A).min() > 0


def test_what_is_known_elsewhere_is_found_anew(two_arms) -> None:
    _, planner, _, joints, landscape = two_arms
    place = {"position": [0.03, 0.12]}
    held = planner.polish(joints, object_pose=place).joints
    elsewhere = moved(planner.problem, place)
    fresh = planner.self_motion(held, "a1", problem=elsewhere)
    again = planner.self_motion(held, "a1", problem=elsewhere, known=landscape.first)
    assert np.array_equal(again.positions, fresh.positions)
    assert np.array_equal(again.objective, fresh.objective)
    assert again.pieces != landscape.first.pieces
    # Where only the mass is another the way is known, and values are not.
    heavy = parse(limited(object={"mass": 2.0, "inertia": 0.01, "position": [0.0, 0.1]}))
    fresh = planner.landscape(joints, "a1", "a2", problem=heavy)
    again = planner.landscape(joints, "a1", "a2", problem=heavy, known=landscape)
    assert again.first.positions is landscape.first.positions
    assert again.values == pytest.approx(fresh.values, abs=1e-6)
    assert np.abs(again.values - landscape.values).max() > 0.1


def test_a_four_bar_linkage_in_closed_form() -> None:
    """Three links whose tip stays are two loops where the ground link is short enough (Grashof);
    joint 1 turns all the way round on both.
    """
    bars, distance = (0.15, 0.5, 0.45), 0.4
    cell = planar(1, 3)
    cell["object"]["position"] = [distance, 0.0]
    cell["arms"][0] |= {
        "links": [{"length": a, "mass": 1.0, "inertia": 0.03, "com": a / 2} for a in bars],
        "base": {"position": [0.0, 0.0]},
        "grasp": {"position": [0.0, 0.0]},
    }
    planner, _, joints = solved(cell)
    curve = planner.self_motion(joints, "a1")
    assert curve.loop and not curve.cuts and len(curve.others) == 1
    assert curve.inside.all() and curve.pieces == ((0.0, curve.length),)
    a, b, c = bars
    q1 = np.linspace(0, TURN, 20001)
    x, y = distance - a * np.cos(q1), -a * np.sin(q1)
    q3 = np.arccos((x**2 + y**2 - b**2 - c**2) / (2 * b * c))
    q2 = np.arctan2(y, x) - np.arctan2(c * np.sin(q3), b + c * np.cos(q3)) - q1
    truth = np.column_stack([q1, np.unwrap(q2), q3])
    length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
    for each in every_curve(curve):
        assert each.length == pytest.approx(length, abs=1e-4)
        q = each.postures(np.linspace(0, each.length, 200))
        assert len(set(np.sign(np.sin(q[:, 2])))) == 1
        assert (
            np.abs(np.abs(np.arccos(np.cos(q[:, 2]))) - np.interp(q[:, 0] % TURN, q1, q3)).max()
            < 1e-6
        )
        winding = each.points[-1] - each.points[0]
        assert abs(winding[0]) == pytest.approx(TURN, abs=1e-9)


def test_bodies_in_the_way_are_told() -> None:
    cell = planar(constraints={"collision": True})
    for arm in cell["arms"]:
        arm["position_limits"] = [[-2.9, 2.9]] * 3
        arm["grasp"]["position"] = [math.copysign(0.2, arm["grasp"]["position"][0]), 0.0]
        for link in arm["links"]:
            link["radius"] = 0.06
    planner, _, joints = solved(cell)
    landscape = planner.landscape(joints, "a1", "a2")
    machinery, setting = planner._model, planner._nominal
    one = landscape.first.postures(landscape.rows[::8])
    other = landscape.second.postures(landscape.columns[::8])
    q = np.hstack([np.repeat(one, len(other), axis=0), np.tile(other, (len(one), 1))])
    truth = machinery.feasibility.clear(setting, q).reshape(len(one), len(other))
    within = landscape.first.within(landscape.rows)[::8, None]
    within = within & landscape.second.within(landscape.columns)[::8]
    assert np.array_equal(landscape.allowed[::8, ::8], truth & within)
    # The arms touch each other, too: it takes both to tell.
    alone = truth.any(axis=1)[:, None] & truth.any(axis=0)
    assert 0 < truth[within].mean() < alone[within].mean() < 1
    curve = landscape.first
    stacked = np.hstack([curve.points, np.tile(joints["a2"], (len(curve.points), 1))])
    there = machinery.feasibility.clear(setting, stacked) | ~curve.inside
    assert np.array_equal(curve.clear, there) and not there.all()


def torqued(**extra: object) -> dict:
    cell = limited(**extra)
    cell["world"] = {"gravity": [0.0, -9.81]}
    for arm in cell["arms"]:
        arm["torque_limits"] = [30.0, 20.0, 10.0]
    return cell


def test_torque_limits_are_looked_at_on_a_coarser_grid() -> None:
    planner, solution, joints = solved(torqued(objective={"kind": "payload"}))
    landscape = planner.landscape(joints, "a1", "a2")
    assert landscape.values.shape == (24, 24) and landscape.unit == "kg"
    assert not landscape.estimated
    rows, columns = np.nonzero(landscape.allowed)
    left = landscape.first.postures(landscape.rows[rows[::20]])
    right = landscape.second.postures(landscape.columns[columns[::20]])
    truth = planner.measure({"a1": left, "a2": right}).objective
    assert len(truth) > 4
    assert landscape.values[rows[::20], columns[::20]] == pytest.approx(truth, abs=1e-7)
    assert landscape.present is not None
    assert landscape.present[2] == pytest.approx(solution.objective.after, rel=1e-6)


def test_the_dearest_objective_is_estimated() -> None:
    planner, _, joints = solved(torqued(objective={"kind": "all-round"}))
    landscape = planner.landscape(joints, "a1", "a2")
    assert landscape.values.shape == (16, 16) and landscape.estimated and landscape.first.estimated
    assert np.isfinite(landscape.first.objective[landscape.first.inside]).all()
    assert "≈" in curve_svg(landscape.first) and "≈" in map_svg(landscape)


def test_what_cannot_be_held_at_rest_is_not_allowed() -> None:
    cell = torqued(constraints={"static_torque": True})
    for arm in cell["arms"]:
        arm["torque_limits"] = [7.0, 5.0, 2.5]
    planner, _, joints = solved(cell)
    landscape = planner.landscape(joints, "a1", "a2")
    one, other = np.meshgrid(landscape.rows, landscape.columns, indexing="ij")
    q = {
        "a1": landscape.first.postures(one.ravel()),
        "a2": landscape.second.postures(other.ravel()),
    }
    share = planner.measure(q).share.reshape(one.shape)
    within = landscape.first.within(landscape.rows)[:, None]
    within = within & landscape.second.within(landscape.columns)
    assert np.array_equal(landscape.allowed, within & (share <= 1 + 1e-6))
    assert 0 < landscape.allowed[within].mean() < 1
    curve = landscape.first
    rest = np.tile(joints["a2"], (len(curve.points), 1))
    share = planner.measure({"a1": curve.points, "a2": rest}).share
    inside = curve.inside
    assert np.array_equal(curve.held[inside], share[inside] <= 1 + 1e-6)
    assert 0 < curve.held[inside].mean() < 1


@given(
    direction=st.integers(0, 1),
    amounts=st.lists(st.floats(-0.4, 0.4), min_size=1, max_size=4),
)
@settings(max_examples=25)
def test_a_null_motion_keeps_hold(many_joints, direction, amounts) -> None:
    cell, planner, joints = many_joints
    q, basis = joints["a1"], None
    for amount in amounts:
        moved = planner.null_motion(joints | {"a1": q}, "a1", direction, amount, basis=basis)
        assert off(cell["arms"][0], cell["object"], moved.joints) < 1e-8
        assert np.all(np.abs(moved.joints) <= 2.8 + 1e-12)
        assert moved.basis @ moved.basis.T == pytest.approx(np.eye(2), abs=1e-9)
        assert abs(moved.amount) <= abs(amount) + 1e-12 and moved.amount * amount >= 0
        assert np.linalg.norm(moved.joints - q) <= 1.5 * abs(moved.amount) + 1e-9
        if basis is not None and abs(moved.amount) > 0:
            # Rows stand for nearly the same directions after a short way.
            assert np.einsum("dn,dn->d", basis, moved.basis).min() > 0.2
        # Null: the tip does not follow a short step along any row.
        for row in moved.basis:
            step = moved.joints + 1e-6 * row
            assert off(cell["arms"][0], cell["object"], step) < 1e-9 + 1e-11
        q, basis = moved.joints, moved.basis


@pytest.fixture(scope="module")
def many_joints() -> tuple:
    cell = planar(2, 4)
    for arm in cell["arms"]:
        arm["position_limits"] = [[-2.8, 2.8]] * 4
    planner, _, joints = solved(cell)
    return cell, planner, joints


def test_a_null_motion_follows_its_direction_and_comes_back(many_joints) -> None:
    _, planner, joints = many_joints
    inside = dict(joints)
    inside["a1"] = planner.null_motion(joints, "a1", 0, 0.15).joints
    start = inside["a1"]
    for direction in (0, 1):
        still = planner.null_motion(inside, "a1", direction, 0.0)
        assert np.array_equal(still.joints, planner.null_motion(inside, "a1", 1, 0.0).joints)
        there = planner.null_motion(inside, "a1", direction, 1e-3, basis=still.basis)
        assert there.joints - start == pytest.approx(1e-3 * still.basis[direction], abs=1e-5)
        back = planner.null_motion(
            inside | {"a1": there.joints}, "a1", direction, -1e-3, basis=there.basis
        )
        assert back.joints == pytest.approx(start, abs=1e-5)


def test_a_null_motion_needs_no_limits() -> None:
    cell = planar(2, 4)
    planner, _, joints = solved(cell)
    moved = planner.null_motion(joints, "a1", 0, 0.2)
    assert moved.amount == pytest.approx(0.2)
    assert off(cell["arms"][0], cell["object"], moved.joints) < 1e-8


def test_a_null_motion_ends_where_limits_stop_it(two_arms) -> None:
    _, planner, _, joints, landscape = two_arms
    curve = landscape.first
    low, high = curve.piece(curve.present)
    ends = [planner.null_motion(joints, "a1", 0, amount) for amount in (9.0, -9.0)]
    far = sorted(curve.track.place(end.joints) for end in ends)
    assert far == pytest.approx([low, high], abs=0.06)
    assert all(abs(end.amount) < 9 for end in ends)


def test_what_cannot_be_is_said(two_arms, many_joints) -> None:
    _, planner, _, joints, _ = two_arms
    with pytest.raises(InputError, match="no arm is called 'a3'"):
        planner.self_motion(joints, "a3")
    with pytest.raises(InputError, match="two arms are needed"):
        planner.landscape(joints, "a1", "a1")
    with pytest.raises(InputError, match="'a1' does not hold the object"):
        planner.self_motion(joints, "a2", problem=moved(planner.problem, {"position": [3.0, 0.0]}))
    with pytest.raises(InputError, match="2 degrees of freedom to spare"):
        many_joints[1].self_motion(many_joints[2], "a1")
    with pytest.raises(InputError, match="has 1 direction"):
        planner.null_motion(joints, "a1", 1, 0.1)
    with pytest.raises(InputError, match=r"shape \(1, 3\)"):
        planner.null_motion(joints, "a1", 0, 0.1, basis=[[1.0, 0.0]])
    rigid, _, held = solved(planar(2, 3, "planar"))
    with pytest.raises(InputError, match="no degree of freedom to spare"):
        rigid.self_motion(held, "a1")


SVG = "{http://www.w3.org/2000/svg}"


def test_a_drawn_curve_names_joints_and_marks_postures(pandas) -> None:
    curve = pandas[4].first
    tree = ET.fromstring(curve_svg(curve))
    words = [element.text for element in tree.iter(f"{SVG}text")]
    named = {f"joint {c.joint_names[x.joint][-1]} {'max' if x.upper else 'min'}"
             for c in (curve,) for x in c.cuts}  # fmt: skip
    assert named <= set(words)
    assert any(word.startswith("now ") for word in words)
    assert "left: along its self-motion, rad" in words
    # A dot of the legend and one on the curve; stars of both and of the other self-motion.
    assert len(list(tree.iter(f"{SVG}circle"))) == 2
    assert len(list(tree.iter(f"{SVG}polygon"))) == 2 + len(curve.others)
    assert "now 0.25" in curve_svg(curve, present=curve.window[0], value=0.25)
    # The dot moves with the posture.
    low, high = curve.window
    places = []
    for s in (low, high):
        drawn = ET.fromstring(curve_svg(curve, present=s))
        places.append([float(dot.get("cx")) for dot in drawn.iter(f"{SVG}circle")][-1])
    frame = next(r for r in tree.iter(f"{SVG}rect") if r.get("stroke-opacity") == "0.5")
    left, width = float(frame.get("x")), float(frame.get("width"))
    assert places == pytest.approx([left, left + width], abs=0.2)


def test_a_drawn_map_shows_values_and_fades_what_is_not_allowed(pandas) -> None:
    landscape = pandas[4]
    text = map_svg(landscape, width=300, height=270)
    ET.fromstring(text)
    found = re.search(r"data:image/png;base64,([A-Za-z0-9+/=]+)", text)
    assert found is not None and len(text) < 150_000
    pixels = np.array(Image.open(io.BytesIO(base64.b64decode(found[1]))))
    assert pixels.shape == (240, 240, 4)
    cells = pixels[::-1][::2, ::2, 3]
    # Limits are drawn to the pixel, cells are where they are to half their width.
    assert np.mean((cells == 255) == landscape.allowed) > 0.97
    a, b = np.unravel_index(
        np.where(landscape.allowed, landscape.values, -9e9).argmax(), (120, 120)
    )
    bright = pixels[::-1][2 * a, 2 * b, :3].astype(int)
    assert bright[0] > 150 and bright[1] > 150 and bright[2] < 110
    moved = map_svg(landscape, present=(landscape.rows[0], landscape.columns[-1]), value=1.5)
    assert "now 1.5" in moved and moved != text


def test_a_drawn_curve_says_what_else_is_in_the_way(pandas) -> None:
    curve = pandas[4].first
    (low, high), *_ = curve.pieces
    part = (curve.positions > low) & (curve.positions < (low + high) / 2)
    drawn = curve_svg(replace(curve, clear=~part))
    assert "touches" in drawn and "touches" not in curve_svg(curve)
    assert "torques" in curve_svg(replace(curve, held=~part))


def test_names_of_joints_are_short() -> None:
    assert short_name([f"panda_joint{k}" for k in range(1, 8)], 2) == "joint 3"
    assert short_name(["left_s0", "left_s1", "left_e0"], 2) == "e0"
    assert short_name(["elbow"], 0) == "elbow"
    assert short_name(["arm_shoulder_joint", "arm_wrist_joint"], 1) == "wrist"


def sliding_arm(folder) -> dict:
    """An arm with three joints on a slide, that holds an object as by a hinge."""
    inertial = (
        '<inertial><mass value="1"/>'
        '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
    )
    joints = [
        ("prismatic", "0 1 0", "0 0 0"),
        ("revolute", "0 0 1", "0 0 0.3"),
        ("revolute", "0 1 0", "0 0 0.1"),
        ("revolute", "0 1 0", "0.4 0 0"),
    ]
    parts = ['<link name="l0"/>']
    for i, (kind, axis, origin) in enumerate(joints):
        reach = 0.25 if kind == "prismatic" else 3.0
        parts.append(
            f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{origin}"/><axis xyz="{axis}"/>'
            f'<limit lower="{-reach}" upper="{reach}" effort="50" velocity="1"/></joint>'
            f'<link name="l{i + 1}">{inertial}</link>'
        )
    parts.append('<joint name="tip" type="fixed"><parent link="l4"/><child link="tip"/>'
                 '<origin xyz="0.35 0 0"/></joint><link name="tip"/>')  # fmt: skip
    (folder / "slide.urdf").write_text(f'<robot name="slide">{"".join(parts)}</robot>')
    arm = {"name": "arm", "urdf": str(folder / "slide.urdf"), "tip": "tip",
           "grasp": {"position": [0, 0, 0]}}  # fmt: skip
    thing = {"mass": 1.0, "position": [0.45, 0.05, 0.35]}
    task = {"space": "spatial-linear"}
    return {"format": 1, "name": "slide", "task": task, "object": thing, "arms": [arm]}


def test_a_slide_ends_a_self_motion_at_its_limits(tmp_path) -> None:
    planner, _, joints = solved(sliding_arm(tmp_path))
    curve = planner.self_motion(joints, "arm")
    assert not curve.loop and len(curve.cuts) == 2
    # The tip's height and its distance from the slide are the elbow's: a turn for each place.
    ends = [curve.at(cut.position) for cut in curve.cuts]
    assert [cut.joint for cut in curve.cuts] == [0, 0]
    assert sorted(q[0] for q in ends) == pytest.approx([-0.25, 0.25], abs=1e-8)
    assert {cut.upper for cut in curve.cuts} == {True, False}
    assert curve.pieces == ((0.0, curve.length),)
    q = curve.points
    assert np.tan(q[:, 1]) * 0.45 == pytest.approx(0.05 - q[:, 0], abs=1e-8)
    assert "joint 0 max" in curve_svg(curve) and "rad, m" in curve_svg(curve)


def test_an_arm_that_stands_by_counts() -> None:
    planner, _, joints = solved(planar(3))
    landscape = planner.landscape(joints, "a3", "a1")
    a, b = np.array([5, 70, 111]), np.array([13, 50, 118])
    q = {
        "a1": landscape.second.postures(landscape.columns[b]),
        "a2": np.tile(joints["a2"], (3, 1)),
        "a3": landscape.first.postures(landscape.rows[a]),
    }
    assert landscape.values[a, b] == pytest.approx(planner.measure(q).objective, abs=1e-9)
    assert landscape.allowed.all() and landscape.first.arm == "a3"
