"""Every objective with every ellipsoid: it converges, and its value is what it says."""

from __future__ import annotations

import copy
import itertools
import json

import numpy as np
import pytest

import copose
from cells import closed_postures, planar, tables, two_pandas
from copose.capability import Ellipsoid
from copose.cell.cell import Cell
from copose.measurement.meter import Meter
from copose.objectives.registry import objective_of
from copose.posture.model import PostureModel
from copose.posture.solvers.nlp import Given
from copose.problem import parse
from reference import Problem as Truth
from test_resolutions import SIZES, SPACES, cell_of

RESOLUTIONS = ["pseudoinverse", "torque-optimal"]


def objectives(m: int) -> dict[str, dict]:
    first, last = np.eye(m)[0].tolist(), np.eye(m)[-1].tolist()
    return {
        "volume": {"kind": "volume"},
        "task-compatibility": {
            "kind": "task-compatibility",
            "directions": [{"direction": first}, {"direction": last, "weight": -0.5}],
        },
        "worst-direction": {"kind": "worst-direction"},
        "isotropy": {"kind": "isotropy"},
    }


def value_of(factor: np.ndarray, objective: dict) -> float:
    """An objective from an independent factor of G."""
    radii = 1 / np.linalg.svd(factor, compute_uv=False)
    kind = objective["kind"]
    if kind == "volume":
        import math

        m = len(radii)
        return float(np.log(radii).sum() + m / 2 * math.log(math.pi) - math.lgamma(m / 2 + 1))
    if kind == "task-compatibility":
        total = 0.0
        for weighted in objective["directions"]:
            u = np.array(weighted["direction"], dtype=float)
            u /= np.linalg.norm(u)
            total -= weighted.get("weight", 1.0) * np.log(np.linalg.norm(factor @ u))
        return float(total)
    return float(radii.min() if kind == "worst-direction" else radii.min() / radii.max())


@pytest.mark.few(14)
@pytest.mark.parametrize("scaling", ["unit", "limits"])
@pytest.mark.parametrize("resolution", RESOLUTIONS)
@pytest.mark.parametrize("kind", list(objectives(2)))
@pytest.mark.parametrize("space", SPACES)
def test_twenty_of_twenty_closed_starts_converge(
    space: str, kind: str, resolution: str, scaling: str
) -> None:
    """To IPOPT's own tolerance, closed, and worth what independent code says to 1e-8."""
    cell = cell_of(space, resolution=resolution, torque_scaling=scaling)
    cell["objective"] = objectives(SIZES[space])[kind]
    ready = Cell.of(parse(cell))
    machinery = PostureModel(ready)
    objective, program = machinery.objective, machinery.program
    samples = [closed_postures(ready, i) for i in range(2)]
    bounds = np.concatenate(ready.lower), np.concatenate(ready.upper)
    truth = Truth(cell, {arm.name: list(arm.joint_names) for arm in ready.arms})
    meter = Meter(ready)
    for k in range(20):
        start = np.concatenate([sample[k] for sample in samples])
        end = program.solve(start, [Given(ready.parameters, objective.numbers)], *bounds)
        assert end.converged, (k, end.status)
        assert max(end.violations.values()) <= 1e-8
        measured = meter.measure(ready, ready.system.split(end.q))
        assert measured.ellipsoid is not None
        value = objective.of(measured.ellipsoid)
        joints = dict(zip(truth.arms, ready.system.split(end.q), strict=True))
        again = value_of(truth.ellipsoid(joints)[0], cell["objective"])
        assert value == pytest.approx(again, rel=1e-8, abs=1e-8)
        grams = program.gram_at(end.q, ready.parameters)[None]
        assert objective.of_grams(grams)[0] == pytest.approx(value, rel=1e-6, abs=1e-6)


def test_worst_direction_of_the_two_pandas() -> None:
    solution = copose.solve(parse(tables("panda-worst")))
    assert solution.objective.after == pytest.approx(0.205570, abs=5e-7)
    assert solution.objective.unit == "m/s², rad/s² per N·m"


@pytest.mark.parametrize(
    ("name", "expected"),
    [("push-x", 0.5093129), ("fast-fine", 0.8040972), ("panda-carry", -2.5667877)],
)
def test_known_optima(name: str, expected: float) -> None:
    cell = tables(name)
    solution = copose.solve(parse(cell))
    assert solution.objective.after == pytest.approx(expected, abs=1e-6)
    assert copose.verify(parse(cell), solution) == ()


