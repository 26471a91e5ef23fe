"""Postures that keep clear, against coal, Pinocchio, enumerated self-motions, plane geometry."""

from __future__ import annotations

import copy
import itertools
import json
import math
import re
from collections.abc import Iterator

import numpy as np
import pytest
from cases import Case
from collision import random_cell
from sampling import closed_postures, spread_out
from scipy.interpolate import CubicHermiteSpline
from truth import Truth

import cells
import copose
import path_problems
import reference
from copose.commands.command_line import main
from object_path import ObjectPath
from test_collision import Setting, all_distances, gap_2d

CLEARANCE, TOLERANCE = 0.01, 1e-6
CLOSED, RECOMPUTED, WORSE = 1e-8, 1e-8, 1e-6


def blind(table: dict) -> dict:
    """The same cell without anything kept apart."""
    kept = {k: v for k, v in table["constraints"].items() if k not in ("collision", "clearance")}
    return table | {"constraints": kept}


def joints_of(posture) -> list[np.ndarray]:
    return [np.array(q) for q in posture.joints.values()]


def least(distances: dict[frozenset[str], float]) -> float:
    return min(distances.values())


def checked(table: dict, solution: copose.Solution) -> float:
    """A solved answer keeps clear, as reported, and all else that it must; its least distance."""
    assert solution.status == "solved", solution.reason
    after = solution.after
    setting = Setting.of(table)
    clearance = table["constraints"].get("clearance", CLEARANCE)
    found = all_distances(setting, joints_of(after))
    assert least(found) >= clearance - TOLERANCE
    assert after.collision.distance == pytest.approx(least(found), abs=5e-6)
    assert found[frozenset(after.collision.pair)] == pytest.approx(least(found), abs=5e-6)
    judged = Truth(Case("answer", "", blind(table))).judge(after.joints)
    assert judged.closure <= CLOSED
    assert judged.beyond <= 1e-9
    assert solution.objective.after == pytest.approx(judged.objective, rel=RECOMPUTED, abs=1e-8)
    return least(found)


# Robots


def robots(robot: str, seed: int) -> dict:
    """Two arms, an object about where the shipped problem has it, and obstacles among them."""
    rng = np.random.default_rng([seed, len(robot)])
    table = cells.tables({"panda": "two-panda-box", "xarm7": "xarm-bar"}[robot])
    thing = table["object"]
    thing["position"] = [*(np.array(thing["position"]) + rng.uniform(-0.06, 0.06, 3))]
    thing["rpy"] = [0.0, 0.0, float(rng.uniform(-0.3, 0.3))]
    middle = np.array([0.5, 0, 0.5] if robot == "panda" else [0.42, 0, 0.25])
    shapes = [
        {"kind": "cylinder", "radius": 0.03, "length": 0.5},
        {"kind": "box", "size": [0.1, 0.12, 0.14]},
        {"kind": "capsule", "radius": 0.03, "length": 0.4},
    ]
    table["obstacles"] = []
    for k, shape in enumerate(shapes):
        angle = rng.uniform(-np.pi, np.pi)
        away = [0.5 * np.cos(angle), 0.5 * np.sin(angle), rng.uniform(-0.1, 0.45)]
        table["obstacles"].append({
            "name": f"obstacle {k}", "shape": shape, "position": [*(middle + away)],
            "rpy": [*rng.uniform(-1, 1, 3)],
        })  # fmt: skip
    table["constraints"] = {"collision": True, "clearance": CLEARANCE}
    return table


@pytest.mark.few(3)
@pytest.mark.parametrize(("robot", "seed"), [
    ("panda", 0), ("panda", 1), ("panda", 2), ("xarm7", 0), ("xarm7", 1), ("xarm7", 2),
])  # fmt: skip
def test_answers_of_random_cells_keep_clear(robot: str, seed: int) -> None:
    table = robots(robot, seed)
    checked(table, copose.Planner(copose.parse(table)).solve())


