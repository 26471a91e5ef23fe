"""What arms can come to without letting go, against self-motions known in closed form, dense grids
of postures and Pinocchio."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import lsq_linear
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import copose
from cells import closed_postures, planar, random_cell, tables, two_pandas
from copose.cell.cell import Cell
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.reachable.components import component, manifold_of
from copose.posture.reachable.reachability import reachable
from copose.posture.reachable.search import ReachableSet
from copose.posture.search.effort import EFFORTS
from copose.posture.search.outcome import SearchOutcome
from copose.problem import parse
from copose.self_motion.curves.tracing import follow
from reference import Problem as Truth
from segment_distances import segment_distances

TURN = 2 * math.pi


def three_links(lengths, distance: float, limits=None, **extra: object) -> dict:
    """One 3R arm at the origin whose tip stays at (distance, 0)."""
    cell = planar(1, 3)
    cell["object"]["position"] = [distance, 0.0]
    cell["arms"][0] |= {
        "links": [{"length": a, "mass": 1.0, "inertia": 0.03, "com": a / 2} for a in lengths],
        "base": {"position": [0.0, 0.0]},
        "grasp": {"position": [0.0, 0.0]},
    }
    if limits is not None:
        cell["arms"][0]["position_limits"] = [list(map(float, pair)) for pair in limits]
    return cell | extra


def ready(cell: dict) -> tuple:
    machinery = PostureModel(Cell.of(parse(cell)))
    return machinery, machinery.setting(machinery.cell)


def elbows(lengths, distance: float, q1: np.ndarray, sign: float) -> np.ndarray:
    """The postures (q1, q2, q3) whose tip is at (distance, 0), NaN where there is none."""
    a, b, c = lengths
    x, y = distance - a * np.cos(q1), -a * np.sin(q1)
    cosine = (x**2 + y**2 - b**2 - c**2) / (2 * b * c)
    q3 = sign * np.arccos(np.where(np.abs(cosine) <= 1, cosine, np.nan))
    q2 = np.arctan2(y, x) - np.arctan2(c * np.sin(q3), b + c * np.cos(q3)) - q1
    return np.column_stack([q1, (q2 + np.pi) % TURN - np.pi, q3])


def joined(links: np.ndarray, size: int) -> np.ndarray:
    """A number for each of so many nodes, the same for those that links join, (count, 2)."""
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(size, size))
    return connected_components(graph, directed=False)[1]


class Graph:
    """All postures of a 3R arm on a grid of its first joint, neighbours joined within limits."""

    def __init__(self, lengths, distance: float, limits, count: int = 6000) -> None:
        wraps = limits is None
        low, high = (-np.pi, np.pi) if wraps else limits[0]
        q1 = np.linspace(low, high, count, endpoint=not wraps)
        layers = []
        for sign in (1.0, -1.0):
            plain = elbows(lengths, distance, q1, sign)
            if wraps:
                layers.append((sign, plain))
                continue
            for k in (-1, 0, 1):
                for m in (-1, 0, 1):
                    turned = plain + TURN * np.array([0, k, m])
                    for j in (1, 2):
                        out = (turned[:, j] < limits[j][0]) | (turned[:, j] > limits[j][1])
                        turned[out] = np.nan
                    layers.append((sign, turned))
        self.q = np.vstack([layer for _, layer in layers])
        there = ~np.isnan(self.q[:, 2])
        there[there] = self.keeps(self.q[there])
        exists = ~np.isnan(elbows(lengths, distance, q1, 1.0)[:, 2])
        pairs, nears = [], []
        for a in range(len(layers)):
            for b in range(len(layers)):
                rows, other = a * count + np.arange(count), b * count + np.arange(count)
                pairs += [np.column_stack([rows[:-1], other[1:]])]
                nears.append(0.25)
                if wraps:
                    pairs.append(np.array([[rows[-1], other[0]]]))
                    nears.append(0.25)
                # Where the outer links are in line both elbows are one posture.
                edge = exists & ~(np.roll(exists, 1) & np.roll(exists, -1))
                pairs += [np.column_stack([rows[edge], other[edge]])]
                nears.append(0.6)
        links = np.vstack(pairs)
        far = np.repeat(nears, [len(some) for some in pairs])
        both = there[links].all(axis=1)
        links, far = links[both], far[both]
        apart = self.q[links[:, 0]] - self.q[links[:, 1]]
        if wraps:
            apart = (apart + np.pi) % TURN - np.pi
        links = links[np.abs(apart).max(axis=1) < far]
        self.links = links
        self.label = joined(links, len(self.q))
        self.nodes = np.flatnonzero(there)
        self.wraps = wraps

    def keeps(self, q: np.ndarray) -> np.ndarray:
        """Which postures, (count, 3), count."""
        return np.ones(len(q), dtype=bool)

    def label_of(self, q: np.ndarray) -> int:
        """Of the nearest posture."""
        apart = self.q[self.nodes] - q
        if self.wraps:
            apart = (apart + np.pi) % TURN - np.pi
        size = np.abs(apart).max(axis=1)
        return int(self.label[self.nodes[size.argmin()]]) if size.min() < 0.05 else -1


def asked(machinery, setting, start, end) -> bool | None:
    return reachable(machinery, setting, [np.array(start)], [np.array(end)]).whole


def test_every_tangent_of_a_followed_curve_is_one() -> None:
    lengths, distance = (0.4, 0.3, 0.35), 0.6
    machinery, setting = ready(three_links(lengths, distance))
    manifold = manifold_of(machinery, setting, [0])
    curve = follow(manifold, elbows(lengths, distance, np.array([0.3]), 1.0))[0]
    _, J = manifold.kernels.residual(curve.points, manifold.goals[0])
    assert len(curve.points) > 20
    assert np.abs(np.einsum("kmn,kn->km", J, curve.tangents)).max() < 1e-9


@pytest.mark.parametrize("seed", range(12))
def test_a_three_link_arm_moves_as_a_four_bar_linkage_does(seed: int) -> None:
    """Two self-motions where the shortest and longest bar are less than the others (Grashof)."""
    rng = np.random.default_rng(seed)
    bars = rng.uniform(0.2, 1.0, 4)
    while (
        2 * bars.max() > 0.98 * bars.sum() or abs(bars.max() + bars.min() - bars.sum() / 2) < 0.01
    ):
        bars = rng.uniform(0.2, 1.0, 4)
    lengths, distance = bars[:3], float(bars[3])
    machinery, setting = ready(three_links(lengths, distance))
    q1 = rng.uniform(-np.pi, np.pi, 400)
    some = np.vstack([elbows(lengths, distance, q1, sign) for sign in (1.0, -1.0)])
    some = some[~np.isnan(some).any(axis=1)][:6]
    two = bars.max() + bars.min() < bars.sum() / 2
    for q in some:
        # The posture mirrored in the line from base to tip is on the other one.
        assert asked(machinery, setting, q, -q) is (not two)
        assert asked(machinery, setting, q, q + TURN * np.array([1, -1, 2])) is True
        assert asked(machinery, setting, q, q + 1e-3) is False


@pytest.mark.parametrize("seed", range(30))
def test_self_motions_that_come_near_each_other_are_kept_apart(seed: int) -> None:
    """Linkages a little to either side of where the two self-motions meet."""
    rng = np.random.default_rng([seed, 4])
    bars = np.sort(rng.uniform(0.3, 0.8, 4))
    bars[3] = bars[1] + bars[2] - bars[0]
    beside = float(10 ** rng.uniform(-5, -2)) * (-1) ** seed
    bars[3] += beside
    bars = rng.permutation(bars)
    lengths, distance = bars[:3], float(bars[3])
    machinery, setting = ready(three_links(lengths, distance))
    q1 = rng.uniform(-np.pi, np.pi, 200)
    some = np.vstack([elbows(lengths, distance, q1, sign) for sign in (1.0, -1.0)])
    some = some[~np.isnan(some).any(axis=1)]
    told = [asked(machinery, setting, q, -q) for q in rng.permutation(some)[:6]]
    assert set(told) <= {None, beside > 0}
    if abs(beside) > 1e-4:
        assert None not in told


def test_where_self_motions_meet_nothing_is_said_to_be_out_of_reach() -> None:
    """Shortest and longest bar as long as the others: the two cross where all lie on one line."""
    lengths, distance = (0.5, 0.4, 0.3), 0.6
    machinery, setting = ready(three_links(lengths, distance))
    some = elbows(lengths, distance, np.linspace(-0.9, 0.9, 9), 1.0)
    told = [asked(machinery, setting, q, -q) for q in some[~np.isnan(some[:, 2])]]
    assert len(told) > 5
    for seed in range(60):
        rng = np.random.default_rng([seed, 2])
        bars = np.sort(rng.uniform(0.3, 0.8, 4))
        bars[3] = bars[1] + bars[2] - bars[0]
        bars = rng.permutation(bars)
        where = three_links(bars[:3], float(bars[3]))
        more = elbows(bars[:3], bars[3], rng.uniform(-np.pi, np.pi, 12), 1.0)
        beside = ready(where)
        told += [asked(*beside, q, -q) for q in more[~np.isnan(more[:, 2])][:4]]
    assert len(told) > 150 and False not in told
    found = component(machinery, setting, 0, some[5])
    assert not found.complete and found.holds(-some[5]) is not False


@pytest.mark.few(14)
@pytest.mark.parametrize("seed", range(24))
@pytest.mark.parametrize("wide", [False, True])
def test_reachable_agrees_with_a_dense_grid_of_postures(seed: int, wide: bool) -> None:
    rng = np.random.default_rng([seed, wide])
    lengths = rng.uniform(0.25, 0.6, 3)
    distance = float(rng.uniform(0.15, 0.8) * lengths.sum())
    while 2 * max(*lengths, distance) > 0.97 * (lengths.sum() + distance):
        distance = float(rng.uniform(0.15, 0.8) * lengths.sum())
    most = 5.0 if wide else 2.9
    # Limits within which something closes.
    while True:
        limits = np.column_stack([-rng.uniform(0.6, most, 3), rng.uniform(0.6, most, 3)])
        exact = Graph(lengths, distance, limits)
        if len(exact.nodes) >= 50:
            break
    shrunk, grown = limits + [[2e-3, -2e-3]] * 3, limits + [[-2e-3, 2e-3]] * 3
    graphs = [Graph(lengths, distance, shrunk), exact, Graph(lengths, distance, grown)]
    machinery, setting = ready(three_links(lengths, distance, limits))
    drawn = exact.q[rng.choice(exact.nodes, 10)]
    compared = 0
    for start in drawn:
        for end in drawn:
            same = {graph.label_of(start) == graph.label_of(end) for graph in graphs}
            if min(g.label_of(x) for g in graphs for x in (start, end)) < 0 or len(same) > 1:
                continue
            compared += 1
            assert asked(machinery, setting, start, end) is same.pop()
    assert compared > 30


@pytest.mark.parametrize("seed", range(6))
def test_a_component_is_all_that_a_grid_joins_with_the_start(seed: int) -> None:
    rng = np.random.default_rng([seed, 3])
    lengths, distance = rng.uniform(0.3, 0.5, 3), float(rng.uniform(0.4, 0.7))
    limits = np.column_stack([-rng.uniform(1, 2.9, 3), rng.uniform(1, 2.9, 3)])
    graph = Graph(lengths, distance, limits)
    start = graph.q[rng.choice(graph.nodes)]
    machinery, setting = ready(three_links(lengths, distance, limits))
    found = component(machinery, setting, 0, start)
    assert found.complete and np.array_equal(found.postures[0], start)
    assert np.all((found.postures >= limits[:, 0]) & (found.postures <= limits[:, 1]))
    assert np.abs(
        machinery.arms[0].residual(found.postures, setting.placement.goals[0])[0]
    ).max() < (1e-10)
    there = graph.q[graph.nodes[graph.label[graph.nodes] == graph.label_of(start)]]
    apart = np.linalg.norm(there[:, None] - found.postures[None], axis=2)
    assert apart.min(axis=1).max() < 0.15 and apart.min(axis=0).max() < 0.05
    for q in rng.permutation(graph.q[graph.nodes])[:40]:
        if graph.label_of(q) == graph.label_of(start):
            assert found.holds(q) is True
    assert found.holds(start + 0.01) is False


# More than one degree of freedom to spare


@pytest.mark.parametrize("seed", range(10))
def test_four_links_are_never_said_to_reach_the_other_side_of_what_divides_them(seed: int) -> None:
    """Closed pentagons are in two pieces, mirror images, where any two of the three longest sides
    are more than half of the perimeter (Kapovich and Millson, 1995)."""
    rng = np.random.default_rng(seed)
    sides = rng.uniform(0.1, 1.0, 5)
    # No polygon has a side that is more than all others.
    while 2 * sides.max() > sides.sum():
        sides = rng.uniform(0.1, 1.0, 5)
    if seed % 2:
        sides = np.array([*rng.uniform(0.8, 1.0, 3), *rng.uniform(0.1, 0.3, 2)])
    sides = rng.permutation(sides)
    longest = np.sort(sides)[-3:]
    divided = longest[0] + longest[1] > sides.sum() / 2
    cell = three_links(sides[:4], float(sides[4]))
    machinery, setting = ready(cell)
    postures = closed_postures(machinery.cell, 0, 60, seed)
    assert len(postures) > 10
    answers = [
        reachable(machinery, setting, [q], [to], [postures]).whole
        for q, to in zip(postures[:12], -postures[:12], strict=True)
    ]
    assert set(answers) <= ({None} if divided else {True, None})
    if not divided:
        assert answers.count(True) >= 9


# Limits, margins and turns


def test_turns_count_where_joints_have_limits() -> None:
    lengths, distance = (0.5, 0.4, 0.3), 0.65
    free, held = (
        ready(three_links(lengths, distance)),
        ready(three_links(lengths, distance, [[-7, 7]] * 3)),
    )
    graph = Graph(lengths, distance, np.array([[-7.0, 7.0]] * 3), 20000)
    told = set()
    for q1 in (-0.6, 0.2, 0.9):
        q = elbows(lengths, distance, np.array([q1]), 1.0)[0]
        for joint in range(3):
            turned = q.copy()
            turned[joint] += TURN if q[joint] < 0 else -TURN
            assert asked(*free, q, turned) is True
            assert graph.label_of(q) >= 0 and graph.label_of(turned) >= 0
            told.add(asked(*held, q, turned))
            assert asked(*held, q, turned) is (graph.label_of(q) == graph.label_of(turned))
    assert False in told
    mixed = ready(three_links(lengths, distance, [[-math.inf, math.inf], [-3, 3], [-7, 7]]))
    assert asked(*mixed, q, q + np.array([2 * TURN, 0, 0])) is True
    assert asked(*mixed, q, q - np.array([0, 0, TURN])) is False


def test_a_start_within_the_margin_may_leave_it_and_not_come_back() -> None:
    lengths, distance = (0.5, 0.45, 0.4), 0.7
    limits = np.array([[-1.0, 1.0], [-2.9, 2.9], [-2.9, 2.9]])
    margin = 0.2
    near, inside = elbows(lengths, distance, np.array([0.9, 0.3]), 1.0)
    cell = three_links(lengths, distance, limits, constraints={"joint_margin": margin})
    machinery, setting = ready(cell)
    assert asked(machinery, setting, near, inside) is True
    found = component(machinery, setting, 0, near)
    assert found.postures[:, 0].max() <= 0.8 + 1e-9
    # Once out of it the arm is stopped where the margin begins.
    assert asked(machinery, setting, inside, near) is False


def test_arms_without_freedom_to_spare_stay_where_they_are() -> None:
    machinery, setting = ready(random_cell(("ur5", "ur5"), "spatial", seed=0))
    closed = [closed_postures(machinery.cell, i, 400, seed=5) for i in range(2)]
    start = [q[0] for q in closed]
    assert reachable(machinery, setting, start, start).whole is True
    other = [start[0], closed[1][np.abs(closed[1] - start[1]).max(axis=1) > 0.1][0]]
    told = reachable(machinery, setting, start, other)
    assert told.whole is False and len(told.why) == 1 and "freedom" in told.why[0]


# Two Pandas, followed by Pinocchio


def followed(arm, q: np.ndarray, way: float, step: float) -> np.ndarray:
    """Postures along the self-motion of an arm from a posture until a limit stops it."""
    goal = arm.at(q)[0]
    low, high = arm.model.lowerPositionLimit, arm.model.upperPositionLimit
    points, heading = [q], None
    while True:
        null = np.linalg.svd(arm.at(q)[1])[2][-1]
        if heading is None:
            null = null * way * np.sign(null[np.abs(null).argmax()])
        heading = null if heading is None or null @ heading > 0 else -null
        q = q + step * heading
        for _ in range(3):
            tip, J = arm.at(q)[:2]
            turn = pin.log3(goal.rotation @ tip.rotation.T)
            q = q + np.linalg.pinv(J) @ np.concatenate([goal.translation - tip.translation, turn])
        if np.any(q < low) or np.any(q > high):
            return np.array(points)
        points.append(q)
        assert len(points) < 3000


@pytest.fixture(scope="module")
def pair() -> dict:
    """The shipped pair: its solution, and what each arm can come to by Pinocchio."""
    cell = tables("panda-reachable")
    planner = copose.Planner(parse(cell))
    solution = planner.solve()
    names = {name: list(joints) for name, joints in solution.joint_names.items()}
    truth = Truth(cell, names)
    pieces = {}
    for name, arm in truth.arms.items():
        start = np.array(solution.before.joints[name])
        ways = [followed(arm, start, way, 0.02) for way in (1.0, -1.0)]
        pieces[name] = np.vstack([ways[1][:0:-1], ways[0]])
    return {"cell": cell, "planner": planner, "solution": solution, "pieces": pieces}


def test_the_answer_is_the_best_of_what_pinocchio_comes_to(pair: dict) -> None:
    solution, pieces = pair["solution"], pair["pieces"]
    assert solution.reachable_from_start is True
    for name, piece in pieces.items():
        after = np.array(solution.after.joints[name])
        assert np.linalg.norm(piece - after, axis=1).min() < 0.02
        assert 20 < len(piece) < 2000
    left, right = pieces["left"], pieces["right"]
    grid = [np.repeat(left, len(right), axis=0), np.tile(right, (len(left), 1))]
    values = pair["planner"].measure({"left": grid[0], "right": grid[1]}).objective
    assert values.max() - 1e-9 <= solution.objective.after <= values.max() + 1e-3
    assert solution.objective.after > solution.objective.before + 0.1


def test_without_the_key_the_result_says_that_the_best_cannot_be_reached(pair: dict) -> None:
    cell = pair["cell"] | {"search": {}}
    solution = copose.solve(parse(cell))
    assert solution.reachable_from_start is False
    assert solution.objective.after == pytest.approx(-0.216980, abs=1e-6)
    far = [
        name
        for name, piece in pair["pieces"].items()
        if np.linalg.norm(piece - np.array(solution.after.joints[name]), axis=1).min() > 0.1
    ]
    (note,) = [note for note in solution.notes if "without letting go" in note]
    assert far and all((f"arm '{name}'" in note) == (name in far) for name in pair["pieces"])
    assert "[search] reachable = true" in note and "limit" in note
    # Without a start there is nothing to reach it from that anybody asked about.
    for arm in cell["arms"]:
        del arm["start"]
    plain = copose.solve(parse(cell))
    assert plain.reachable_from_start is False
    assert not any("letting go" in note for note in plain.notes)


@pytest.mark.parametrize("seed", [0, 2])
def test_pandas_move_where_pinocchio_moves_them(seed: int) -> None:
    cell = two_pandas()
    machinery, setting = ready(cell)
    names = {arm.name: list(arm.joint_names) for arm in machinery.cell.arms}
    truth = Truth(cell, names)
    closed = closed_postures(machinery.cell, 0, 300, seed)
    rng = np.random.default_rng(seed)
    other = closed_postures(machinery.cell, 1, 64, seed)[0]
    start = closed[0]
    arm = truth.arms["left"]
    piece = np.vstack([followed(arm, start, way, 0.02) for way in (1.0, -1.0)])
    known = set()
    for q in rng.permutation(closed)[:80]:
        near = np.linalg.norm(piece - q, axis=1).min()
        if 0.025 < near < 0.1:
            continue
        told = reachable(machinery, setting, [start, other], [q, other]).whole
        assert told is bool(near <= 0.025)
        known.add(told)
    assert known == {True, False}


# Bodies in the way


def links_of(lengths, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Ends of the links of an arm at the origin, (count, 3) each."""
    angles = np.cumsum(q, axis=1)
    ends = [np.zeros((len(q), 3))]
    for length, angle in zip(lengths, angles.T, strict=True):
        along = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
        ends.append(ends[-1] + length * along)
    return list(pairwise(ends))