def test_no_direction_is_longer_than_the_worst_is_short() -> None:
    """The shortest semi-axis by sampling, and that other postures have a shorter one."""
    cell = planar(2, 4, "planar", objective={"kind": "worst-direction", "axes": ["x", "y"]})
    problem = parse(cell)
    solution = copose.solve(problem)
    E = solution.after.ellipsoid.value
    u = np.random.default_rng(0).normal(size=(2000, 2))
    radii = [E.radius(v) for v in u]
    assert min(radii) == pytest.approx(solution.objective.after, rel=1e-5)
    ready = Cell.of(problem)
    meter = Meter(ready)
    samples = [closed_postures(ready, i) for i in range(2)]
    for a, b in itertools.product(samples[0][:15], samples[1][:15]):
        other = meter.measure(ready, [a, b]).ellipsoid
        assert other is None or other.radii[-1] <= solution.objective.after + 1e-9


def test_axes_in_any_order_and_number() -> None:
    base = two_pandas()
    values = {}
    for axes in (["x", "y", "z"], ["z", "x", "y"], ["z"], ["roll", "yaw"]):
        base["objective"] = {"kind": "volume", "axes": axes}
        solution = copose.solve(parse(base))
        values["".join(axes)] = solution.objective.after
        assert len(solution.after.ellipsoid.radii) == len(axes)
        assert solution.problem.axes == tuple(axes)
    assert values["xyz"] == pytest.approx(values["zxy"], abs=1e-9)


def test_a_direction_may_have_the_length_of_axes_and_need_not_be_normal() -> None:
    base = tables("push-x")
    base["task"]["space"] = "planar"
    base["object"]["inertia"] = 0.001
    for arm in base["arms"]:
        del arm["start"]
    values = []
    for direction in ([2.0, 0.0, 0.0], [0.5, 0.0]):
        cell = copy.deepcopy(base)
        cell["objective"] = {
            "kind": "task-compatibility",
            "directions": [{"direction": direction}],
            "axes": ["x", "y"],
        }
        values.append(copose.solve(parse(cell)).objective.after)
    assert values[0] == values[1]


def test_directions_and_weights_are_parameters_of_the_program() -> None:
    """A program built for one task solves another as a program built for that one does."""
    one, other = tables("fast-fine"), tables("fast-fine")
    other["objective"]["directions"] = [
        {"direction": [0.3, -1.0], "weight": 0.7},
        {"direction": [0.0, 1.0], "weight": 1.3},
    ]
    ready = Cell.of(parse(one))
    built, fresh = PostureModel(ready), PostureModel(Cell.of(parse(other)))
    start = np.concatenate([arm.start for arm in ready.arms])
    bounds = np.concatenate(ready.lower), np.concatenate(ready.upper)
    first = built.program.solve(start, [Given(ready.parameters, built.objective.numbers)], *bounds)
    numbers = fresh.objective.numbers
    ends = [
        machinery.program.solve(start, [Given(ready.parameters, numbers)], *bounds)
        for machinery in (built, fresh)
    ]
    assert np.array_equal(ends[0].q, ends[1].q) and not np.array_equal(first.q, ends[0].q)