def test_an_answer_is_no_worse_than_a_clear_posture_that_is_known() -> None:
    # Its links are 15 mm apart, round bodies about them would overlap.
    table = random_cell("xarm7", 17).tables
    for obstacle in table["obstacles"]:
        if obstacle["shape"]["kind"] == "sphere":
            obstacle["shape"] |= {"kind": "capsule", "length": 1e-6}
    left = [1.4199187095558068, -0.14032328833554608, -1.6296540886534459, 0.7392525508728971,
            -0.20816460739880327, 0.7418039671722587, 0.09139128036627486]  # fmt: skip
    right = [2.11319578078818, -1.5114406563688192, -1.3278548156938967, 0.7573272511679265,
             1.7893981571090516, -1.6929699999999999, -1.6178327499409164]  # fmt: skip
    assert least(all_distances(Setting.of(table), [np.array(left), np.array(right)])) > 0.015
    known = Truth(Case("known", "", blind(table))).judge({"left": left, "right": right})
    assert max(known.closure, known.beyond) <= CLOSED
    solution = copose.Planner(copose.parse(table)).solve()
    checked(table, solution)
    assert solution.objective.after >= known.objective - WORSE


def six_axis_arms(name: str, seed: int) -> dict:
    """Two arms with finitely many postures, and posts beside what they hold."""
    rng = np.random.default_rng([seed, len(name)])
    table = cells.random_cell((name, name), "spatial", seed)
    middle = np.array(table["object"]["position"])
    table["object"]["shape"] = {"kind": "box", "size": [0.05, 0.05, 0.05]}
    table["obstacles"] = []
    for k in range(2):
        angle, away = rng.uniform(-np.pi, np.pi), rng.uniform(0.2, 0.35)
        turn = np.array([np.cos(angle), np.sin(angle), 0.0])
        place = middle + away * turn + np.array([0.0, 0.0, rng.uniform(-0.2, 0.2)])
        shape = {"kind": "cylinder", "radius": 0.04, "length": 0.4}
        table["obstacles"].append({"name": f"post {k}", "shape": shape, "position": place.tolist()})
    return table | {"constraints": {"collision": True, "clearance": CLEARANCE}}


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("name", "seed"), [(name, seed) for name in ("ur5", "ur10", "z1") for seed in range(7)][:20]
)
def test_of_finitely_many_postures_the_best_that_keeps_clear_is_found(name: str, seed: int) -> None:
    """All of them by another projection, their bodies measured by Pinocchio."""
    table = six_axis_arms(name, seed)
    truth = Truth(Case("blind", "", blind(table)))
    postures = [spread_out(truth, i, closed_postures(truth, i, 4096, 3), 64) for i in (0, 1)]
    sums = []
    for i, q in enumerate(postures):
        J, M = truth.arm_matrices(i, q)
        sums.append(truth.terms(i, J, M))
    values = truth.values((sums[0][:, None] + sums[1][None]).reshape(-1, *sums[0].shape[1:]))
    setting, best = Setting.of(table), None
    for flat in np.argsort(-values):
        i, j = np.unravel_index(flat, [len(q) for q in postures])
        if least(all_distances(setting, [postures[0][i], postures[1][j]])) >= CLEARANCE:
            best = values[flat]
            break
    planner = copose.Planner(copose.parse(table))
    for answer in (planner.solve(seed=seed) for seed in range(3)):
        if best is None:
            assert answer.status == "infeasible", answer.reason
        else:
            assert answer.objective.after == pytest.approx(best, abs=1e-8)


@pytest.fixture(scope="module")
def walls() -> dict:
    return cells.tables("panda-walls")


@pytest.fixture(scope="module")
def between_walls(walls: dict) -> copose.Planner:
    return copose.Planner(copose.parse(walls))


def closed_pairs(table: dict, count: int) -> tuple[Truth, list[np.ndarray]]:
    """Postures that hold the object, closed by the benchmarks' own projection, by arm."""
    truth = Truth(Case("blind", "", blind(table)))
    return truth, [spread_out(truth, i, closed_postures(truth, i, 1024, 3), count) for i in (0, 1)]