def room(lengths, q: np.ndarray, ball, radius: float) -> np.ndarray:
    """How far an arm's links, 0.03 m wide on either side, are from a disk, and its outer from its
    inner one."""
    links = links_of(lengths, q)
    place = np.tile([*ball, 0.0], (len(q), 1))
    gaps = [segment_distances(a, b, place, place) - radius - 0.03 for a, b in links]
    return np.min([*gaps, segment_distances(*links[0], *links[2]) - 0.06], axis=0)


def with_ball(cell: dict, ball, radius: float) -> dict:
    disk = {"name": "stump", "shape": {"kind": "disk", "radius": radius}, "position": [*ball]}
    return cell | {
        "obstacles": [disk], "constraints": {"collision": True, "clearance": 0.01},
    }  # fmt: skip


class Clear(Graph):
    """The same of postures that keep so far from a disk, and the arm from itself."""

    def __init__(
        self, lengths, distance, limits, ball, radius: float, least: float, count: int = 6000
    ) -> None:
        self.lengths, self.ball, self.radius, self.least = lengths, ball, radius, least
        super().__init__(lengths, distance, limits, count)

    def keeps(self, q: np.ndarray) -> np.ndarray:
        return room(self.lengths, q, self.ball, self.radius) >= self.least


def test_a_disk_cuts_a_self_motion() -> None:
    """Pairs of postures of a three-link arm, against a grid of those that are clear of it."""
    told = []
    for seed in range(8):
        rng = np.random.default_rng([seed, 5])
        lengths, distance = rng.uniform(0.35, 0.5, 3), float(rng.uniform(0.5, 0.9))
        limits = np.column_stack([-rng.uniform(2, 2.9, 3), rng.uniform(2, 2.9, 3)])
        whole = Graph(lengths, distance, limits)
        # Beside the elbow of some posture, so that it is in the way.
        some = whole.q[rng.choice(whole.nodes)]
        elbow = links_of(lengths, some[None])[1][1][0, :2]
        ball, radius = elbow + rng.uniform(-0.05, 0.05, 2), 0.05
        cell = with_ball(three_links(lengths, distance, limits), ball, radius)
        machinery, setting = ready(cell)
        graphs = [Clear(lengths, distance, limits, ball, radius, least)
                  for least in (0.004, 0.01, 0.016)]  # fmt: skip
        nodes = graphs[2].nodes
        for start, end in zip(*rng.choice(nodes, (2, 12)), strict=True):
            start, end = graphs[2].q[start], graphs[2].q[end]
            same = {graph.label_of(start) == graph.label_of(end) for graph in graphs}
            if len(same) > 1:
                continue
            answer = asked(machinery, setting, start, end)
            if answer is not None:
                assert answer is same.pop()
            told.append((answer, whole.label_of(start) == whole.label_of(end)))
    assert len(told) > 60 and sum(answer is None for answer, _ in told) < 4
    # Many are divided by the disk alone.
    assert told.count((False, True)) > 5 and told.count((True, True)) > 5


