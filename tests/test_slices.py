"""Complete inverse kinematics: every posture that is known is among those that slices meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cells import planar, random_cell, tables
from copose.cell.cell import Cell
from copose.mechanics import ArmMechanics
from copose.problem import parse
from copose.robots import finite_range
from copose.self_motion.curves.tracing import follow
from copose.self_motion.kernels import ArmKernels, KernelInputsBuilder
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.slices.sliced_arm import SlicedArm, SliceOptions

HERE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
BAXTER = "example-robot-data://baxter_description/urdf/baxter.urdf"


def sliced(tables: dict) -> tuple[Cell, SlicedArm]:
    cell = Cell.of(parse(tables))
    kernels = ArmKernels.of(cell.system.arms[0], cell.resolution)
    return cell, SlicedArm(cell.arms[0], kernels, cell.system.space)


def robot(name: str) -> dict:
    if name == "baxter":
        tables = random_cell(("panda",), "spatial", 0)
        tables["arms"][0] |= {"urdf": BAXTER, "tip": "left_gripper"}
        return tables
    return random_cell((name,), "spatial", 0)


def drawn(arm, count: int, seed: int) -> np.ndarray:
    low, high = finite_range(arm.lower, arm.upper)
    return np.random.default_rng(seed).uniform(low, high, (count, arm.n))


def apart(q: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Distance of each posture to the nearest known one, modulo turns."""
    turned = np.abs(np.angle(np.exp(1j * (q[:, None] - known[None]))))
    return turned.max(axis=2).min(axis=1)


def met(arm: SlicedArm, q: np.ndarray, goal: np.ndarray, postures: np.ndarray) -> bool:
    """Whether postures of slices are on the self-motion of a posture."""
    n, free = arm.arm.n, np.full((1, arm.arm.n), np.inf)
    manifold = ClosureManifold(arm.kernels, goal[None], -free, free, np.ones((1, n), dtype=bool))
    curve = follow(manifold, q[None])[0]
    return any(curve.place(posture) is not None for posture in postures)


@pytest.mark.parametrize("name", ["ur5", "z1", "ur10"])
def test_all_postures_of_six_joints(name: str) -> None:
    _, arm = sliced(robot(name))
    assert arm.fault is None
    for q in drawn(arm.arm, 8, 3):
        at_root = replace(arm.arm, base=arm.arm.base @ arm.arm.base.inverse())
        goal = arm.kernels.gap(q[None], HERE)[0]
        slices = arm.at(goal)
        assert slices.slices == 1 and slices.joints == () and slices.odd == 0
        assert len(slices.postures) <= 16
        assert apart(q[None], slices.postures)[0] < 1e-6
        # All of them reach the pose by plain forward kinematics, and no two are one.
        want = at_root.tip_at(q)
        for posture in slices.postures:
            tip = at_root.tip_at(posture)
            assert np.allclose(tip.position, want.position, atol=1e-8)
            assert np.allclose(tip.rotation, want.rotation, atol=1e-8)
        for k, posture in enumerate(slices.postures):
            others = np.delete(slices.postures, k, axis=0)
            assert len(others) == 0 or apart(posture[None], others)[0] > 1e-6


@pytest.mark.parametrize("name", ["panda", "xarm7", "baxter", "pr2-left"])
def test_slices_meet_the_self_motion_of_every_known_posture(name: str) -> None:
    _, arm = sliced(robot(name))
    assert arm.fault is None
    for q in drawn(arm.arm, 3, 11):
        goal = arm.kernels.gap(q[None], HERE)[0]
        slices = arm.at(goal)
        assert slices.slices == 144 and len(slices.joints) == 3 and slices.odd == 0
        residual, _ = arm.kernels.residual(slices.postures, goal)
        assert np.abs(residual).max() < 1e-9
        assert met(arm, q, goal, slices.postures)


@pytest.mark.parametrize(("links", "space"), [(2, "planar-linear"), (3, "planar-linear"),
                                              (3, "planar"), (4, "planar")])  # fmt: skip
def test_planar_arms_in_closed_form(links: int, space: str) -> None:
    _, arm = sliced(planar(2, links, space))
    assert arm.fault is None
    m = 3 if space == "planar" else 2
    for q in drawn(arm.arm, 10, 5):
        goal = arm.kernels.gap(q[None], HERE)[0]
        slices = arm.at(goal)
        residual, _ = arm.kernels.residual(slices.postures, goal)
        assert slices.odd == 0 and np.abs(residual).max() < 1e-9
        if links == m:
            assert len(slices.postures) == 2 and apart(q[None], slices.postures)[0] < 1e-6
        else:
            assert met(arm, q, goal, slices.postures)


def test_no_posture_is_lost_where_an_elbow_is_nearly_folded() -> None:
    """Two pairs of postures nearly meet there: a count that is even does not tell."""
    _, arm = sliced(robot("ur5"))
    q = np.array([[-3.332595, 3.91362, 2.754667, -6.026049, -5.755342, -6.084796]])
    goal = arm.kernels.gap(q, HERE)[0]
    free = np.full(6, np.inf)
    ends, gaps = project(arm.kernels, drawn(arm.arm, 500, 0), goal, -free, free)
    assert len(arm.at(goal).postures) == 8
    assert apart(ends[gaps < CLOSED], arm.at(goal).postures).max() < 1e-5


def test_a_slice_is_not_lost_at_a_symmetric_pose() -> None:
    """At the shipped pose of two Pandas one cut of the loop is exactly singular."""
    cell, arm = sliced(tables("two-panda-box"))
    inputs = KernelInputsBuilder(cell.system, cell.resolution, cell.scales)(cell.parameters)
    slices = arm.at(inputs.goals[0])
    assert slices.odd == 0 and len(slices.postures) == 928


def test_arms_without_complete_inverse_kinematics_say_why() -> None:
    _, arm = sliced(planar(2, 4, "planar-linear"))
    assert arm.fault == "has 2 degrees of freedom to spare"
    _, arm = sliced(random_cell(("tiago-left",), "spatial-linear", 0))
    assert arm.fault == "has 4 degrees of freedom to spare"


def test_a_spherical_shoulder_and_wrist_are_refused() -> None:
    """Every cut of such a loop loses postures: nothing is claimed of it."""
    cell, _ = sliced(robot("panda"))
    arm, along = cell.arms[0], np.array([0.0, 0.0, 0.3])
    straight = []
    for k, joint in enumerate(arm.joints):
        lift = along if k in (2, 4) else 0 * along
        # Axes turn by a right angle from joint to joint.
        tilt = (-1) ** k * np.pi / 2 if k else 0.0
        pose = type(joint.placement).from_rpy(lift if k % 2 == 0 else 0 * along, (tilt, 0.0, 0.0))
        straight.append(replace(joint, placement=pose, axis=np.array([0.0, 0.0, 1.0])))
    special = replace(arm, joints=tuple(straight))
    kernels = ArmKernels.of(ArmMechanics.of(special, cell.system.space), cell.resolution)
    few = SliceOptions(tested=12)
    assert "spherical" in SlicedArm(special, kernels, cell.system.space, few).fault
