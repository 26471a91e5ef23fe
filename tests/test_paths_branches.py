"""What torque limits and closed paths ask of arms, against all that there is to choose from.

Torques by Pinocchio, the wrenches that go with them by linear programs of the test's own.
"""

from __future__ import annotations

import copy
import itertools

import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import linprog

import copose
from cells import planar, tables
from copose.motion import PathPlanner
from dense_program import _two_links
from path_problems import GRAVITY, along, hinged, single_hinged
from path_truth import PathTruth, faults


def shares(truth: PathTruth, contacts: list, rates: list, now, limits: np.ndarray) -> float:
    """The largest |τ|/T at its least over all contact wrenches that drive the object; limits may be
    infinite, and no wrenches serve where it is.
    """
    J = scipy.linalg.block_diag(*[c.J for c in contacts])
    X, wanted = np.hstack([c.X for c in contacts]), truth.wrench(now)
    free = np.concatenate([c.M @ a + c.bias for c, a in zip(contacts, rates, strict=True)])
    A = J.T / limits[:, None]
    one = np.ones((len(A), 1))
    found = linprog(
        [0.0] * A.shape[1] + [1.0],
        np.vstack([np.hstack([A, -one]), np.hstack([-A, -one])]),
        np.concatenate([-free / limits, free / limits]),
        np.hstack([X, np.zeros((len(X), 1))]), wanted,
        bounds=[(None, None)] * (A.shape[1] + 1), method="highs",
    )  # fmt: skip
    return float(found.fun) if found.success else np.inf


def needed(tables: dict, motion, limits: np.ndarray) -> tuple[float, float]:
    """The largest share of a limit that a motion needs as it moves, and at rest at its ends."""
    told = motion.model_dump(mode="json")
    truth = PathTruth(tables, told["joint_names"], told["time"][-1])
    moving, resting = [], []
    for k, (time, knot) in enumerate(zip(told["time"], told["knots"], strict=True)):
        now = truth.path.at(time)
        contacts = truth.contacts(knot["joints"], knot["velocity"], now)
        rates = [np.array(knot["acceleration"][arm]) for arm in told["joint_names"]]
        moving.append(shares(truth, contacts, rates, now, limits))
        if k in (0, len(told["time"]) - 1):
            resting.append(shares(truth, contacts, [0 * rate for rate in rates], now, limits))
    return max(moving), max(resting)


def limited(cell: dict, *limits: list[float], **constraints: bool) -> dict:
    """The same with torque limits of each arm."""
    cell = copy.deepcopy(cell)
    for arm, own in zip(cell["arms"], limits, strict=True):
        arm["torque_limits"] = own
    return cell | ({"constraints": constraints} if constraints else {})


def single(**settings: object) -> dict:
    """One planar 3-joint arm on a hinge swings a point mass up in the shortest time."""
    cell = single_hinged(14, duration="shortest", **settings) | {"world": GRAVITY}
    return limited(cell, [16.0, 12.0, 5.0])


def pair() -> dict:
    """Two planar 2-joint arms, the second without torque limits, in the shortest time."""
    cell = planar(2, 2, world=GRAVITY)
    cell["arms"][0]["torque_limits"] = [12.0, 6.0]
    waypoints = {"position": [-0.05, 0.02]}, {"position": [0.08, 0.1]}
    return along(cell, *waypoints, knots=14, duration="shortest")


@pytest.mark.parametrize("cell", [single(), pair()], ids=["one arm", "one of two has limits"])
def test_the_shortest_motion_keeps_torque_limits_by_itself(cell: dict) -> None:
    limits = np.concatenate(
        [arm.get("torque_limits", [np.inf] * len(arm["links"])) for arm in cell["arms"]]
    )
    motion = copose.plan(copose.parse(cell))
    assert motion.status == "solved", motion.reason
    assert faults(cell, motion.model_dump(mode="json")) == []
    moving, resting = needed(cell, motion, limits)
    assert moving <= 1 + 2e-6 and resting <= 1 + 1e-6
    # In little less time the same motion breaks a limit.
    assert needed(cell, hurried(motion, 0.97), limits)[0] > 1