def test_solving_keeps_to_this_side_of_a_disk() -> None:
    cut = 0
    for seed in range(8):
        rng = np.random.default_rng([seed, 6])
        lengths, distance = rng.uniform(0.35, 0.5, 3), float(rng.uniform(0.5, 0.9))
        limits = np.column_stack([-rng.uniform(2, 2.9, 3), rng.uniform(2, 2.9, 3)])
        cell = three_links(lengths, distance, limits)
        best = np.array(copose.solve(parse(cell)).after.joints["a1"])
        ball = links_of(lengths, best[None])[1][1][0, :2] + rng.uniform(-0.06, 0.06, 2)
        cell = with_ball(cell, ball, 0.05)
        graphs = [Clear(lengths, distance, limits, ball, 0.05, least)
                  for least in (0.008, 0.01, 0.014)]  # fmt: skip
        if not len(graphs[2].nodes):
            continue
        start = graphs[2].q[rng.choice(graphs[2].nodes)]
        cell["arms"][0]["start"] = start.tolist()
        planner = copose.Planner(parse(cell | {"search": {"reachable": True}}))
        solution = planner.solve()
        assert solution.status == "solved" and solution.reachable_from_start is True
        after = np.array(solution.after.joints["a1"])
        assert room(lengths, after[None], ball, 0.05)[0] >= 0.01 - 1e-6
        assert graphs[0].label_of(after) == graphs[0].label_of(start)
        mine = graphs[2].nodes[graphs[2].label[graphs[2].nodes] == graphs[2].label_of(start)]
        values = planner.measure({"a1": graphs[2].q[mine]}).objective
        assert solution.objective.after >= values.max() - 1e-3
        everywhere = planner.measure({"a1": graphs[2].q[graphs[2].nodes]}).objective.max()
        cut += everywhere > solution.objective.after + 1e-2
        plain = copose.solve(parse(cell))
        assert plain.objective.after >= everywhere - 1e-3
        if everywhere > solution.objective.after + 1e-2:
            assert plain.reachable_from_start is False
    assert cut >= 2