def test_walls_are_in_the_way_of_the_best_posture(walls: dict) -> None:
    free = copose.Planner(copose.parse(blind(walls))).solve()
    assert free.objective.after == pytest.approx(-0.216980, abs=1e-5)
    found = all_distances(Setting.of(walls), joints_of(free.after))
    hit = min(found, key=found.get)
    assert found[hit] <= 0
    assert any(name.endswith("wall") for name in hit)
    assert any("overlap" in note and "wall" in note for note in free.notes)


def test_between_walls_no_sampled_posture_is_better(
    walls: dict, between_walls: copose.Planner
) -> None:
    solution = between_walls.solve()
    # Followed into contact.
    assert checked(walls, solution) < CLEARANCE + 1e-7
    value = solution.objective.after
    truth, (one, other) = closed_pairs(walls, 60)
    assert min(len(one), len(other)) >= 40
    sums = []
    for i, q in enumerate((one, other)):
        J, M = truth.arm_matrices(i, q)
        sums.append(truth.terms(i, J, M))
    table = truth.values((sums[0][:, None] + sums[1][None]).reshape(-1, *sums[0].shape[1:]))
    setting = Setting.of(walls)
    above = np.flatnonzero(table > value + WORSE)
    for i, j in zip(*np.unravel_index(above, (len(one), len(other))), strict=True):
        q = [one[i], other[j]]
        nearest = setting.bodies.nearest(setting.x(q))
        if nearest.distance >= CLEARANCE:
            assert least(all_distances(setting, q)) < CLEARANCE
    assert len(above) > 100


def test_the_same_seed_on_one_planner_gives_the_same(between_walls: copose.Planner) -> None:
    def told(solution: copose.Solution) -> str:
        return solution.model_dump_json(exclude={"timing"})

    first, other = between_walls.solve(seed=3), between_walls.solve(seed=4)
    assert told(between_walls.solve(seed=3)) == told(first)
    assert other.objective.after == pytest.approx(first.objective.after, abs=1e-9)


# The plane: shapes by their corners and a radius, distances by plane geometry


Outline = tuple[np.ndarray, float]


def planar(seed: int, space: str, count: int = 2) -> dict:
    """Arms of three or four links, so that each has one degree of freedom to spare."""
    rng = np.random.default_rng(seed)
    table = cells.planar(count, 4 if space == "planar" else 3, space)
    for arm in table["arms"]:
        for row in arm["links"]:
            radius, length = float(rng.uniform(0.01, 0.04)), float(rng.uniform(0.3, 0.5))
            row |= {"radius": radius, "length": length, "com": length / 2}
    for arm in table["arms"]:
        arm["grasp"]["angle"] += float(rng.uniform(-0.4, 0.4))
    thing = table["object"]
    thing["position"] = rng.uniform(-0.1, 0.1, 2).tolist()
    thing["angle"] = float(rng.uniform(-0.3, 0.3))
    thing["shape"] = (
        {"kind": "box", "size": [0.22, 0.1]} if seed % 2 else {"kind": "disk", "radius": 0.11}
    )
    angle, away = rng.uniform(-np.pi, np.pi, 2), rng.uniform(0.35, 0.7, 2)
    places = np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1).tolist()
    disk = {"kind": "disk", "radius": float(rng.uniform(0.04, 0.09))}
    table["obstacles"] = [
        {"name": "post", "shape": disk, "position": places[0]},
        {"name": "wall", "shape": {"kind": "box", "size": [0.3, 0.06]}, "position": places[1],
         "angle": float(rng.uniform(-2, 2))},
    ]  # fmt: skip
    table["constraints"] = {"collision": True, "clearance": CLEARANCE}
    return table


def outlines(table: dict) -> dict[str, Outline]:
    """Of all that stands still."""
    found = {}
    for name, body in [("object", table["object"])] + [(o["name"], o) for o in table["obstacles"]]:
        shape = body["shape"]
        place = reference.pose({"position": body["position"], "angle": body.get("angle", 0.0)})
        corners, radius = np.zeros((1, 2)), shape.get("radius", 0.0)
        if shape["kind"] == "box":
            corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * shape["size"] / np.array(2)
        found[name] = corners @ place.rotation[:2, :2].T + place.translation[:2], radius
    return found


