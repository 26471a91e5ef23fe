"""M, J, g and tip poses against Pinocchio; closure; derivatives against differences."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from cells import PANDA, planar, two_pandas
from copose.cell.cell import Cell
from copose.mechanics import System, object_parameters
from copose.posture.model import PostureModel
from copose.posture.solvers.hessian import differenced_hessian
from copose.problem import parse
from copose.robots import load_arms
from reference import Problem, UrdfArm

TIAGO = "example-robot-data://tiago_description/robots/tiago_dual.urdf"
PR2 = "example-robot-data://pr2_description/urdf/pr2.urdf"
BAXTER = "example-robot-data://baxter_description/urdf/baxter.urdf"
XARM = "example-robot-data://xarm_description/urdf/xarm7.urdf"
KINOVA = "example-robot-data://kinova_description/robots/kinova.urdf"

ROBOTS = {
    "panda": {"urdf": PANDA, "tip": "panda_hand"},
    "xarm7": {"urdf": XARM, "tip": "link7"},
    "baxter": {"urdf": BAXTER, "tip": "left_gripper"},
    "pr2": {"urdf": PR2, "tip": "r_gripper_tool_frame", "locked": {"torso_lift_joint": 0.1}},
    "pr2-free-torso": {"urdf": PR2, "tip": "l_gripper_tool_frame"},
    "kinova": {"urdf": KINOVA, "tip": "j2s6s200_end_effector"},
    "tiago-free-torso": {"urdf": TIAGO, "tip": "arm_left_7_link"},
    "tiago-locked-torso": {
        "urdf": TIAGO,
        "tip": "arm_right_7_link",
        "locked": {"torso_lift_joint": 0.2, "arm_left_2_joint": -0.7},
    },
    "tiago-from-torso": {"urdf": TIAGO, "tip": "arm_left_tool_link", "root": "torso_lift_link"},
}


def arm_table(name: str, dressed: bool) -> dict:
    table = dict(ROBOTS[name], name="arm", grasp={"position": [0, 0, 0]})
    table["base"] = {"position": [0.3, -0.2, 0.5], "rpy": [0.4, -0.3, 1.1]}
    if dressed:
        table["tool"] = {
            "mass": 0.5,
            "com": [0.01, -0.02, 0.05],
            "inertia": [[2e-3, 1e-4, 0], [1e-4, 3e-3, 2e-4], [0, 2e-4, 2.5e-3]],
        }
    return table


def spatial_problem(table: dict, space: str = "spatial") -> dict:
    thing = {"mass": 1.0, "inertia": [0.01, 0.01, 0.01], "position": [0, 0, 0]}
    return {"format": 1, "name": "x", "task": {"space": space}, "object": thing, "arms": [table]}


@pytest.mark.parametrize("dressed", [False, True], ids=["bare", "armature+tool"])
@pytest.mark.parametrize("name", ROBOTS)
def test_pinocchio_agrees(name: str, dressed: bool) -> None:
    table = arm_table(name, dressed)
    free = list(load_arms(parse(spatial_problem(table)))[0].joint_names)
    if dressed:
        table["armature"] = [0.1 + 0.01 * i for i in range(len(free))]
    problem = parse(spatial_problem(table))
    arms = load_arms(problem)
    system = System.of(problem.space, arms)
    mechanics = system.arms[0]
    gravity = np.array([0.5, -1.0, -9.81])
    outputs = [
        mechanics.tip.position, mechanics.tip.rotation, mechanics.tip.quaternion,
        mechanics.J, mechanics.M,
        mechanics.gravity_torques(gravity),
    ]  # fmt: skip
    function = ca.Function("all", [mechanics.q], outputs)
    faster, h = ca.SX.sym("faster", len(free)), ca.SX.sym("h", 6)
    fall = arms[0].base.rotation.T @ gravity
    rest = ca.Function("rest", [mechanics.q, faster, h], [*mechanics.driven(faster, fall, h)])
    rates = ca.SX.sym("rates", len(free))
    parts = [*mechanics.driven(faster, fall, h, rates)]
    moving = ca.Function("moving", [mechanics.q, faster, h, rates], parts)
    truth = UrdfArm(table, free)
    rng = np.random.default_rng(3)
    for _ in range(20):
        q = rng.uniform(np.fmax(arms[0].lower, -np.pi), np.fmin(arms[0].upper, np.pi))
        tip, J, M, g = truth.at(q, gravity)
        qdd, wrench = rng.normal(size=len(q)), rng.normal(size=6)
        speed = rng.normal(size=len(q))
        bias, lag = truth.in_motion(q, speed, gravity)
        R_root = np.kron(np.eye(2), arms[0].base.rotation)
        p, R, quaternion, J_ours, M_ours, g_ours = (np.array(x) for x in function(q))
        w, x, y, z = quaternion.ravel()
        R_of_quaternion = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        for ours, theirs in [
            (p.ravel(), tip.translation),
            (R, tip.rotation),
            (R_of_quaternion, tip.rotation),
            (J_ours, J),
            (M_ours, M),
            (g_ours.ravel(), g),
            *zip(
                (np.array(x).ravel() for x in rest(q, qdd, R_root.T @ wrench)),
                (M @ qdd + g + J.T @ wrench, R_root.T @ J @ qdd), strict=True,
            ),
            *zip(
                (np.array(x).ravel() for x in moving(q, qdd, R_root.T @ wrench, speed)),
                (M @ qdd + bias + J.T @ wrench, R_root.T @ (J @ qdd + lag)), strict=True,
            ),
        ]:  # fmt: skip
            assert np.abs(ours - theirs).max() <= 1e-12 * max(np.abs(theirs).max(), 1.0)


@pytest.mark.parametrize("space", ["planar", "planar-linear"])
def test_planar_arms_agree_with_sums_over_links(space: str) -> None:
    cell = planar(2, 4, space)
    cell["arms"][0]["armature"] = [0.1, 0.2, 0.3, 0.4]
    cell["arms"][1]["base"]["angle"] = 0.7
    problem = parse(cell)
    truth = Problem(cell)
    system = System.of(problem.space, load_arms(problem))
    rng = np.random.default_rng(0)
    for arm in system.arms:
        function = ca.Function("all", [arm.q], [arm.tip.position, arm.tip.rotation, arm.J, arm.M])
        q = rng.uniform(-3, 3, arm.arm.n)
        tip, J, M, _ = truth.arms[arm.arm.name].at(q)
        for ours, theirs in zip(
            function(q), (tip.translation, tip.rotation, J[truth.rows], M), strict=True
        ):
            assert np.allclose(np.array(ours).reshape(theirs.shape), theirs, rtol=0, atol=1e-14)


def test_planar_tool_is_lumped_into_the_last_link() -> None:
    cell = planar(1, 3)
    bare = parse(cell)
    cell["arms"][0]["tool"] = {"mass": 0.5, "com": [0.03, 0.04], "inertia": 0.002}
    dressed = parse(cell)
    q = np.array([0.3, -0.8, 1.2])
    masses = []
    for problem in (bare, dressed):
        arm = System.of(problem.space, load_arms(problem)).arms[0]
        masses.append(np.array(ca.Function("M", [arm.q], [arm.M])(q)))
    tip, J, _, _ = Problem(cell).arms["a1"].at(q)
    offset = tip.rotation[:2, :2] @ [0.03, 0.04]
    at_com = J[:2] + np.outer([-offset[1], offset[0]], J[5])
    added = 0.5 * at_com.T @ at_com + 0.002 * np.outer(J[5], J[5])
    assert np.allclose(masses[1] - masses[0], added, rtol=0, atol=1e-13)


@pytest.mark.few(12)
@pytest.mark.parametrize("resolution", ["pseudoinverse", "torque-optimal"])
@pytest.mark.parametrize("kind", ["volume", "worst-direction", "isotropy", "task-compatibility"])
@pytest.mark.parametrize("space", ["spatial", "spatial-linear", "planar", "planar-linear"])
def test_gradients_equal_central_differences(space: str, kind: str, resolution: str) -> None:
    """Of the objective and of every constraint, in the joints and in what is free beside them."""
    tables = two_pandas(space) if space.startswith("spatial") else planar(2, 4, space)
    tables["objective"] = {"kind": kind}
    if kind == "task-compatibility":
        m = {"spatial": 6, "planar-linear": 2}.get(space, 3)
        tables["objective"]["directions"] = [{"direction": list(range(1, m + 1)), "weight": 0.7}]
    tables["ellipsoid"] = {"resolution": resolution}
    cell = Cell.of(parse(tables))
    machinery = PostureModel(cell)
    objective, nlp = machinery.objective, machinery.program.expressions
    stacked = ca.vertcat(nlp["f"], nlp["g"])
    values = ca.Function("values", [nlp["x"], nlp["p"]], [stacked])
    slopes = ca.Function("slopes", [nlp["x"], nlp["p"]], [ca.jacobian(stacked, nlp["x"])])
    parameters = np.concatenate([cell.parameters, objective.numbers])
    rng = np.random.default_rng(1)
    for _ in range(2):
        at = rng.uniform(-1.2, 1.2, nlp["x"].shape[0])
        exact = np.array(slopes(at, parameters))
        step = 1e-5
        for j in range(len(at)):
            shift = np.zeros(len(at))
            shift[j] = step
            # Fourth order, so that the difference itself is good to more than the bound.
            f = [np.array(values(at + k * shift, parameters)).ravel() for k in (-2, -1, 1, 2)]
            differences = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)
            scale = np.abs(exact).max(axis=1)
            assert np.all(np.abs(exact[:, j] - differences) <= 1e-6 * np.maximum(scale, 1.0))


def test_closure_vanishes_at_the_goal_and_not_at_a_flipped_hand() -> None:
    cell = two_pandas()
    problem = parse(cell)
    system = System.of(problem.space, load_arms(problem))
    thing = problem.object
    rng = np.random.default_rng(0)
    for i, arm in enumerate(system.arms):
        q = rng.uniform(arm.arm.lower, arm.arm.upper)
        tip = ca.Function("tip", [arm.q], [arm.tip.position, arm.tip.rotation])
        position, rotation = (np.array(x) for x in tip(q))
        closure = ca.Function("closure", [arm.q, system.object.parameters], [system.closure(i)])
        # An object placed so that the tip is exactly at its grasp, or flipped about an axis there.
        for flip, expected in ((0.0, 0.0), (np.pi, 2.0), (0.1, 2 * np.sin(0.05))):
            import pinocchio as pin

            turn = pin.AngleAxis(flip, np.array([0.6, 0.0, 0.8])).toRotationMatrix()
            tip_pose = pin.SE3(rotation @ turn, position.ravel())
            grasp = pin.SE3(arm.arm.grasp.rotation.copy(), arm.arm.grasp.position.copy())
            placed = tip_pose * grasp.inverse()
            x, y, z, w = pin.Quaternion(placed.rotation).coeffs()
            parameters = object_parameters(thing.pose, thing.mass, thing.inertia)
            parameters[:7] = [*placed.translation, w, x, y, z]
            residual = np.array(closure(q, parameters)).ravel()
            assert np.allclose(residual[:3], 0, atol=1e-12)
            assert abs(np.linalg.norm(residual[3:]) - expected) < 1e-10


def test_the_hessian_equals_central_differences_of_the_gradient() -> None:
    cell = Cell.of(parse(planar(2, 4, "planar")))
    nlp = PostureModel(cell).program.expressions
    hessian = differenced_hessian(nlp, nlp["x"].shape[0])
    rng = np.random.default_rng(2)
    q, weights = rng.uniform(-1.2, 1.2, nlp["x"].shape[0]), rng.normal(size=nlp["g"].shape[0])
    upper = np.array(hessian(q, cell.parameters, 0.7, weights).full())
    lagrangian = 0.7 * nlp["f"] + ca.dot(ca.DM(weights), nlp["g"])
    exact = ca.Function("H", [nlp["x"], nlp["p"]], [ca.hessian(lagrangian, nlp["x"])[0]])
    wanted = np.triu(np.array(exact(q, cell.parameters)))
    assert np.abs(upper - wanted).max() < 1e-5 * np.abs(wanted).max()