def hurried(motion, part: float):
    """The same motion in a part of its time: rates and their rates grow."""
    knots = tuple(
        knot.model_copy(update={
            "velocity": {arm: tuple(v / part for v in q) for arm, q in knot.velocity.items()},
            "acceleration": {
                arm: tuple(a / part**2 for a in q) for arm, q in knot.acceleration.items()
            },
        })
        for knot in motion.knots
    )  # fmt: skip
    time = tuple(t * part for t in motion.time)
    return motion.model_copy(update={"knots": knots, "time": time})


def test_the_file_may_say_that_torques_do_not_count() -> None:
    cell = pair() | {"constraints": {"dynamic_torque": False}}
    with pytest.raises(copose.InputError, match="no joint has one that counts"):
        copose.plan(copose.parse(cell))
    for arm in cell["arms"]:
        arm["velocity_limits"] = [9.0, 9.0]
    motion = copose.plan(copose.parse(cell))
    assert motion.status == "solved", motion.reason
    assert needed(cell, motion, np.array([12.0, 6.0, np.inf, np.inf]))[0] > 1


def test_without_any_limit_or_way_there_is_no_shortest_time() -> None:
    with pytest.raises(copose.InputError, match=r"path\.duration: .*limits that take time to keep"):
        copose.plan(copose.parse(hinged(duration="shortest")))
    cell = limited(along(planar(), {}, {}, duration="shortest"), [9.0] * 3, [9.0] * 3)
    with pytest.raises(copose.InputError, match=r"path\.duration: .* are one place"):
        copose.plan(copose.parse(cell))


def test_an_object_that_stays_is_held_in_the_best_posture_at_once() -> None:
    cell = along(planar(), {}, {}, knots=12)
    motion = copose.plan(copose.parse(cell))
    best = copose.solve(copose.parse({k: v for k, v in cell.items() if k != "path"}))
    assert motion.objective.after == pytest.approx(best.objective.after, abs=1e-6)
    assert motion.smoothness < 1e-9 and motion.search.layers < 25


@pytest.mark.parametrize("started", [False, True])
def test_a_first_pose_that_nothing_holds_at_rest_is_told(started: bool) -> None:
    cell = limited(single(), [4.0, 3.0, 1.0])
    if started:
        cell["arms"][0]["start"] = [1.0, -1.5, 0.9]
    motion = copose.plan(copose.parse(cell))
    assert motion.status == "infeasible", motion.reason
    assert "joint" in motion.reason and "times its" in motion.reason
    assert motion.reason.startswith(
        "arm 'a1', the first pose" if started else "the last pose: no posture holds"
    )
    assert motion.reason.endswith("(torque)")


# Three arms of two joints on hinges: their postures are two each, and motions eight.


def three_arms() -> dict:
    """A heavy point is carried by three arms, each with its elbow on either side."""
    cell = planar(3, 2, world=GRAVITY)
    cell["object"]["mass"] = 3.0
    for arm, lengths in zip(cell["arms"], ((0.45, 0.55), (0.5, 0.5), (0.6, 0.45)), strict=True):
        for link, length in zip(arm["links"], lengths, strict=True):
            link |= {"length": length, "com": 0.5 * length}
    return along(
        cell, {"position": [-0.05, 0.02]}, {"position": [0.08, 0.1]}, knots=20, duration=0.6
    )


def elbows(arm: dict, moments: list, sign: float) -> np.ndarray:
    """Joints of a two-link arm at moments, (count, 2), by the cosine rule."""
    base = arm["base"]
    goals = [
        (now.position + now.rotation @ [*arm["grasp"]["position"], 0.0])[:2] for now in moments
    ]
    away = np.array(goals) - base["position"]
    first, second = _two_links(away, *(link["length"] for link in arm["links"]), sign)
    return np.unwrap(np.column_stack([first - base.get("angle", 0.0), second - first]), axis=0)