def links(arm: dict, q: np.ndarray) -> dict[str, Outline]:
    base = reference.pose(arm["base"])
    point, angle = base.translation[:2], math.atan2(base.rotation[1, 0], base.rotation[0, 0])
    found = {}
    for k, (row, turn) in enumerate(zip(arm["links"], q, strict=True)):
        angle += turn
        end = point + row["length"] * np.array([math.cos(angle), math.sin(angle)])
        found[f"{arm['name']}/link{k + 1}"] = np.array([point, end]), row.get("radius", 0.03)
        point = end
    return found


def gap(one: Outline, other: Outline) -> float:
    (a, r), (b, s) = one, other
    for point, box in ((a[0], b), (b[0], a)):
        if len(box) > 2:
            along, beside = np.roll(box, -1, axis=0) - box, point - box
            side = along[:, 0] * beside[:, 1] - along[:, 1] * beside[:, 0]
            if np.all(side >= 0) or np.all(side <= 0):
                return -1.0
    return gap_2d(a, b) - r - s


def gaps(bodies: dict[str, Outline], tested: set[frozenset[str]]) -> Iterator[float]:
    for a, b in map(tuple, tested):
        if a in bodies and b in bodies:
            yield gap(bodies[a], bodies[b])


def self_motion(table: dict, arm: dict, count: int) -> Iterator[np.ndarray]:
    """Every posture in which the third link points along one of so many angles."""
    thing = table["object"]
    held = reference.pose({"position": thing["position"], "angle": thing["angle"]})
    tip = reference.pose(arm["base"]).inverse() * held * reference.pose(arm["grasp"])
    goal, turn = tip.translation[:2], math.atan2(tip.rotation[1, 0], tip.rotation[0, 0])
    lengths = [row["length"] for row in arm["links"]]
    rigid = table["task"]["space"] == "planar"
    if rigid:
        goal = goal - lengths[3] * np.array([math.cos(turn), math.sin(turn)])
    for angle in np.linspace(-math.pi, math.pi, count, endpoint=False):
        x, y = goal - lengths[2] * np.array([math.cos(angle), math.sin(angle)])
        cosine = (x * x + y * y - lengths[0] ** 2 - lengths[1] ** 2) / (2 * lengths[0] * lengths[1])
        if abs(cosine) > 1:
            continue
        for bent in (math.acos(cosine), -math.acos(cosine)):
            beyond = math.atan2(
                lengths[1] * math.sin(bent), lengths[0] + lengths[1] * math.cos(bent)
            )
            first = math.atan2(y, x) - beyond
            rest = [turn - angle] if rigid else []
            yield np.array([first, bent, angle - first - bent, *rest])


def enumerated(table: dict, count: int) -> tuple[float | None, bool]:
    """The log-volume of the best combination that keeps clear, and whether one that does not is
    better.
    """
    tested, problem = Setting.of(table).tested, reference.Problem(table)
    m, still = len(problem.rows), outlines(table)
    W = np.hstack([problem.W(arm) for arm in table["arms"]])
    shares = np.linalg.pinv(W) @ problem.M_o
    total, chosen, clears = np.zeros((m, m)), [], []
    for i, arm in enumerate(table["arms"]):
        mine = slice(m * i, m * i + m)
        grams, bodies, clear = [], [], []
        for q in self_motion(table, arm, count):
            _, J, M, _ = problem.arms[arm["name"]].at(q)
            J = J[problem.rows]
            A = M @ np.linalg.pinv(J) @ W[:, mine].T + J.T @ shares[mine]
            grams.append(A.T @ A)
            bodies.append(links(arm, q))
            alone = gaps(bodies[-1] | still, tested)
            clear.append(all(g >= CLEARANCE + 5e-6 for g in alone))
        total = total[..., None, :, :] + np.array(grams)
        chosen.append(bodies)
        clears.append(np.array(clear))
    ball = m / 2 * math.log(math.pi) - math.lgamma(m / 2 + 1)
    values = ball - np.linalg.slogdet(total)[1] / 2
    alone = np.ones(values.shape, dtype=bool)
    for i, clear in enumerate(clears):
        alone &= clear.reshape([-1 if j == i else 1 for j in range(len(clears))])
    order = np.argsort(-values, axis=None)
    for flat in order[alone.ravel()[order]]:
        which = np.unravel_index(flat, values.shape)
        apart = all(
            gap(x[a], y[b]) >= CLEARANCE + 5e-6
            for x, y in itertools.combinations(
                [bodies[k] for bodies, k in zip(chosen, which, strict=True)], 2
            )
            for a, b in itertools.product(x, y)
        )
        if apart:
            return float(values[which]), bool(values[which] < values.max())
    return None, True


