"""What bodies keep along motions: rows of the program, and the proof between knots."""

from __future__ import annotations

import numpy as np
import pytest

import copose
from copose.cell.cell import Cell
from copose.collision import Primitive
from copose.constraints.clearance import SPARE
from copose.motion.curve.between_knots import ProofOptions, between_bodies
from copose.motion.curve.cubic_motion import CubicMotion as _Way
from copose.motion.nlp.clearance_rows import ClearanceRows
from copose.motion.path.knots import Course, uniform
from copose.motion.path.object_motion import ObjectMotion
from copose.posture.model import PostureModel
from path_problems import carried, hinged

_INSTANTS = 2 ** ProofOptions().halvings
POST = {"name": "post", "shape": {"kind": "cylinder", "radius": 0.05, "length": 0.4}}


def among(cell: dict, clearance: float = 0.01) -> tuple[PostureModel, ObjectMotion]:
    problem = copose.parse(cell | {"constraints": {"collision": True, "clearance": clearance}})
    return PostureModel(Cell.of(problem)), ObjectMotion.of(problem)


@pytest.fixture(scope="module")
def pandas() -> tuple[PostureModel, ObjectMotion]:
    return among(carried() | {"obstacles": [POST | {"position": [0.4, 0.5, 0.6]}]})


def way(
    cell: tuple[PostureModel, ObjectMotion], seed: int, size: float, count: int = 4, kind: str = ""
):
    """Joints and rates at knots, cubic from knot to knot, and the motion of it: drawn, or
    ``steady``, or ``back`` at every knot where it was.
    """
    machinery, journey = cell
    rng = np.random.default_rng(seed)
    lower, upper = (np.concatenate(x) for x in (machinery.cell.lower, machinery.cell.upper))
    low, high = np.maximum(lower, -3.0), np.minimum(upper, 3.0)
    middle = rng.uniform(0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high)
    q = middle + rng.uniform(-size, size, (count, len(middle)))
    speed = rng.uniform(-size, size, q.shape) * 2
    if kind == "steady":
        q, speed = q[0] + np.outer(np.arange(count), speed[0]), (count - 1) * speed[0] + 0 * q
    elif kind == "back":
        q, speed = q[0] + 0 * q, 20 * speed[0] * (-1.0) ** np.arange(count)[:, None]
    return q, speed, _Way(machinery, journey, q, speed, 1.0)


def test_rows_are_distances_and_know_their_slopes_and_bends(pandas) -> None:
    machinery, journey = pandas
    course = Course.of(machinery, journey, uniform(3))
    q = way(pandas, 0, 0.3, 3)[0]
    near = [cuts[:6] for cuts in machinery.bodies.all_witnesses(course.configurations(q), 0.3)]
    assert min(map(len, near)) > 2
    margin = 2e-3
    rows = ClearanceRows(machinery.bodies, course, near, margin)
    cuts = [cut for mine in near for cut in mine]
    apart = [cut.distance for cut in cuts]
    expected = np.array(apart) - machinery.bodies.clearance - margin - SPARE
    assert rows.values(q) == pytest.approx(expected, abs=1e-7)
    assert rows.knots.tolist() == [k for k, mine in enumerate(near) for _ in mine]
    weights, step = np.random.default_rng(1).uniform(-1, 1, len(rows)), 1e-5
    slopes, bends = rows.slopes(q), rows.bends(q, weights)
    coupled = np.zeros(bends.shape[1:], dtype=bool)
    coupled[rows.coupled] = True
    assert not np.triu(bends)[:, ~coupled].any() and not slopes[~rows.moved].any()
    for j in range(q.shape[1]):
        ahead, behind = q.copy(), q.copy()
        ahead[:, j] += step
        behind[:, j] -= step
        slope = (rows.values(ahead) - rows.values(behind)) / (2 * step)
        assert slopes[:, j] == pytest.approx(slope, abs=1e-8)
        bend = (rows.slopes(ahead) - rows.slopes(behind)) / (2 * step) * weights[:, None]
        total = np.array([bend[rows.knots == k].sum(axis=0) for k in range(3)])
        assert bends[:, j] == pytest.approx(total, abs=1e-8)