def facing(links: list, x: float) -> list:
    """Links of an arm at the origin as those of one at (x, 0) that faces it."""
    place, turn = np.array([x, 0.0, 0.0]), np.array([-1.0, -1.0, 1.0])
    return [(a * turn + place, b * turn + place) for a, b in links]


def apart(one: list, other: list) -> np.ndarray:
    """How far links are from those of another arm, 0.03 m wide on either side, for all pairs."""
    least = np.full((len(one[0][0]), len(other[0][0])), np.inf)
    for a, b in one:
        for c, d in other:
            k, m = least.shape
            ends = [np.repeat(x, m, axis=0) for x in (a, b)] + [np.tile(x, (k, 1)) for x in (c, d)]
            least = np.minimum(least, segment_distances(*ends).reshape(k, m) - 0.06)
    return least


@pytest.mark.parametrize("seed", range(3))
def test_two_arms_move_round_each_other_as_all_pairs_on_a_grid_do(seed: int) -> None:
    rng = np.random.default_rng([seed, 8])
    lengths = rng.uniform(0.25, 0.4, (2, 3))
    limits = np.stack([-rng.uniform(2, 2.9, (2, 3)), rng.uniform(2, 2.9, (2, 3))], axis=2)
    base, reach = 0.9, 0.35
    cell = three_links(lengths[0], base / 2, limits[0])
    second = three_links(lengths[1], base / 2, limits[1])["arms"][0]
    cell["arms"].append(second | {"name": "a2"})
    cell["arms"][1]["base"] = {"position": [base, 0.0], "angle": math.pi}
    for arm, side in zip(cell["arms"], (-1, 1), strict=True):
        arm["grasp"] = {"position": [side * (base / 2 - reach), 0.0]}
    cell["constraints"] = {"collision": True, "clearance": 0.01}
    machinery, setting = ready(cell)
    far = np.array([9.0, 9.0])
    arms = [Clear(lengths[i], reach, limits[i], far, 0.01, 0.01, 500) for i in range(2)]
    q = [arm.q[arm.nodes] for arm in arms]
    gaps = apart(links_of(lengths[0], q[0]), facing(links_of(lengths[1], q[1]), base))
    number = [np.full(len(arm.q), -1) for arm in arms]
    for arm, mine in zip(arms, number, strict=True):
        mine[arm.nodes] = np.arange(len(arm.nodes))
    k, m = gaps.shape
    a, b = (mine[arm.links] for arm, mine in zip(arms, number, strict=True))
    links = np.vstack([
        np.stack([(a[:, None, j] * m + np.arange(m)).ravel() for j in range(2)], axis=1),
        np.stack([(np.arange(k)[:, None] * m + b[:, j]).ravel() for j in range(2)], axis=1),
    ])  # fmt: skip
    labels = []
    for least in (0.005, 0.01, 0.02):
        clear = (gaps >= least).ravel()
        labels.append(joined(links[clear[links].all(axis=1)], k * m).reshape(k, m))
    free = np.argwhere(gaps >= 0.02)
    told = []
    for start, end in zip(*rng.choice(free, (2, 30)), strict=True):
        same = {bool(label[tuple(start)] == label[tuple(end)]) for label in labels}
        if len(same) > 1:
            continue
        ends = [[q[i][row[i]] for i in range(2)] for row in (start, end)]
        answer = reachable(machinery, setting, *ends).whole
        alone = all(
            arm.label[arm.nodes[x]] == arm.label[arm.nodes[y]]
            for arm, x, y in zip(arms, start, end, strict=True)
        )
        if answer is not None:
            assert answer is same.pop()
        told.append((answer, alone))
    assert len(told) > 10 and sum(answer is None for answer, _ in told) < len(told) / 3