def plainly_clear(table: dict, solution: copose.Solution) -> None:
    """A planar answer keeps clear by plane geometry, and is closed and worth what it says."""
    bodies = outlines(reference.placed(table, solution.after) | {"obstacles": table["obstacles"]})
    for arm in table["arms"]:
        bodies |= links(arm, np.array(solution.after.joints[arm["name"]]))
    found = min(gaps(bodies, Setting.of(table).tested))
    assert found >= CLEARANCE - TOLERANCE
    assert solution.after.collision.distance == pytest.approx(found, abs=5e-6)
    pair = solution.after.collision.pair
    assert gap(bodies[pair[0]], bodies[pair[1]]) == pytest.approx(found, abs=5e-6)
    own = reference.Problem(reference.placed(table, solution.after)).at(solution.after.joints)
    assert max(own.closure.values()) <= CLOSED
    assert solution.objective.after == pytest.approx(own.log_volume, rel=RECOMPUTED, abs=1e-8)


@pytest.mark.parametrize(("seed", "space"), [
    (0, "planar"), (0, "planar-linear"), (1, "planar"), (4, "planar"), (5, "planar-linear"),
])  # fmt: skip
def test_no_enumerated_posture_of_a_planar_cell_is_better(seed: int, space: str) -> None:
    table = planar(seed, space)
    solution = copose.Planner(copose.parse(table)).solve()
    assert solution.status == "solved"
    plainly_clear(table, solution)
    best, hindered = enumerated(table, 90)
    assert hindered
    assert best is not None
    assert solution.objective.after >= best - WORSE


@pytest.mark.parametrize(("seed", "space"), [(11, "planar-linear"), (5, "planar")])
def test_three_arms_keep_clear_of_each_other(seed: int, space: str) -> None:
    table = planar(seed, space, 3)
    best, hindered = enumerated(table, 30)
    assert best is not None
    assert hindered
    solution = copose.Planner(copose.parse(table)).solve()
    assert solution.status == "solved", solution.reason
    plainly_clear(table, solution)
    assert solution.objective.after >= best - WORSE


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(20))
def test_motions_keep_their_clearance_at_every_time(seed: int) -> None:
    """At fifty times between two knots, by plane geometry; beside an elbow that was in the way."""
    rng = np.random.default_rng(seed)
    table = path_problems.hinged(knots=12, duration=float(rng.uniform(0.8, 2.5)))
    table["object"]["shape"] = {"kind": "disk", "radius": 0.1}
    table["obstacles"] = []
    free = copose.plan(copose.parse(table))
    arm = ("a1", "a2")[seed % 2]
    elbow = np.array(free.knots[int(rng.integers(2, 10))].arms[arm].skeleton)[1, :2]
    table["obstacles"] = [ball("post", (elbow + rng.uniform(-0.05, 0.05, 2)).tolist(), 0.05)]
    table["constraints"] = {"collision": True, "clearance": CLEARANCE}
    motion = copose.plan(copose.parse(table))
    if motion.knots is None:
        assert motion.status in ("infeasible", "failed") and motion.reason
        return
    tested, way, least = Setting.of(table).tested, ObjectPath(table), np.inf
    for (k, t), (m, s) in itertools.pairwise(enumerate(motion.time)):
        for u in np.linspace(0, 1, 50):
            moving = way.at(t + u * (s - t))
            angle = math.atan2(moving.rotation[1, 0], moving.rotation[0, 0])
            thing = table["object"] | {"position": moving.position[:2].tolist(), "angle": angle}
            bodies = outlines(table | {"object": thing})
            for each in table["arms"]:
                q, p = (np.array(motion.knots[i].joints[each["name"]]) for i in (k, m))
                v, w = (np.array(motion.knots[i].velocity[each["name"]]) for i in (k, m))
                bodies |= links(each, CubicHermiteSpline([t, s], [q, p], [v, w])(t + u * (s - t)))
            least = min(least, *gaps(bodies, tested))
    assert least >= CLEARANCE - 1e-6
    assert motion.collision <= least + 1e-9


