"""Solving: closed, within limits, best, repeatable; and honest where there is nothing to find."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import copose
from cells import FILES, closed_postures, flat_arm, planar, random_cell, tables, two_pandas
from copose.cell.cell import Cell
from copose.mechanics import object_parameters
from copose.poses import Pose, rotation_rows
from copose.posture.model import PostureModel
from copose.posture.solvers.nlp import Given
from copose.problem import parse
from copose.results import Posture, Solution, to_json
from reference import Problem as Truth
from reference import placed

LONG = ("panda-three-cases", "panda-place-object", "panda-second-base")


def solved(cell: dict) -> Solution:
    solution = copose.solve(parse(cell))
    assert solution.status == "solved", solution.reason
    return solution


def check_posture(posture: Posture, cell: dict, names: dict) -> None:
    """Every number of a posture recomputed by independent code."""
    truth = Truth(cell, {name: list(joints) for name, joints in names.items()})
    factor, center = truth.ellipsoid(posture.joints)
    gram = factor.T @ factor
    E = posture.ellipsoid
    assert E.gram is not None and E.radii is not None and E.axes is not None
    assert np.allclose(E.gram, gram, rtol=0, atol=1e-8 * np.abs(gram).max())
    radii = 1 / np.linalg.svd(factor, compute_uv=False)[::-1]
    assert np.allclose(E.radii, radii, rtol=1e-8)
    a = len(radii)
    ball = a / 2 * math.log(math.pi) - math.lgamma(a / 2 + 1)
    assert E.log_volume is not None and abs(E.log_volume - ball - np.log(radii).sum()) < 1e-8
    assert list(E.radii) == sorted(E.radii, reverse=True)
    for radius, axis in zip(E.radii, np.array(E.axes), strict=True):
        assert abs(np.linalg.norm(factor @ axis) * radius - 1) < 1e-8
    assert np.allclose(E.center, center, rtol=0, atol=1e-8 * max(1, np.abs(center).max()))
    closure = truth.at(posture.joints).closure
    for name, error in posture.closure_error.items():
        assert closure[name] <= 1e-8 and abs(error - closure[name]) < 1e-8
    for name, arm in posture.arms.items():
        own = np.linalg.svd(truth.own_factor(name, posture.joints), compute_uv=False)
        assert np.allclose(arm.ellipsoid.radii, 1 / own[::-1], rtol=1e-8)
        tip = truth.arms[name].at(np.array(posture.joints[name]))[0]
        assert np.allclose(arm.skeleton[-1], tip.translation, atol=1e-12)
        turned = np.array(rotation_rows(arm.quaternions[-1]))
        assert np.allclose(turned, tip.rotation, atol=1e-12)


@pytest.mark.parametrize(
    "file",
    [pytest.param(f, marks=pytest.mark.long) if f.stem in LONG else f for f in FILES],
    ids=[file.stem for file in FILES],
)
def test_shipped_problems_recompute(file) -> None:
    problem = copose.load(file)
    solution = copose.solve(problem)
    assert solution.status == "solved"
    cell = tables(file.stem)
    for posture in (solution.before, solution.after):
        assert (posture is None) == ("cases" in cell)
        if posture is not None:
            check_posture(posture, placed(cell, posture), solution.joint_names)
    for postures in (solution.cases_before, solution.cases):
        for posture, case in zip(postures or (), cell.get("cases", ()), strict=True):
            check_posture(posture, placed(cell, posture, case), solution.joint_names)
    if solution.cases is not None:
        total = sum(posture.weight * posture.objective for posture in solution.cases)
        assert solution.objective.after == pytest.approx(total, rel=1e-12)
    elif solution.objective.kind == "volume":
        assert solution.objective.after == solution.after.ellipsoid.log_volume
        assert solution.objective.before == solution.before.ellipsoid.log_volume
    assert solution.objective.after > solution.objective.before
    assert copose.verify(problem, solution) == ()
    # What the file says of itself.
    text = file.read_text()
    schema, head = text[: text.index("format = 1")].split("\n", 1)
    assert schema.startswith("#:schema ")
    assert head.startswith("# What it shows:") and "# Expect:" in head.replace("\n#\n", "\n")
    values = [float(x) for x in re.findall(r"-?\d+\.\d{3,6}\b", head.split("# Expect:")[1])]
    assert any(abs(value - solution.objective.after) < 6e-4 for value in values)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("two-panda-box", -0.21698000494),
        ("baxter-box", -0.97136846),
        ("paper-fig2", 1.82249525),
        ("paper-fig3", 1.82249525),
        ("paper-fig4", 1.35540705),
        ("two-planar-4r", 3.51751463),
    ],
)
def test_known_optima(name: str, expected: float) -> None:
    solution = solved(tables(name))
    assert solution.objective.after == pytest.approx(expected, abs=1e-6)


def test_two_pandas_are_closed_from_fifty_seeds() -> None:
    """Closed to 1e-8 by Pinocchio, no hand flipped, within limits, never worse than before."""
    cell = two_pandas()
    planner = copose.Planner(parse(cell))
    truth = Truth(cell, {arm.name: list(arm.joint_names) for arm in Cell.of(parse(cell)).arms})
    best = 0
    for seed in range(50):
        solution = planner.solve(seed=seed)
        assert solution.status == "solved", solution.reason
        for posture in (solution.before, solution.after):
            again = truth.at(posture.joints)
            assert max(again.closure.values()) <= 1e-8
            for arm in truth.arms:
                q, model = np.array(posture.joints[arm]), truth.arms[arm].model
                assert np.all(q >= model.lowerPositionLimit) and np.all(
                    q <= model.upperPositionLimit
                )
        assert solution.objective.after >= solution.objective.before
        best += abs(solution.objective.after + 0.216980) < 1e-6
    assert best >= 45


@pytest.mark.parametrize("space", ["planar-linear", "planar"])
def test_the_optimum_of_an_exhaustive_search(space: str) -> None:
    """Dense samples of both self-motions, all pairs, against the answer of the posture program."""
    cell = planar(2, 3 if space == "planar-linear" else 4, space)
    cell["arms"][0]["position_limits"] = [[-2.5, 2.5]] * len(cell["arms"][0]["links"])
    cell["constraints"] = {"joint_margin": 0.1}
    solution = solved(cell)
    ready = Cell.of(parse(cell))
    truth = Truth(cell)
    grams = []
    W = np.hstack([truth.W(table) for table in cell["arms"]])
    W_pinv = np.linalg.pinv(W)
    m = len(truth.rows)
    for i, table in enumerate(cell["arms"]):
        mine = []
        for joints in closed_postures(ready, i, 3000, seed=99):
            _, J, M, _ = truth.arms[table["name"]].at(joints)
            J = J[truth.rows]
            if np.linalg.matrix_rank(J, tol=1e-9) < m:
                continue
            A = M @ np.linalg.pinv(J) @ W[:, m * i : m * i + m].T
            A = A + J.T @ W_pinv[m * i : m * i + m] @ truth.M_o
            mine.append(A.T @ A)
        grams.append(np.array(mine))
    pairs = grams[0][:, None] + grams[1][None]
    best = -0.5 * np.linalg.slogdet(pairs)[1].min()
    found = -0.5 * np.linalg.slogdet(np.array(solution.after.ellipsoid.gram))[1]
    assert found >= best - 1e-9
    # Dense enough to come close to the top: the answer is not above what exists either.
    assert found <= best + 2e-3


@pytest.mark.parametrize("space", ["spatial", "spatial-linear", "planar", "planar-linear"])
@pytest.mark.parametrize("arms", [1, 2, 3])
def test_every_space_and_number_of_arms(space: str, arms: int) -> None:
    if space.startswith("spatial"):
        cell = two_pandas(space)
        third = dict(cell["arms"][0], name="third")
        third["base"] = {"position": [0.5, 0.6, 0.0], "rpy": [0, 0, -np.pi / 2]}
        third["grasp"] = {"position": [0.0, 0.25, 0.0], "rpy": [np.pi / 2, 0, 0]}
        cell["arms"] = [*cell["arms"], third][:arms]
    else:
        cell = planar(arms, 4, space)
    solution = solved(cell)
    check_posture(solution.after, cell, solution.joint_names)
    assert len(solution.after.ellipsoid.radii) == {"spatial": 6, "planar-linear": 2}.get(space, 3)


@pytest.mark.few(4)
@pytest.mark.parametrize(
    ("names", "space"),
    [
        (("xarm7", "panda"), "spatial"),
        (("ur5", "ur5"), "spatial"),
        (("kinova", "kinova"), "spatial-linear"),
        (("pr2-left", "pr2-right"), "spatial"),
        (("pr2-left", "pr2-right"), "spatial-linear"),
        (("tiago-left", "tiago-right"), "spatial"),
        (("panda", "ur5", "kinova"), "spatial-linear"),
        (("panda", "panda", "panda", "panda"), "spatial"),
    ],
    ids=lambda value: value if isinstance(value, str) else "+".join(value),
)
def test_real_robots_in_random_cells(names: tuple[str, ...], space: str) -> None:
    """Cells that close by construction; every number again by Pinocchio; no local solve fails."""
    cell = random_cell(names, space, seed=1)
    solution = solved(cell)
    for posture in (solution.before, solution.after):
        check_posture(posture, cell, solution.joint_names)
    assert solution.objective.after >= solution.objective.before - 1e-12
    counts = [optimum.count for optimum in solution.search.local_optima]
    assert sum(counts) >= solution.search.starts - 1


def test_runs_with_one_seed_are_bit_identical() -> None:
    def run(seed: int) -> dict:
        cell = two_pandas()
        cell["search"] = {"seed": seed}
        answer = json.loads(to_json(solved(cell)))
        del answer["timing"]
        return answer

    first = run(3)
    assert first == run(3)
    assert first["before"] != run(4)["before"]


def test_object_pose_mass_and_inertia_are_parameters() -> None:
    """One program solves a moved, heavier object as a program built for it does."""
    cell = two_pandas()
    ready = Cell.of(parse(cell))
    program = PostureModel(ready).program
    moved = two_pandas()
    moved["object"].update(
        position=[0.52, 0.03, 0.48], rpy=[0.05, -0.02, 0.1], mass=3.0, inertia=[0.05, 0.04, 0.03]
    )
    other = Cell.of(parse(moved))
    pose = Pose.from_rpy([0.52, 0.03, 0.48], [0.05, -0.02, 0.1])
    parameters = object_parameters(pose, 3.0, np.diag([0.05, 0.04, 0.03]))
    assert np.array_equal(parameters, other.parameters)
    start = np.concatenate([closed_postures(other, i)[0] for i in range(2)])
    bounds = np.concatenate(other.lower), np.concatenate(other.upper)
    ends = [
        built.solve(start, [Given(parameters, np.zeros(0))], *bounds)
        for built in (program, PostureModel(other).program)
    ]
    assert ends[0].converged and np.array_equal(ends[0].q, ends[1].q)
    truth = Truth(moved, {arm.name: list(arm.joint_names) for arm in other.arms})
    joints = dict(zip(truth.arms, ready.system.split(ends[0].q), strict=True))
    assert max(truth.at(joints).closure.values()) < 1e-8


def test_a_given_start_is_the_posture_before() -> None:
    cell = tables("paper-fig2")
    solution = solved(cell)
    for arm in cell["arms"]:
        assert solution.before.joints[arm["name"]] == pytest.approx(arm["start"], abs=1e-9)


def test_an_open_start_is_projected() -> None:
    cell = tables("paper-fig2")
    cell["arms"][0]["start"][0] += 0.05
    solution = solved(cell)
    moved = np.array(solution.before.joints["a1"]) - cell["arms"][0]["start"]
    assert 1e-4 < np.abs(moved).max() < 0.2
    assert max(solution.before.closure_error.values()) < 1e-8
    gap = Truth(cell).at({arm["name"]: arm["start"] for arm in cell["arms"]}).closure["a1"]
    (note,) = [note for note in solution.notes if "misses" in note]
    most = np.abs(moved).argmax()
    assert f"'a1' misses its grasp by {gap:.3g} m:" in note
    assert note.endswith(f"by up to {np.abs(moved).max():.3g} rad (joint{most + 1})")


def test_a_start_that_is_turned_away_from_its_grasp() -> None:
    cell = two_pandas()
    joints = solved(cell).before.joints
    for arm in cell["arms"]:
        arm["start"] = list(joints[arm["name"]])
    assert not any("misses" in note for note in solved(cell).notes)
    cell["arms"][1]["start"][6] += 0.3
    solution = solved(cell)
    (note,) = [note for note in solution.notes if "misses" in note]
    # The last axis of a Panda goes through the origin of its hand.
    assert f"'right' misses its grasp by 0 m and {np.degrees(0.3):.3g}°:" in note


def test_the_margin_is_kept() -> None:
    cell = two_pandas()
    cell["constraints"] = {"joint_margin": 0.2}
    solution = solved(cell)
    for arm in Cell.of(parse(cell)).arms:
        q = np.array(solution.after.joints[arm.name])
        assert np.all(q >= arm.lower + 0.2) and np.all(q <= arm.upper - 0.2)
    free = solved(two_pandas())
    assert solution.objective.after < free.objective.after


def test_unlimited_joints_are_reported_within_a_turn() -> None:
    solution = solved(planar(2, 4))
    for q in solution.after.joints.values():
        assert np.all(np.abs(q) <= np.pi)


def test_out_of_reach_names_the_arm_and_the_exact_gap() -> None:
    cell = planar(2, 3)
    cell["arms"][1]["base"]["position"] = [3.0, 0.1]
    solution = copose.solve(parse(cell))
    assert solution.status == "infeasible" and solution.after is None and solution.before is None
    # The hand at full reach 1.2 m from its base; the grasp 0.15 m from the object at [0, 0.1].
    gap = np.hypot(3.0 - 0.15, 0.0) - 1.2
    assert "'a2'" in solution.reason and f"{gap:.4g} m" in solution.reason
    assert solution.nearest_miss.closure_error["a2"] == pytest.approx(gap, abs=1e-6)
    assert solution.nearest_miss.closure_error["a1"] < 1e-8
    assert solution.nearest_miss.ellipsoid.gram is None
    assert copose.verify(parse(cell), solution) == ()


def test_a_closed_start_is_found_where_hardly_anything_closes() -> None:
    """Limits that leave next to nothing around the start: random postures alone all miss."""
    cell = tables("paper-fig2")
    for arm in cell["arms"]:
        arm["position_limits"] = [[q - 1e-9, q + 1e-9] for q in arm["start"]]
    solution = solved(cell)
    assert solution.objective.after == pytest.approx(0.330457, abs=1e-5)


def test_too_near_is_a_miss_too() -> None:
    """Joint limits that keep the arm from folding: it reaches beyond its grasp, by how much."""
    cell = planar(1, 3)
    cell["arms"][0]["position_limits"] = [[-3, 3], [-0.2, 0.2], [-0.2, 0.2]]
    solution = copose.solve(parse(cell))
    assert solution.status == "infeasible" and "'a1'" in solution.reason
    # Folded as far as it goes the arm spans this much, and its first joint can point it anywhere.
    reach = abs(0.4 * np.sum(np.exp(1j * np.array([0.0, 0.2, 0.4]))))
    gap = reach - np.hypot(-0.15 + 0.7, 0.1)
    assert solution.nearest_miss.closure_error["a1"] == pytest.approx(gap, abs=1e-6)


def test_an_orientation_out_of_reach_says_so() -> None:
    cell = planar(1, 3, "planar")
    cell["arms"][0]["position_limits"] = [[-3, 3], [-3, 3], [-0.1, 0.1]]
    cell["arms"][0]["grasp"]["angle"] += np.pi
    solution = copose.solve(parse(cell))
    assert solution.status == "infeasible"
    assert "orientation" in solution.reason and "°" in solution.reason


def test_big_arms_at_the_edge_of_their_reach() -> None:
    """What closes must not depend on the unit of length: arms of 200 m, grasped at full reach."""
    link = {"length": 100.0, "mass": 1.0, "inertia": 900.0, "com": 50.0}
    cell = planar(1, 2)
    cell["arms"][0].update(links=[link, link], base={"position": [0, 0]})
    cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
    cell["object"]["position"] = [108.06046117362795, 168.29419696157930]
    assert copose.solve(parse(cell)).status in ("solved", "failed", "infeasible")


def test_a_posture_singular_to_working_precision_has_no_numbers() -> None:
    links = [
        {"length": 1.0, "mass": 1e5, "inertia": 1e4, "com": 0.5},
        {"length": 1.0, "mass": 1e-5, "inertia": 1e-6, "com": 0.5},
    ]
    cell = planar(1, 2)
    cell["object"] = {"mass": 1e-6, "position": [2.0, 0.0]}
    cell["arms"][0].update(links=links, base={"position": [0, 0]}, start=[0.0, 1e-7])
    cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
    solution = copose.evaluate(parse(cell))
    assert solution.after.ellipsoid.gram is None
    assert any("volume" in note for note in solution.notes)


def test_a_stretched_start_is_projected_too() -> None:
    """Where the residual has no slope to follow, from a little beside it."""
    link = {"length": 1.0, "mass": 1.0, "inertia": 0.03, "com": 0.5}
    cell = planar(1, 2)
    cell["arms"][0].update(links=[link, link], base={"position": [0, 0]}, start=[0.0, 0.0])
    cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
    cell["object"]["position"] = [1.2, 0.0]
    solution = solved(cell)
    assert not any("stands in" in note for note in solution.notes)


def test_many_arms_that_miss_are_summed_up() -> None:
    cell = planar(6, 3)
    for arm in cell["arms"]:
        arm["base"]["position"] = [5.0, 5.0]
    solution = copose.solve(parse(cell))
    assert "3 more arms miss theirs" in solution.reason


def test_linear_spaces_say_that_moments_are_ignored() -> None:
    assert any("moments" in note for note in solved(planar()).notes)


def test_a_start_within_the_margin_is_told_everywhere() -> None:
    cell = tables("paper-fig2")
    start = cell["arms"][0]["start"]
    cell["arms"][0]["position_limits"] = [[q - 0.01, q + 1] for q in start]
    cell["constraints"] = {"joint_margin": 0.05}
    assert any("'a1'" in n and "joint_margin" in n for n in copose.evaluate(parse(cell)).notes)


def test_volume_zero_everywhere_is_a_failure_with_its_reason(tmp_path: Path) -> None:
    """Joints whose axes are all parallel move no tip along them, in any posture."""
    solution = copose.solve(parse(flat_arm(tmp_path), source=tmp_path / "p.toml"))
    assert solution.status == "failed"
    assert solution.reason.startswith("volume 0: the Jacobian of arm 'arm' has rank 2 of 3 here; ")
    assert solution.before is not None and solution.before.ellipsoid.gram is None
    assert solution.objective.before is None and solution.after is None
    json.loads(to_json(solution))


def test_evaluate_measures_what_it_is_given() -> None:
    cell = tables("paper-fig2")
    problem = parse(cell)
    solution = copose.evaluate(problem)
    assert solution.status == "solved" and solution.before is None
    check_posture(solution.after, cell, solution.joint_names)
    assert solution.after.joints["a1"] == pytest.approx(cell["arms"][0]["start"], abs=0)
    answer = copose.solve(problem)
    again = copose.evaluate(problem, answer.after.joints)
    stated, found = answer.after.model_dump(), again.after.model_dump()
    assert stated == {key: found[key] for key in stated}


def test_evaluate_neither_projects_nor_bends_limits() -> None:
    cell = tables("paper-fig2")
    cell["arms"][1]["start"][0] += 0.1
    solution = copose.evaluate(parse(cell))
    assert solution.status == "infeasible" and solution.after is None
    gap = Truth(cell).at({a["name"]: a["start"] for a in cell["arms"]}).closure["a2"]
    assert "'a2'" in solution.reason and f"{gap:.4g}" in solution.reason
    problem = parse(two_pandas())
    joints = {name: list(q) for name, q in copose.solve(problem).after.joints.items()}
    for moved in (0, 6):
        open_joints = {name: list(q) for name, q in joints.items()}
        open_joints["left"][moved] += 0.1 if joints["left"][moved] < 0 else -0.1
        miss = copose.evaluate(problem, open_joints).nearest_miss
        names = {name: [f"panda_joint{i}" for i in range(1, 8)] for name in joints}
        gaps = Truth(two_pandas(), names).at(open_joints).closure
        assert gaps["left"] > 0.09
        assert miss.closure_error == pytest.approx(gaps, abs=1e-9)
    joints["left"][3] = 0.5
    broken = copose.evaluate(problem, joints)
    assert broken.status == "infeasible" and "panda_joint4" in broken.reason


def test_evaluate_needs_joints_that_fit() -> None:
    problem = parse(planar())
    with pytest.raises(copose.InputError, match=r"arms\[0\] \(a1\).start"):
        copose.evaluate(problem)
    with pytest.raises(copose.InputError, match="did you mean 'a1'"):
        copose.evaluate(problem, {"a11": [0, 0, 0]})
    with pytest.raises(copose.InputError, match="joint1, joint2, joint3"):
        copose.evaluate(problem, {"a1": [0, 0], "a2": [0, 0, 0]})
    with pytest.raises(copose.InputError, match="finite"):
        copose.evaluate(problem, {"a1": [0, 0, np.nan], "a2": [0, 0, 0]})


def test_verify_sees_every_number_that_is_off() -> None:
    problem = parse(planar())
    solution = copose.solve(problem)
    assert copose.verify(problem, solution) == ()
    answer = json.loads(to_json(solution))

    def tampered(*path: object) -> tuple[str, ...]:
        broken = json.loads(json.dumps(answer))
        node = broken
        for part in path[:-1]:
            node = node[part]
        node[path[-1]] += 1e-6
        return copose.verify(problem, Solution.model_validate(broken))

    for path in [
        ("after", "ellipsoid", "gram", 0, 0),
        ("after", "ellipsoid", "radii", 1),
        ("after", "ellipsoid", "log_volume"),
        ("after", "joints", "a1", 0),
        ("after", "log_volumes", "torque-optimal"),
        ("after", "closure_error", "a1"),
        ("after", "object", "angle"),
        ("after", "arms", "a1", "grasp", 0),
        ("before", "arms", "a2", "skeleton", 1, 0),
        ("before", "arms", "a2", "ellipsoid", "gram", 0, 0),
        ("objective", "after"),
    ]:
        assert tampered(*path), path


def test_projection_respects_limits_and_closes() -> None:
    ready = Cell.of(parse(two_pandas()))
    truth = Truth(two_pandas(), {arm.name: list(arm.joint_names) for arm in ready.arms})
    for i, arm in enumerate(ready.arms):
        closed = closed_postures(ready, i, 200)
        assert np.all(closed >= arm.lower) and np.all(closed <= arm.upper)
        assert len(closed) > 20
        goal = truth.object * _grasp(truth, arm.name)
        for joints in closed[:20]:
            tip = truth.arms[arm.name].at(joints)[0]
            assert np.allclose(tip.homogeneous, goal.homogeneous, atol=1e-8)


def _grasp(truth: Truth, name: str):
    from reference import pose

    return pose(next(t["grasp"] for t in truth.tables["arms"] if t["name"] == name))


def test_local_optima_are_counted() -> None:
    solution = solved(two_pandas())
    optima = solution.search.local_optima
    assert sum(optimum.count for optimum in optima) <= solution.search.starts
    values = [optimum.objective for optimum in optima]
    assert values == sorted(values, reverse=True)
    assert values[0] == pytest.approx(solution.objective.after, abs=1e-8)


def test_progress_is_told_and_only_grows() -> None:
    told: list[copose.Progress] = []
    solution = copose.solve(parse(planar()), progress=told.append)
    elapsed = [now.elapsed for now in told]
    assert elapsed == sorted(elapsed) and elapsed[0] >= 0
    assert len({now.stage for now in told}) >= 4
    assert all(now.done is None or now.total is None or now.done <= now.total for now in told)
    best = [now.best for now in told if now.best is not None]
    assert best == sorted(best)
    assert best[-1] == pytest.approx(solution.objective.after, abs=1e-9)


class TestPaperFigures:
    """The starts of the three problems show what the paper's text says of its figures."""

    def start(self, name: str):
        return copose.evaluate(parse(tables(name))).after

    def ratio(self, record) -> float:
        return record.radii[0] / record.radii[-1]

    def test_figure_2_two_clearly_directed_ellipses(self) -> None:
        posture = self.start("paper-fig2")
        assert all(self.ratio(arm.ellipsoid) > 4 for arm in posture.arms.values())

    def test_figure_3_two_nearly_round_ones(self) -> None:
        posture = self.start("paper-fig3")
        assert all(self.ratio(arm.ellipsoid) < 1.3 for arm in posture.arms.values())

    def test_figure_4_the_third_arm_gives_its_direction(self) -> None:
        posture = self.start("paper-fig4")
        a1, a2, a3 = (arm.ellipsoid for arm in posture.arms.values())
        assert self.ratio(a1) < 1.3 and self.ratio(a2) < 1.3 and self.ratio(a3) > 3
        cosine = abs(np.dot(a3.axes[0], posture.ellipsoid.axes[0]))
        assert np.degrees(np.arccos(cosine)) < 15
        fig3 = self.start("paper-fig3")
        assert {name: posture.joints[name] for name in fig3.joints} == fig3.joints