class TestUnitOfLength:
    """Metres against millimetres: what changes is announced, what is not announced does not."""

    @staticmethod
    def scaled(cell: dict, s: float) -> dict:
        cell = copy.deepcopy(cell)
        thing = cell["object"]
        thing["position"] = [s * x for x in thing["position"]]
        thing["inertia"] = s * s * thing["inertia"]
        for arm in cell["arms"]:
            for link in arm["links"]:
                link.update(
                    length=s * link["length"], com=s * link["com"], inertia=s * s * link["inertia"]
                )
            for key in ("base", "grasp"):
                arm[key]["position"] = [s * x for x in arm[key]["position"]]
        return cell

    @pytest.mark.few(24)
    @pytest.mark.parametrize("kind", list(objectives(2)))
    @pytest.mark.parametrize("distribution", ["moore-penrose", "nonsqueezing"])
    @pytest.mark.parametrize("resolution", RESOLUTIONS)
    @pytest.mark.parametrize("axes", [None, ["x", "y"]])
    @pytest.mark.parametrize("space", ["planar", "planar-linear"])
    def test_preferences(
        self, space: str, axes: list | None, resolution: str, distribution: str, kind: str
    ) -> None:
        cell = planar(2, 4, space)
        size = 2 if axes or space == "planar-linear" else 3
        cell["objective"] = objectives(size)[kind] | ({"axes": axes} if axes else {})
        cell["ellipsoid"] = {"resolution": resolution, "load_distribution": distribution}
        ranked = []
        for s in (1.0, 30.0):
            problem = parse(self.scaled(cell, s))
            ready = Cell.of(problem)
            meter, objective = Meter(ready), objective_of(ready)
            rng = np.random.default_rng(0)
            values = []
            for _ in range(40):
                E = meter.measure(ready, ready.system.split(rng.uniform(-1.5, 1.5, 8))).ellipsoid
                values.append(objective.of(E))
            ranked.append(values)
            notes = copose.check(problem).notes
        metres, other = (np.array(values) for values in ranked)
        logs = objective.unit == "log"
        shifts = other - metres if logs else np.log(other / metres)
        changed = np.ptp(shifts) > 1e-6
        mixed = any("mixed axes" in note for note in notes)
        moore = any("Moore–Penrose" in note for note in notes)
        announced = moore or (mixed and kind in ("worst-direction", "isotropy"))
        assert announced or not changed
        # The announcements are not empty: what they name does change somewhere.
        if mixed and kind in ("worst-direction", "isotropy"):
            assert changed


def notes_of(cell: dict) -> str:
    return " | ".join(copose.check(parse(cell)).notes)


def test_notes_say_where_one_would_be_misled() -> None:
    cell = two_pandas()
    assert "mixed axes" in notes_of(cell) and "Moore–Penrose" in notes_of(cell)
    cell["objective"] = {"kind": "volume", "axes": ["x", "y", "z"]}
    assert "mixed axes" not in notes_of(cell)
    cell["ellipsoid"] = {"load_distribution": "nonsqueezing"}
    assert "Moore–Penrose" not in notes_of(cell)
    cell["ellipsoid"] = {"resolution": "torque-optimal"}
    assert "Moore–Penrose" not in notes_of(cell)
    cell["ellipsoid"] = {"torque_scaling": "limits"}
    assert "placeholders" not in notes_of(cell)
    for arm in cell["arms"]:
        arm["torque_limits"] = [100.0] * 7
    assert "look like placeholders: 100, 100" in notes_of(cell)
    pr2 = two_pandas()
    for arm, side, y in zip(pr2["arms"], "lr", (0.0, 5.0), strict=True):
        arm.update(
            urdf="example-robot-data://pr2_description/urdf/pr2.urdf",
            tip=f"{side}_gripper_tool_frame", base={"position": [0, y, 0]},
        )  # fmt: skip
    assert "unit torques count 1 N like 1 N·m at the prismatic joint left/torso" in notes_of(pr2)
    pr2["ellipsoid"] = {"torque_scaling": "limits"}
    assert "unit torques" not in notes_of(pr2) and "placeholders: 10000" in notes_of(pr2)


def test_rest_outside_the_shifted_ellipsoid_is_told() -> None:
    for scaling, outside in (("unit", True), ("limits", False)):
        cell = tables("xarm-bar")
        cell["ellipsoid"]["torque_scaling"] = scaling
        solution = copose.solve(parse(cell))
        told = any("after: rest is outside" in note for note in solution.notes)
        E = solution.after.ellipsoid.value
        assert isinstance(E, Ellipsoid) and told == outside == (not E.contains(np.zeros(6)))


def test_rest_is_judged_in_all_coordinates_and_by_what_torques_can_do() -> None:
    """Neither a slice that leaves gravity out nor least-norm rules decide whether it holds."""
    cell = two_pandas()
    cell["objective"] = {"kind": "volume", "axes": ["x", "y"]}
    cell["ellipsoid"] = {"gravity": True}
    assert any("after: rest is outside" in note for note in copose.solve(parse(cell)).notes)
    heavy = two_pandas()
    heavy["object"].update(mass=25.0, inertia=[0.375] * 3)
    heavy["ellipsoid"] = {"torque_scaling": "limits", "gravity": True}
    solution = copose.solve(parse(heavy))
    joints = {name: list(q) for name, q in solution.after.joints.items()}
    truth = Truth(heavy, {name: list(q) for name, q in solution.joint_names.items()})
    B, c = truth.constrained_dynamics(joints)
    torques = np.linalg.lstsq(B * truth.limits(), -c, rcond=None)[0]
    told = any("after: rest is outside" in note for note in solution.notes)
    assert told == (np.linalg.norm(torques) > 1)