# What cannot be, and what is told


def small(**more: object) -> dict:
    table = planar(4, "planar-linear")
    table["obstacles"] = []
    return table | more


def ball(name: str, position: list[float], radius: float) -> dict:
    return {"name": name, "shape": {"kind": "disk", "radius": radius}, "position": position}


def beside_a_grasp() -> dict:
    """A cell with a stump 3 mm from a hinge's link, however that turns, and farther from the rest.

    The hinge is 0.15 m from the middle of a disk, the stump in a right angle beside it.
    """
    table = small()
    arm, thing = table["arms"][0], table["object"]
    grasp = np.array(arm["grasp"]["position"])
    beside = np.array([-grasp[1], grasp[0]]) / np.linalg.norm(grasp)
    away = 0.04 + arm["links"][2]["radius"] + 0.003
    turn = reference.pose({"position": thing["position"], "angle": thing["angle"]})
    place = turn.rotation[:2, :2] @ (grasp + away * beside) + turn.translation[:2]
    table["obstacles"] = [ball("stump", place.tolist(), 0.04)]
    return table


def number(reason: str, pair: str) -> float:
    """What is missing by a reason, m."""
    return float(re.search(rf"{pair} are ([-0-9.e]+) m", reason)[1])


def test_an_obstacle_that_no_posture_avoids_is_named() -> None:
    table = beside_a_grasp()
    solution = copose.Planner(copose.parse(table)).solve()
    assert solution.status == "infeasible"
    assert solution.after is None
    # Turned away the end of the link is as near as it ever is.
    assert "a1/link3 and stump" in solution.reason
    missing = number(solution.reason, "a1/link3 and stump")
    assert missing == pytest.approx(CLEARANCE - 0.003, abs=2e-5)


def test_an_object_within_an_obstacle_is_infeasible() -> None:
    table = small()
    x, y = table["object"]["position"]
    for radius, away in ((0.3, 0.0), (0.05, 0.155), (0.05, 0.164)):
        table["obstacles"] = [ball("stump", [x, y + away], radius)]
        solution = copose.Planner(copose.parse(table)).solve()
        assert solution.status == "infeasible"
        assert "object and stump" in solution.reason
        if away < radius + 0.11:
            assert "object and stump overlap" in solution.reason
    assert number(solution.reason, "object and stump") == pytest.approx(CLEARANCE - 0.004, abs=2e-5)


def test_an_object_just_clear_of_obstacles_is_not_infeasible(walls: dict) -> None:
    # Nothing round the boxes must decide.
    table = copy.deepcopy(walls)
    for beyond in (2e-5, 2e-4):
        shelf = {"kind": "box", "size": [0.2, 0.25, 0.02]}
        below = 0.5 - 0.15 - 0.01 - CLEARANCE - beyond
        table["obstacles"] = [
            *walls["obstacles"], {"name": "shelf", "shape": shelf, "position": [0.5, 0, below]},
        ]  # fmt: skip
        solution = copose.Planner(copose.parse(table)).solve()
        assert solution.status == "solved", solution.reason
        assert solution.objective.after > -0.73
        checked(table, solution)