# Solving


def test_the_best_that_can_be_reached_is_that_of_a_dense_component() -> None:
    """Three links between limits: the best of all postures is on another piece than the start."""
    found = 0
    for seed in range(40):
        rng = np.random.default_rng([seed, 9])
        lengths, distance = rng.uniform(0.3, 0.5, 3), float(rng.uniform(0.4, 0.8))
        limits = np.column_stack([-rng.uniform(1, 2.9, 3), rng.uniform(1, 2.9, 3)])
        graph = Graph(lengths, distance, limits)
        if len(set(graph.label[graph.nodes])) < 2:
            continue
        start = graph.q[rng.choice(graph.nodes)]
        cell = three_links(lengths, distance, limits)
        cell["arms"][0]["start"] = start.tolist()
        planner = copose.Planner(parse(cell))
        values = planner.measure({"a1": graph.q[graph.nodes]}).objective
        mine = graph.label[graph.nodes] == graph.label_of(start)
        best, all_best = values[mine].max(), values.max()
        within = copose.solve(parse(cell | {"search": {"reachable": True}}))
        plain = planner.solve()
        assert plain.objective.after >= all_best - 1e-6
        assert within.status == "solved" and within.reachable_from_start is True
        assert best - 1e-6 <= within.objective.after <= best + 1e-2
        assert graph.label_of(np.array(within.after.joints["a1"])) == graph.label_of(start)
        if all_best > best + 1e-2:
            found += 1
            assert plain.reachable_from_start is False
            assert any("arm 'a1'" in note and "letting go" in note for note in plain.notes)
        if found == 8:
            return
    pytest.fail("next to no problem has its best posture on another piece")