def test_a_posture_without_an_ellipsoid_has_no_centre() -> None:
    cell = planar(1, 3, ellipsoid={"gravity": True}, world={"gravity": [0.0, -9.81]})
    cell["object"]["position"] = [1.2, 0.0]
    cell["arms"][0].update(
        base={"position": [0, 0]}, grasp={"position": [0, 0]}, start=[0.0, 0.0, 0.0]
    )
    assert copose.evaluate(parse(cell)).after.ellipsoid.center is None


def test_gravity_that_is_not_there_is_told() -> None:
    assert "gravity = true, but [world] gravity is 0" in notes_of(
        planar(ellipsoid={"gravity": True})
    )


def test_isotropy_of_one_axis_is_refused() -> None:
    with pytest.raises(copose.InputError, match="isotropy is always 1"):
        parse(planar(objective={"kind": "isotropy", "axes": ["x"]}))


def test_redundant_prismatic_joints_depend_on_the_unit_of_length(tmp_path) -> None:
    """A sliding arm in metres and in decimetres: least-norm joint motion is not the same."""
    from test_robots import problem_of, robot

    spreads = {}
    for resolution in RESOLUTIONS:
        values, notes = [], ""
        for s in (1.0, 10.0):
            limit = f'<limit lower="{-2 * s}" upper="{2 * s}" effort="1" velocity="3"/>'
            text = robot(kinds={2: "prismatic"}, limits={2: limit})
            text = text.replace("0 0.02 0.15", f"0 {0.02 * s} {0.15 * s}")
            text = text.replace("0 0 0.1", f"0 0 {0.1 * s}").replace('"0.01"', f'"{0.01 * s * s}"')
            (tmp_path / "robot.urdf").write_text(text)
            efforts = [10.0 * s * s] * 7
            efforts[2] = 20.0 * s
            cell = problem_of("robot.urdf", torque_limits=efforts)
            cell["task"]["space"] = "spatial-linear"
            cell["object"]["position"] = [s * x for x in cell["object"]["position"]]
            cell["ellipsoid"] = {"resolution": resolution, "torque_scaling": "limits"}
            problem = parse(cell, source=tmp_path / "p.toml")
            ready, notes = Cell.of(problem), " | ".join(copose.check(problem).notes)
            rng, meter = np.random.default_rng(0), Meter(ready)
            stretch = np.array([1, 1, s, 1, 1, 1, 1])
            logs = []
            for _ in range(20):
                E = meter.measure(ready, [rng.uniform(-1.5, 1.5, 7) * stretch]).ellipsoid
                logs.append(E.log_volume)
            values.append(logs)
        spreads[resolution] = np.ptp(np.array(values[1]) - np.array(values[0]))
        assert ("least-norm joint motion adds m to rad" in notes) == (spreads[resolution] > 1e-6)
    assert spreads["pseudoinverse"] > 0.01 and spreads["torque-optimal"] < 1e-9


def test_limits_are_needed_on_every_joint() -> None:
    cell = planar(ellipsoid={"torque_scaling": "limits"})
    told = r"arms\[0\] \(a1\).torque_limits: .*'joint1', 'joint2', 'joint3' have none"
    with pytest.raises(copose.InputError, match=told):
        copose.check(parse(cell))


def test_results_say_what_their_numbers_mean() -> None:
    cell = cell_of("planar", resolution="torque-optimal", torque_scaling="limits")
    cell["objective"] = {"kind": "worst-direction", "axes": ["x", "y"]}
    solution = copose.solve(parse(cell))
    assert solution.objective.unit == "m/s²"
    record = json.loads(solution.model_dump_json())["problem"]
    assert record["axes"] == ["x", "y"] and record["torque_scaling"] == "limits"
    assert set(solution.after.log_volumes) == set(RESOLUTIONS)