def test_links_that_overlap_are_told_without_collision() -> None:
    table = small()
    overlapping = 0
    for seed, space in ((0, "planar"), (1, "planar"), (2, "planar-linear")):
        table = planar(seed, space)
        solution = copose.Planner(copose.parse(blind(table))).solve()
        assert solution.after.collision is None
        setting = Setting.of(table)
        bodies = outlines(table)
        for arm in table["arms"]:
            bodies |= links(arm, np.array(solution.after.joints[arm["name"]]))
        told = [note for note in solution.notes if "overlap" in note]
        # Always near are left out of what is tested with the clearance of the file.
        deep = min(gaps(bodies, setting.tested))
        assert len(told) == (1 if deep <= 0 else 0), (deep, solution.notes)
        overlapping += len(told)
        if told:
            a, b = told[0].split(" overlap")[0].split(" and ")
            assert gap(bodies[a], bodies[b]) <= 0
    assert overlapping


def colliding() -> dict:
    """A cell with a start that goes through the wall."""
    table = planar(1, "planar")
    solution = copose.Planner(copose.parse(blind(table))).solve()
    for arm in table["arms"]:
        arm["start"] = list(solution.after.joints[arm["name"]])
    return table


def test_a_colliding_start_is_evaluated_and_told(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    table = colliding()
    arms = table.pop("arms")
    obstacles = table.pop("obstacles")
    # Text knows nothing of numpy's numbers.
    table, arms, obstacles = json.loads(json.dumps([table, arms, obstacles], default=float))
    text = cells.toml(table)
    for name, rows in (("arms", arms), ("obstacles", obstacles)):
        for row in rows:
            plain = "\n".join(f"{k} = {cells.toml(v, 'x')}"
                              for k, v in row.items())  # fmt: skip
            text += f"[[{name}]]\n{plain}\n"
    (tmp_path / "p.toml").write_text(text)
    assert main(["evaluate", "p.toml", "-o", "out", "--quiet"]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["before"] is None
    collision = result["after"]["collision"]
    assert collision["distance"] < CLEARANCE
    both = " and ".join(collision["pair"])
    assert any(both in note and "clearance" in note for note in result["notes"])
    table |= {"arms": arms, "obstacles": obstacles}
    solution = copose.Planner(copose.parse(table)).solve()
    plainly_clear(table, solution)
    assert solution.before.collision.distance < CLEARANCE


def test_a_free_object_keeps_clear_too() -> None:
    table = planar(1, "planar")
    fixed = copose.Planner(copose.parse(table)).solve()
    table["object"]["freedom"] = {"x": [-0.05, 0.05]}
    solution = copose.Planner(copose.parse(table)).solve(effort="low")
    assert solution.status == "solved"
    plainly_clear(table, solution)
    moved = np.array(solution.after.object.position) - table["object"]["position"]
    assert abs(moved[0]) <= 0.05 + 1e-9
    assert moved[1] == pytest.approx(0, abs=1e-9)
    assert solution.objective.after >= fixed.objective.after - WORSE


def test_torques_at_rest_and_clearance_together() -> None:
    table = planar(1, "planar")
    table["world"] = {"gravity": [0, -9.81]}
    for arm in table["arms"]:
        arm["torque_limits"] = [11.2, 7.2, 4.8, 3.2]
    clear = copose.Planner(copose.parse(table)).solve()
    table["constraints"]["static_torque"] = True
    torques = copose.evaluate(copose.parse(table), clear)
    assert torques.status == "infeasible" or max(map(max, torques.after.static_torque.values())) > 1
    solution = copose.Planner(copose.parse(table)).solve()
    assert solution.status == "solved", solution.reason
    plainly_clear(table, solution)
    # Bodies are approached to some micrometres: either may be the nearer one.
    assert solution.objective.after <= clear.objective.after + 1e-3
    shares = [max(mine) for mine in solution.after.static_torque.values()]
    assert max(shares) <= 1 + 1e-6
