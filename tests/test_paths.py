"""Motions along paths: what they keep, where they stop, and the graph that they come from."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import copose
from cells import planar, tables, toml, two_pandas
from copose.cell.cell import Cell
from copose.commands.command_line import main
from copose.motion.curve.between_knots import between_bodies
from copose.motion.dynamics.least_norm import Tracked, tracked
from copose.motion.graph.dynamic_programming import Lattice, Moves
from copose.motion.graph.roadmap import Roadmap, RoadmapOptions
from copose.motion.path.knots import Course
from copose.motion.path.object_motion import ObjectMotion
from copose.motion.search.candidates import TrialOptions
from copose.motion.search.effort import PathEffort
from copose.posture.model import PostureModel
from object_path import ObjectPath
from path_problems import GRAVITY, along, carried, hinged, single_hinged

SPACING = RoadmapOptions().spacing
STILL = {"timing": None}


def planned(cell: dict, seed: int | None = None) -> copose.Motion:
    motion = copose.plan(copose.parse(cell), seed=seed)
    assert motion.status == "solved", motion.reason
    return motion


def stopped(cell: dict) -> copose.Motion:
    motion = copose.plan(copose.parse(cell))
    assert (motion.knots, motion.time) == (None, None)
    return motion


def joints(motion: copose.Motion) -> np.ndarray:
    return np.array([np.concatenate(list(knot.joints.values())) for knot in motion.knots])


def rates(motion: copose.Motion, what: str) -> np.ndarray:
    return np.array([np.concatenate(list(getattr(k, what).values())) for k in motion.knots])


def limited(cell: dict, **keys: object) -> dict:
    for arm in cell["arms"]:
        arm.update(keys)
    return cell


def test_the_same_file_and_seed_give_the_same_motion() -> None:
    one, other = (planned(hinged(), seed=3) for _ in range(2))
    assert one.model_copy(update=STILL) == other.model_copy(update=STILL)


def test_the_effort_decides_how_many_routes_are_optimised() -> None:
    problem = copose.parse(hinged())
    normal, low = copose.plan(problem), copose.plan(problem, effort="low")
    two = copose.plan(problem, effort=PathEffort(routes=TrialOptions(routes=2, more_routes=2)))
    assert [len(motion.search.routes) for motion in (low, two)] == [1, 2]
    assert len(normal.search.routes) == 3
    assert normal.model_copy(update=STILL) == copose.plan(problem, effort="normal").model_copy(
        update=STILL
    )
    with pytest.raises(copose.InputError, match="'huge' is not low, normal or high"):
        copose.plan(problem, effort="huge")


def test_any_seed_finds_the_same_motion() -> None:
    worths = []
    for seed in range(4):
        motion = planned(hinged(), seed=seed)
        worths.append(motion.objective.after - 0.01 * motion.smoothness)
    assert np.ptp(worths) < 1e-6


def test_the_shortest_motion_uses_the_limits_and_none_is_shorter() -> None:
    cell = limited(hinged(duration="shortest"), velocity_limits=[1.0, 1.5, 2.0])
    motion = planned(cell)
    steps = np.abs(np.diff(joints(motion), axis=0)) / np.diff(motion.time)[:, None]
    limits = np.tile([1.0, 1.5, 2.0], 2)
    assert 0.97 < (steps / limits).max() <= 1 + 1e-9
    assert (np.abs(rates(motion, "velocity")) / limits).max() <= 1 + 1e-9
    for part, solved in ((0.97, False), (1.03, True)):
        cell["path"]["duration"] = part * motion.duration
        assert (copose.plan(copose.parse(cell)).status == "solved") == solved


def test_any_seed_finds_the_shortest_motion() -> None:
    cell = limited(hinged(duration="shortest"), velocity_limits=[1.0, 1.5, 2.0])
    durations = [planned(cell, seed=seed).duration for seed in range(4)]
    assert np.ptp(durations) < 2e-3 * min(durations)


def test_the_shortest_motion_of_two_pandas_is_at_a_speed_limit() -> None:
    cell = carried(25, duration="shortest")
    motion = planned(cell | {"constraints": {"dynamic_torque": False}})
    speeds = np.array([j.velocity for joints in motion.limits.values() for j in joints])
    steps = np.abs(np.diff(joints(motion), axis=0)) / np.diff(motion.time)[:, None]
    assert 0.98 < (steps / speeds).max() <= 1 + 1e-9
    assert 0.98 < (np.abs(rates(motion, "velocity")) / speeds).max() <= 1 + 1e-9


def test_shortest_asks_for_limits_that_take_time() -> None:
    with pytest.raises(copose.InputError, match=r"path\.duration: needs limits that take time"):
        copose.plan(copose.parse(hinged(duration="shortest")))


def test_acceleration_limits_are_kept() -> None:
    free = planned(hinged())
    most = 0.7 * np.abs(rates(free, "acceleration")).max()
    motion = planned(limited(hinged(), acceleration_limits=[float(most)] * 3))
    assert np.abs(rates(motion, "acceleration")).max() <= most * (1 + 1e-6)


def test_dynamic_torques_are_kept_at_every_knot() -> None:
    free = planned(hinged(duration=0.8))
    most = np.abs(rates(free, "torque")).max(axis=0)
    limits = [float(x) for x in 0.9 * most.reshape(2, 3).max(axis=0)]
    cell = limited(hinged(duration=0.8), torque_limits=limits)
    broken = planned(cell)
    assert (np.abs(rates(broken, "torque")).max(axis=0) > np.tile(limits, 2)).any()
    cell["constraints"] = {"dynamic_torque": True}
    kept = planned(cell)
    assert np.all(np.abs(rates(kept, "torque")) <= np.tile(limits, 2) * (1 + 2e-6))
    assert kept.objective.after - 0.01 * kept.smoothness <= (
        broken.objective.after - 0.01 * broken.smoothness + 1e-7
    )


def test_dynamic_torque_asks_for_torque_limits() -> None:
    with pytest.raises(copose.InputError, match="dynamic_torque needs a torque limit on every"):
        copose.plan(copose.parse(hinged() | {"constraints": {"dynamic_torque": True}}))


def test_static_torques_are_kept_at_every_knot() -> None:
    cell = limited(hinged(), torque_limits=[14.0, 9.0, 5.0])
    cell["constraints"] = {"static_torque": True}
    motion = planned(cell)
    shares = [max(map(max, knot.static_torque.values())) for knot in motion.knots]
    assert max(shares) <= 1 + 1e-6


def test_a_closed_motion_ends_as_it_began() -> None:
    cell = hinged(closed=True)
    cell["path"]["waypoints"].append(cell["path"]["waypoints"][0] | {"angle": 0.0})
    motion = planned(cell)
    q = joints(motion)
    assert np.abs(q[-1] - q[0]).max() < 1e-9


def test_a_closed_path_has_to_return() -> None:
    with pytest.raises(copose.InputError, match=r"path\.closed: a closed path ends where"):
        copose.plan(copose.parse(hinged(closed=True)))


def test_the_first_knot_is_the_start() -> None:
    free = planned(hinged())
    first = free.knots[0].joints
    cell = hinged()
    for arm in cell["arms"]:
        arm["start"] = [q + 0.02 for q in first[arm["name"]]]
    motion = planned(cell)
    assert np.abs(joints(motion)[0] - joints(free)[0]).max() < 0.1
    assert max(motion.knots[0].closure_error.values()) < 1e-8
    told = [note for note in motion.notes if "misses its grasp by" in note]
    assert [note.split("'")[1] for note in told] == [arm["name"] for arm in cell["arms"]]


def test_the_worst_counts_where_it_is_asked_for() -> None:
    mean, worst = (planned(hinged(aggregate=each)) for each in ("mean", "worst"))
    least = min(knot.objective for knot in mean.knots)
    assert worst.objective.after == pytest.approx(min(knot.objective for knot in worst.knots))
    assert worst.objective.after - 0.01 * worst.smoothness > least - 0.01 * mean.smoothness


def test_knots_are_added_where_the_chain_opens_between_them() -> None:
    motion = planned(hinged(knots=4, tolerance=1e-5))
    extra = (len(motion.knots) - 1) / 3
    assert extra > 1 and extra == 2 ** round(np.log2(extra))
    assert motion.between_knots_error <= 1e-5


def test_three_arms() -> None:
    cell = along(planar(3), {"position": [-0.1, 0.1]}, {"position": [0.1, 0.15]}, knots=25)
    worths = [planned(cell, seed=seed).objective.after for seed in range(3)]
    assert np.ptp(worths) < 1e-5


def test_three_hinged_arms_turn_an_object_the_same_way_from_any_seed() -> None:
    cell = along(
        planar(3, world=GRAVITY), {"position": [-0.1, 0.1]},
        {"position": [0.1, 0.0], "angle": 0.4}, knots=20,
    )  # fmt: skip
    worths = [planned(cell, seed=seed).objective.after for seed in range(3)]
    assert np.ptp(worths) < 1e-5


@pytest.mark.long
def test_three_rigid_arms_return_to_the_same_posture_from_any_seed() -> None:
    cell = along(
        planar(3, 4, "planar", world=GRAVITY), {"position": [-0.1, 0.1]},
        {"position": [0.1, 0.0], "angle": 0.4}, {"position": [-0.1, 0.1], "angle": 0},
        knots=20, closed=True,
    )  # fmt: skip
    worths = [planned(cell, seed=seed).objective.after for seed in range(3)]
    assert np.ptp(worths) < 1e-4


def test_joints_without_limits_are_unwrapped() -> None:
    cell = single_hinged(knots=60, duration=6.0)
    turn = [{"position": [0.5 * np.cos(a) - 0.7, 0.5 * np.sin(a)]} for a in np.linspace(0, 7, 15)]
    cell["path"]["waypoints"] = turn
    motion = planned(cell)
    steps = np.abs(np.diff(joints(motion), axis=0))
    assert steps.max() < 1.0
    assert abs(joints(motion)[-1].sum() - joints(motion)[0].sum()) > 2


@pytest.mark.parametrize(
    ("cell", "expected"),
    [
        (along(planar(), {}, {"position": [0.0, 3.0]}), r"arm 'a1', .* s: it misses.*\(reach\)"),
        (
            limited(
                along(planar(1), {}, {"position": [-0.6, 0.9]}), position_limits=[[-0.5, 0.5]] * 3
            ),
            r"arm 'a1', .* s: joint 'joint\d' would be .* beyond its limits \(limit\)",
        ),
        (
            limited(hinged(duration=0.2), velocity_limits=[1.0, 1.0, 1.0]),
            r"arm 'a\d', .* s: its grasp goes .* m/s, .*; 0.2 s is too short \(speed\)",
        ),
    ],
)
def test_what_is_infeasible_says_where(cell: dict, expected: str) -> None:
    import re

    motion = stopped(cell)
    assert motion.status == "infeasible"
    assert re.search(expected, motion.reason), motion.reason


def test_a_motion_needs_no_freedom_and_no_cases_without_a_path_either() -> None:
    cell = planar()
    cell["object"]["freedom"] = {"x": [-0.1, 0.1]}
    with pytest.raises(copose.InputError, match="freedom: and a motion exclude each other"):
        copose.plan(copose.parse(cell))
    with pytest.raises(copose.InputError, match="cases: and a motion exclude each other"):
        copose.plan(copose.parse(planar() | {"cases": [{"name": "a"}]}))


def test_a_start_on_long_self_motions_is_followed() -> None:
    # Joints of two turns: all their self-motions together are too long to sample finely.
    cell = tables("xarm-bar")
    cell["path"] = {"waypoints": [{}, {}]}
    problem = copose.parse(cell)
    machinery = PostureModel(Cell.of(problem))
    course = Course.of(machinery, ObjectMotion.of(problem), np.linspace(0, 1, 61))
    for i in range(2):
        sample = Roadmap(machinery, course, i, 0, None, None, returns=False)
        start = sample.layers[0].q[0]
        roadmap = Roadmap(machinery, course, i, 0, start, None, returns=False)
        assert sample.spacing > SPACING and roadmap.spacing == SPACING
        # The object stays: what can be come to in the end is all that the curve is sampled by.
        assert roadmap.reached()[-1].all() and len(roadmap.layers[-1].q) > 20


def test_a_motion_is_no_posture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "p.toml"
    file.write_text(toml(hinged(knots=10)))
    assert main(["path", str(file), "-o", str(tmp_path), "--quiet"]) == 0
    result = str(tmp_path / "result.json")
    assert main(["evaluate", str(file), "--joints", result, "-o", str(tmp_path / "e")]) == 2
    assert "is a motion, of copose path; a posture's result is needed" in capsys.readouterr().err


def test_freedom_and_cases_are_refused() -> None:
    cell = hinged()
    cell["object"]["freedom"] = {"x": [-0.1, 0.1]}
    with pytest.raises(copose.InputError, match="path: and freedom exclude each other"):
        copose.parse(cell)
    cell = hinged() | {"cases": [{"name": "a"}]}
    with pytest.raises(copose.InputError, match="path: and cases exclude each other"):
        copose.parse(cell)


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.booleans())
def test_the_object_goes_where_the_law_says(seed: int, flat: bool) -> None:
    rng = np.random.default_rng(seed)
    cell = planar() if flat else two_pandas()
    waypoints = []
    for _ in range(int(rng.integers(2, 5))):
        whole = {"position": rng.uniform(-1, 1, 2 if flat else 3).tolist()}
        whole |= {"angle": rng.uniform(-6, 6)} if flat else {"rpy": rng.uniform(-3, 3, 3).tolist()}
        # What a waypoint leaves out is the previous one's.
        waypoints.append({key: value for key, value in whole.items() if rng.random() < 0.8})
    cell["path"] = {"waypoints": waypoints, "duration": 1.0}
    journey, law = ObjectMotion.of(copose.parse(cell)), ObjectPath(cell)
    phases = rng.uniform(0, 1, 20)
    positions, quaternions = journey.places(phases)
    for phase, position, quaternion in zip(phases, positions, quaternions, strict=True):
        ours, theirs = journey.at(phase), law.at(phase)
        assert ours.pose.position == pytest.approx(theirs.position, abs=1e-9)
        assert ours.pose.rotation == pytest.approx(theirs.rotation, abs=1e-9)
        rate, bend = np.split(ours.velocity, 2), np.split(ours.acceleration, 2)
        assert rate[0] == pytest.approx(theirs.velocity, abs=1e-7)
        assert rate[1] == pytest.approx(theirs.omega, abs=1e-7)
        assert bend[0] == pytest.approx(theirs.acceleration, abs=1e-6)
        assert bend[1] == pytest.approx(theirs.alpha, abs=1e-6)
        assert position == pytest.approx(theirs.position, abs=1e-9)
        assert abs(quaternion @ ours.pose.quaternion) == pytest.approx(1.0, abs=1e-12)


def test_least_norm_tracking_stops_at_either_limit_and_where_it_is_too_fast() -> None:
    cell = single_hinged()
    journey, first = ObjectMotion.of(copose.parse(cell)), joints(planned(cell))[0]

    def follow(**limits: object) -> Tracked:
        problem = copose.parse(limited(single_hinged(), **limits))
        return tracked(PostureModel(Cell.of(problem)), journey, [first], 25, 2.0)

    free = follow()
    assert free.reason is None and len(free.q) == 25
    low, high = free.q.min(axis=0), free.q.max(axis=0)
    for j in range(3):
        for side, sign in ((0, 1), (1, -1)):
            bounds = np.column_stack([low - 0.1, high + 0.1])
            bounds[j, side] = (low, high)[side][j] + sign * 0.2 * (high - low)[j]
            # Where the first posture is at that end there is no start.
            if sign * (first[j] - bounds[j, side]) <= 0:
                continue
            found = follow(position_limits=bounds.tolist())
            assert f"'joint{j + 1}' beyond its limits" in found.reason
            assert np.all((found.q >= bounds[:, 0] - 1e-6) & (found.q <= bounds[:, 1] + 1e-6))
    fastest = np.abs(np.diff(free.q, axis=0)).max() * 24 / 2.0
    assert "faster than it can be" in follow(velocity_limits=[float(0.9 * fastest)] * 3).reason


def test_what_comes_too_near_between_knots_is_seen() -> None:
    cell = hinged()
    motion = planned(cell)
    q = joints(motion)
    elbow = np.array(motion.knots[12].arms["a1"].skeleton)[1, :2]
    post = {"name": "post", "shape": {"kind": "disk", "radius": 0.01}, "position": elbow.tolist()}
    for collision, expected in ((False, None), (True, True)):
        cell |= {"obstacles": [post], "constraints": {"collision": collision}}
        problem = copose.parse(cell)
        machinery, journey = PostureModel(Cell.of(problem)), ObjectMotion.of(problem)
        found = between_bodies(machinery, journey, machinery.split(q), machinery.split(0 * q), 2.0)
        assert (found.distance is None) == (expected is None)
        assert (found.missing > 0) == bool(expected)


def test_bodies_keep_their_clearance_along_the_way() -> None:
    cell = hinged(knots=20)
    cell["object"]["shape"] = {"kind": "disk", "radius": 0.1}
    free = planned(cell)
    elbow = np.array(free.knots[10].arms["a1"].skeleton)[1, :2]
    cell["obstacles"] = [
        {"name": "post", "shape": {"kind": "disk", "radius": 0.05}, "position": elbow.tolist()}
    ]
    cell["constraints"] = {"collision": True, "clearance": 0.01}
    motion = planned(cell)
    assert min(knot.collision.distance for knot in motion.knots) >= 0.01
    assert motion.collision >= 0.01 - 1e-6
    assert motion.objective.after < free.objective.after


def test_where_bodies_leave_little_postures_are_nearer_to_each_other() -> None:
    """A post keeps an arm from two thirds of its postures; what a graph finds that is as coarse as
    elsewhere is worth 1.165.
    """
    cell = hinged(knots=20)
    place = [0.60530428, -0.01853363]
    cell["obstacles"] = [
        {"name": "post", "shape": {"kind": "disk", "radius": 0.05}, "position": place}
    ]
    cell["constraints"] = {"collision": True, "clearance": 0.01}
    motion = planned(cell)
    assert motion.objective.after >= 1.236
    assert motion.collision >= 0.01 - 1e-6


def test_without_a_path_the_motion_goes_to_the_best_posture(tmp_path: Path) -> None:
    cell = planar(world=GRAVITY)
    for arm, start in zip(cell["arms"], ([-0.4, 1.5, 1.2], [-0.4, 1.5, 1.2]), strict=True):
        arm["start"] = start
    solution = copose.solve(copose.parse(cell))
    motion = planned(cell)
    assert motion.reachable_from_start == solution.reachable_from_start
    places = {knot.object.position for knot in motion.knots}
    assert places == {solution.after.object.position}
    start = np.concatenate(list(solution.before.joints.values()))
    assert np.abs(joints(motion)[0] - start).max() < 1e-8
    if motion.reachable_from_start:
        best = np.concatenate(list(solution.after.joints.values()))
        apart = np.mod(joints(motion)[-1] - best + np.pi, 2 * np.pi) - np.pi
        assert np.abs(apart).max() < 1e-6


def test_the_command_writes_a_motion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "p.toml"
    file.write_text(toml(hinged()))
    assert main(["path", str(file), "-o", str(tmp_path / "out"), "--quiet", "--ros"]) == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"result.json", "trajectory.csv", "path.png", "trajectory.yaml"}
    motion = copose.read_motion(tmp_path / "out" / "result.json")
    data = json.loads((tmp_path / "out" / "result.json").read_text())
    assert len(data["time"]) == len(data["knots"]) == len(motion.knots)
    assert "before" not in data and "after" not in data


def test_infeasible_motions_exit_with_3(tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    file.write_text(toml(along(planar(), {}, {"position": [0.0, 3.0]})))
    assert main(["path", str(file), "-o", str(tmp_path / "out"), "--quiet"]) == 3
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["result.json"]


def test_two_pandas_keep_the_time_of_their_path() -> None:
    motion = planned(carried(knots=20))
    assert motion.time[-1] == pytest.approx(2.0) and motion.time[0] == 0.0
    assert motion.between_knots_error <= 1e-4
    assert max(max(knot.closure_error.values()) for knot in motion.knots) <= 1e-8
    assert two_pandas()["name"] == motion.problem.name


@settings(max_examples=30)
@given(st.integers(0, 10**6))
def test_the_lattice_finds_what_enumeration_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    layers, counts = 4, rng.integers(1, 4, (4, 2))

    def costs(axis: int) -> list[np.ndarray]:
        found = [rng.uniform(0, 1, (counts[k, axis], counts[k + 1, axis])) for k in range(3)]
        return [np.where(rng.random(c.shape) < 0.2, np.inf, c) for c in found]

    values = [rng.uniform(0, 1, tuple(counts[k])) for k in range(layers)]
    lattice = Lattice(values, list(map(Moves, costs(0))), list(map(Moves, costs(1))))
    best, widest, least = -np.inf, -np.inf, np.inf
    for nodes in np.ndindex(*counts.ravel()):
        path = np.array(nodes).reshape(layers, 2)
        moves = [
            (one.costs[path[k, 0], path[k + 1, 0]], other.costs[path[k, 1], path[k + 1, 1]])
            for k, (one, other) in enumerate(zip(lattice.one, lattice.other, strict=True))
        ]
        worth = [values[k][tuple(pair)] for k, pair in enumerate(path)]
        total = sum(worth) - sum(map(sum, moves))
        best = max(best, total)
        largest = max(map(max, moves))
        least = min(least, largest)
        if np.isfinite(largest):
            widest = max(widest, min(worth))
    found = lattice.best(1)
    assert (len(found) == 0) == (not np.isfinite(best))
    if found:
        assert found[0].worth == pytest.approx(best)
    assert lattice.least_of_largest() == pytest.approx(least)
    assert lattice.widest.max(initial=-np.inf) == pytest.approx(widest)