def of_all_branches(tables: dict, limits: np.ndarray) -> dict[tuple[float, ...], float]:
    """The largest share of a limit that each combination of elbows needs."""
    names = {arm["name"]: ["joint1", "joint2"] for arm in tables["arms"]}
    truth = PathTruth(tables, names, tables["path"]["duration"])
    moments = [truth.path.at(t) for t in np.linspace(0, truth.path.duration, 20)]
    found = {}
    for signs in itertools.product((1.0, -1.0), repeat=len(names)):
        q = {
            arm["name"]: elbows(arm, moments, sign)
            for arm, sign in zip(tables["arms"], signs, strict=True)
        }
        worst = 0.0
        for k, now in enumerate(moments):
            here = {name: mine[k] for name, mine in q.items()}
            still = truth.contacts(here, {name: np.zeros(2) for name in names}, now)
            speeds = {
                name: np.linalg.solve(c.J, now.velocity[:2])
                for name, c in zip(names, still, strict=True)
            }
            contacts = truth.contacts(here, speeds, now)
            rates = [np.linalg.solve(c.J, now.acceleration[:2] + c.swing - c.lag) for c in contacts]
            worst = max(worst, shares(truth, contacts, rates, now, limits))
        found[signs] = worst
    return found


@pytest.mark.parametrize("least", [0.968, 1.004])
def test_all_branches_of_three_arms_count(least: float) -> None:
    cell = three_arms()
    limits = np.array([8.7, 7.0, 14.3, 3.4, 15.0, 2.4])
    known = of_all_branches(cell, limits)
    best, *others = sorted(known, key=known.__getitem__)
    limits = limits * known[best] / least
    assert all(known[other] / known[best] * least > 1 for other in others)
    cell = limited(cell, *limits.reshape(3, 2).tolist(), dynamic_torque=True)
    motion = copose.plan(copose.parse(cell))
    if least > 1:
        assert motion.status == "infeasible"
        assert f"needs {least:.3f} times its torque limit" in motion.reason
        assert "all 8 motions" in motion.reason
        return
    assert motion.status == "solved", motion.reason
    bends = [motion.knots[0].joints[arm["name"]][1] for arm in cell["arms"]]
    assert tuple(np.sign(bends)) == best
    assert needed(cell, motion, limits)[0] == pytest.approx(least, abs=1e-6)


@pytest.mark.parametrize(("aggregate", "least"), [("mean", 1.477), ("worst", 1.471)])
def test_arms_that_a_graph_knows_in_part_begin_with_the_best_postures(
    aggregate: str, least: float
) -> None:
    # Two degrees of freedom to spare each, and the best motion in a corner of their joint limits.
    cell = tables("two-planar-4r")
    cell["task"]["space"] = "planar-linear"
    cell["object"] |= {"mass": 0.8, "position": [0.19, -0.19], "angle": -0.29}
    lengths = [0.3, 0.38, 0.27, 0.35], [0.37, 0.36, 0.34, 0.33]
    places = ([0.58, -0.59], 0.15), ([-0.04, 0.9], -0.15)
    for arm, own, (base, grasp) in zip(cell["arms"], lengths, places, strict=True):
        arm["links"] = [
            {"length": x, "mass": 2 * x, "inertia": x**3 / 6, "com": x / 2} for x in own
        ]
        arm["base"], arm["grasp"] = {"position": base}, {"position": [grasp, 0.0]}
        arm["position_limits"] = [[-2.6, 2.6]] * 4
    end = {"position": [0.26, -0.15], "angle": -0.39}
    cell = along(cell, {}, end, knots=20, aggregate=aggregate)
    planner = PathPlanner(copose.parse(cell))
    values = [planner.plan(seed=seed).objective.after for seed in range(2)]
    assert min(values) > least and max(values) - min(values) < 1e-5