@pytest.mark.parametrize(("size", "kind"), [(0.02, ""), (0.2, ""), (0.2, "steady")])
def test_no_point_is_faster_than_the_rates_say(pandas, size: float, kind: str) -> None:
    bodies = pandas[0].bodies
    _, _, motion = way(pandas, 3, size, kind=kind)
    parts = np.arange(len(motion.pairs))
    rng = np.random.default_rng(4)
    for begin, span in ((0, _INSTANTS), (_INSTANTS + 512, 512), (2 * _INSTANTS, 2048)):
        speeds, bends = motion.rates(np.full(len(parts), begin), span, parts)
        instants = begin + span * np.arange(9) // 8
        where = bodies.placed(motion._at(instants))
        h = motion.step * span / 8 / _INSTANTS
        largest = np.zeros((2, len(parts)))
        for _ in range(8):
            ends = []
            for side in (0, 1):
                solids = bodies.pairs[motion.pairs, side]
                turn = rng.normal(size=(len(parts), 3))
                turn *= (bodies.radii[solids] / np.linalg.norm(turn, axis=1))[:, None]
                points, k = bodies.centres[solids] + turn, bodies.carrier[solids]
                moved = (where.rotations[:, k] @ points[:, :, None])[..., 0] + where.positions[:, k]
                ends.append(moved)
            frame = where.rotations[:, motion._frames[motion.pairs]]
            apart = ((ends[1] - ends[0])[:, :, None] @ frame)[:, :, 0]
            speed = np.linalg.norm(np.diff(apart, axis=0), axis=2) / h
            bend = np.linalg.norm(np.diff(apart, 2, axis=0), axis=2) / h**2
            largest = np.maximum(largest, [speed.max(axis=0), bend.max(axis=0)])
        assert np.all(largest[0] <= speeds * (1 + 1e-9) + 1e-9)
        assert np.all(largest[1] <= bends * (1 + 1e-6) + 1e-6)
        assert np.any(largest[0] > 0.2 * speeds)


@pytest.mark.parametrize("seed", range(6))
def test_hulls_are_no_nearer_than_their_spans(pandas, seed: int) -> None:
    bodies = pandas[0].bodies
    _, _, motion = way(pandas, seed, 0.3)
    row, found = motion.rows(np.array([700])), 0
    for k in range(0, len(motion.pairs), 7):
        (distance,), normal = motion.hulls(row, np.array([k]))
        random = np.random.default_rng(k).normal(size=(5, 3))
        random /= np.linalg.norm(random, axis=1, keepdims=True)
        where = bodies.placed(motion._at(np.full(6, 700)))
        spans = bodies.spans(where, k, np.vstack([normal, random]))
        assert np.all(spans <= max(distance, 0.0) + 1e-8)
        if distance > 1e-6:
            assert spans[0] == pytest.approx(distance, abs=1e-6)
            found += 1
    assert found > 5


@pytest.mark.parametrize(
    "shape",
    [Primitive("box", (0.1, 0.2, 0.3)), Primitive("sphere", (0.1,)),
     Primitive("cylinder", (0.1, 0.4)), Primitive("capsule", (0.1, 0.4))],
    ids=lambda shape: shape.kind,
)  # fmt: skip
def test_supports_are_what_points_reach(shape: Primitive) -> None:
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = rng.normal(size=(40000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    if shape.kind == "box":
        points = np.sign(points) * np.array(shape.size) / 2
    else:
        radius, *length = shape.size
        if shape.kind == "cylinder":
            points = points / np.linalg.norm(points[:, :2], axis=1, keepdims=True) * [1, 1, 0]
        points = radius * points
        points[:, 2] += np.sign(rng.normal(size=len(points))) * sum(length) / 2
    reach = (points @ directions.T).max(axis=0)
    assert np.all(reach <= shape.support(directions) + 1e-12)
    assert reach == pytest.approx(shape.support(directions), abs=1e-3)


def least(cell: tuple[PostureModel, ObjectMotion], motion: _Way, times: int) -> float:
    instants = np.unique(np.linspace(0, len(motion) * _INSTANTS, len(motion) * times).astype(int))
    return min(cell[0].bodies.nearest(x).distance for x in motion._at(instants))


@pytest.mark.parametrize("size", [0.02, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_proved_between_knots_is_kept_at_every_time(pandas, seed: int, size: float) -> None:
    machinery, journey = pandas
    q, speed, motion = way(pandas, 50 + seed, size, 3)
    parts = machinery.split(q), machinery.split(speed)
    found, there = between_bodies(machinery, journey, *parts, 1.0), least(pandas, motion, 30)
    if found.missing <= 0:
        assert found.distance <= there + 1e-9
    else:
        assert there < machinery.bodies.clearance
        assert max(found.distance, 0.0) == pytest.approx(max(there, 0.0), abs=5e-3)


def test_the_least_at_knots_is_that_of_the_nearest(pandas) -> None:
    machinery, _ = pandas
    for seed in range(8):
        _, _, motion = way(pandas, seed, 0.2)
        knots = motion._at(np.arange(len(motion) + 1) * _INSTANTS)
        nearest = min(machinery.bodies.nearest(x).distance for x in knots)
        assert motion.least_at_knots() == pytest.approx(nearest, abs=1e-9)


def test_a_post_that_is_met_between_two_knots_is_seen() -> None:
    cell = hinged()
    cell["obstacles"] = [
        {"name": "post", "shape": {"kind": "disk", "radius": 0.01}, "position": [0.2, 0.45]}
    ]
    planar = among(cell)
    machinery, journey = planar
    outcomes = set()
    for seed in range(24):
        q, speed, motion = way(planar, seed, 0.1, 3, ("", "back")[seed % 2])
        found = between_bodies(machinery, journey, machinery.split(q), machinery.split(speed), 1.0)
        there = least(planar, motion, 60)
        if found.missing <= 0:
            assert found.distance <= there + 1e-9
        else:
            assert there < machinery.bodies.clearance
        outcomes.add(found.missing > 0)
    assert outcomes == {True, False}