def test_optima_that_cannot_be_reached_are_dropped(pair: dict) -> None:
    machinery, setting = ready(pair["cell"])
    starts = [np.array(q) for q in pair["solution"].before.joints.values()]
    effort = EFFORTS["low"]
    within = ReachableSet.of(machinery, setting, starts, 0, effort)
    best = copose.solve(parse(pair["cell"] | {"search": {}})).after.joints
    far = np.concatenate(list(best.values()))
    near = np.concatenate(list(pair["solution"].after.joints.values()))
    found = SearchOutcome((), optima=(LocalOptimum(far, 1.0, 1), LocalOptimum(near, 0.5, 2)))
    (kept,) = within.confirmed(found).optima
    assert kept.count == 2 and np.allclose(kept.q, near, atol=1e-9)
    # A sample that is better, or is all that can be reached, is no climb's end.
    (sample,) = within.confirmed(SearchOutcome((), best=near)).optima
    assert sample.count == 0
    half = np.concatenate([near[:7], far[7:]])
    assert not within.confirmed(SearchOutcome((), optima=(LocalOptimum(half, 1.0, 1),))).optima


def test_a_posture_to_go_on_from_is_left_only_where_it_can_be(pair: dict) -> None:
    planner, solution = pair["planner"], pair["solution"]
    again = planner.solve(warm=solution)
    assert again.reachable_from_start is True
    assert again.objective.after == pytest.approx(solution.objective.after, abs=1e-9)
    plain = copose.Planner(parse(two_pandas()))
    assert plain.solve(warm=plain.solve()).reachable_from_start is None


def test_fixed_arms_and_arms_without_a_start() -> None:
    cell = tables("panda-reachable")
    before = copose.solve(parse(cell)).before.joints
    for arm in cell["arms"]:
        arm["start"] = list(before[arm["name"]])
    cell["arms"][1]["fixed"] = True
    solution = copose.solve(parse(cell))
    assert solution.reachable_from_start is True
    assert solution.after.joints["right"] == before["right"]
    assert solution.objective.after > solution.objective.before
    del cell["arms"][1]["fixed"], cell["arms"][1]["start"]
    solution = copose.solve(parse(cell))
    assert solution.status == "solved" and solution.reachable_from_start is True
    assert any("arm 'right' has no start" in note for note in solution.notes)
    assert copose.solve(parse(cell)).after == solution.after


def test_verify_keeps_to_what_can_be_reached(pair: dict) -> None:
    solution = pair["planner"].solve(verify=True)
    assert solution.search.verification.stands
    assert solution.objective.after == pytest.approx(pair["solution"].objective.after, abs=1e-9)


def test_evaluate_says_nothing_of_it(pair: dict) -> None:
    told = copose.evaluate(parse(pair["cell"]), pair["solution"])
    assert told.reachable_from_start is None


def test_starts_that_leave_nothing_are_told() -> None:
    lengths, distance = (0.5, 0.45, 0.4), 0.7
    (q,) = elbows(lengths, distance, np.array([0.9]), 1.0)
    limits = np.array([[q[0], q[0] + 0.3], *((x - 0.01, x + 0.01) for x in q[1:])])
    cell = three_links(lengths, distance, limits, search={"reachable": True})
    cell["arms"][0]["start"] = q.tolist()
    assert copose.solve(parse(cell)).status == "solved"
    stuck = copose.solve(parse(cell | {"constraints": {"joint_margin": 0.009}}))
    assert stuck.status == "infeasible" and "joint_margin" in stuck.reason
    assert stuck.after is None and stuck.before is not None and stuck.reachable_from_start is None
    elbow = links_of(lengths, q[None])[1][1][0, :2]
    near = copose.solve(parse(with_ball(cell, elbow, 0.05)))
    assert near.status == "infeasible" and "stump" in near.reason and "start" in near.reason


@pytest.mark.parametrize("kind", ["any", "parallel", "crossing", "point", "joined"])
def test_distances_of_segments_are_least_squares(kind: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        a0, a1, b0, b1 = rng.normal(size=(4, 3))
        if kind == "parallel":
            b1 = b0 + rng.normal() * (a1 - a0)
        elif kind == "crossing":
            b1 = a0 + rng.uniform() * (a1 - a0)
        elif kind == "point":
            b1 = b0
        elif kind == "joined":
            b0 = a1
        A = np.column_stack([a1 - a0, b0 - b1])
        best = lsq_linear(A, b0 - a0, bounds=(0, 1), tol=1e-14, method="bvls")
        found = segment_distances(*(end[None] for end in (a0, a1, b0, b1)))[0]
        assert found == pytest.approx(math.sqrt(2 * best.cost), abs=1e-7)
