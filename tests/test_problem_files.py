"""What is wrong with a problem file is said in one line: file, key, value, what is allowed."""

from __future__ import annotations

import copy
import math
from pathlib import Path

import pytest

import copose
from cells import planar, toml, two_pandas
from copose.errors import InputError
from copose.loader import load, parse

INF, NAN = float("inf"), float("nan")


def put(cell: dict, path: str, value: object) -> dict:
    """The cell with one value replaced, or a key removed where the value is None."""
    cell = copy.deepcopy(cell)
    node: object = cell
    parts = [int(p) if p.isdigit() else p for p in path.split(".")]
    for part in parts[:-1]:
        node = node.setdefault(part, {}) if isinstance(node, dict) else node[part]
    if value is None:
        del node[parts[-1]]
    else:
        node[parts[-1]] = value
    return cell


LINKS = [{"length": 0.4, "mass": 1.0, "inertia": 0.03, "com": 0.2}] * 3


def task(direction: list, weight: float = 1.0, **more: object) -> dict:
    weighted = {"direction": direction, "weight": weight}
    return {"kind": "task-compatibility", "directions": [weighted], **more}


def along(direction: list, **more: object) -> dict:
    return {"kind": "acceleration", "direction": direction} | more


def stay(**more: object) -> dict:
    return {"waypoints": [{}, {}]} | more


SPATIAL = [
    ("object.mas", 1.0, "object.mas: unknown key; did you mean 'mass'?"),
    ("object.mass", None, "object.mass: missing"),
    ("object.mass", 0.0, "object.mass: 0.0 must be above zero"),
    ("object.mass", -2, "object.mass: -2 must be above zero"),
    ("object.mass", NAN, "object.mass: nan must be finite"),
    ("object.mass", INF, "object.mass: inf must be finite"),
    ("object.mass", 1e300, "object.mass: 1e+300 must be at most 1e+06"),
    ("object.mass", "2", "object.mass: '2' must be a number"),
    ("object.mass", True, "object.mass: true must be a number"),
    ("object.inertia", [1, 1, 3], "triangle inequality"),
    ("object.inertia", [1, 1], "3 diagonal entries or a 3×3 matrix"),
    ("object.inertia", [1, 1, -1], "positive definite"),
    ("object.inertia", [[1, 0, 0], [0, 1, 0], [0, 0.1, 1]], "symmetric"),
    ("object.inertia", [[1, 0, 0], [0, 1, 0], [0, 0, NAN]], "object.inertia[2][2]: nan must be"),
    ("object.inertia", None, "object.inertia: missing; space 'spatial' needs"),
    ("object.position", [1, 2], "object.position: has 2 entries; 3 are needed"),
    ("object.position", [1, 2, 3, 4], "object.position: has 4 entries; at most 3 allowed"),
    ("object.angle", 1.0, "object.angle: unknown key"),
    ("object.velocity", [0] * 5, "object.velocity: has 5 entries; 6 are needed"),
    ("object.freedom", {"w": [0, 1]}, "object.freedom.w: unknown key"),
    ("object.freedom", {"x": [1, 0]}, "object.freedom.x: [1, 0]: crossed limits"),
    ("object.freedom", {"x": [0, math.inf]}, "object.freedom.x[1]: inf must be finite"),
    ("object.freedom", {"angle": [0, 1]}, "object.freedom.angle: unknown key"),
    (
        "arms.1.freedom",
        {"base": {"roll": [0, 1]}},
        "arms[1] (right).freedom.base.roll: unknown key",
    ),
    (
        "arms.1.freedom",
        {"grasp": {"yaw": [0, 1]}},
        "arms[1] (right).freedom.grasp.yaw: unknown key",
    ),
    ("object.shape", {"kind": "disk", "radius": 1.0}, "'disk' is not allowed here; allowed: 'box'"),
    ("object.shape", {"radius": 1.0}, "object.shape: missing kind"),
    ("object.shape", {"kind": "box", "size": [1, 1]}, "object.shape.size: has 2 entries; 3 are"),
    ("object.shape", {"kind": "box", "siz": [1, 1, 1]}, "did you mean 'size'? (and 1 more)"),
    ("task.space", "planr", "'planr' is not allowed; allowed: 'spatial'"),
    ("task.space", "planr", "did you mean 'planar'?"),
    ("task", None, "task: missing"),
    ("format", 2, "format: 2 is not allowed; allowed: 1"),
    ("format", None, "format: missing"),
    ("format", True, "format: true: must be a whole number"),
    ("format", 1.0, "format: 1.0: must be a whole number"),
    (
        "arms.0.urdf",
        "~nosuchuser/a.urdf",
        "arms[0] (left).urdf: '~nosuchuser/a.urdf' is no usable path",
    ),
    ("arms.0.urdf", "a\x00b", "is no usable path"),
    ("arms.0.packages", {"a": "b\x00"}, "arms[0] (left).packages.a: 'b\\x00' is no usable path"),
    ("arms.0.packages", {"a": 3}, "arms[0] (left).packages.a: 3 must be a text"),
    ("arms.0.urdf", "example-robot-data://" + "a" * 300, "is no usable path"),
    ("name", "..", "must be a name without '/'"),
    ("name", "a/b", "without '/'"),
    ("name", "", "must be a name without"),
    ("name", "a\tb", "must be a visible name"),
    ("arms.0.name", "", "arms[0] ().name: '': must be a visible name"),
    ("arms", [], "arms: has 0 entries; at least 1 needed"),
    ("arms", 3, "arms: 3 must be an array"),
    ("arms.1.name", "left", "two arms are called 'left'"),
    ("arms.1.links", LINKS, "arms[1] (right): an arm by its links belongs to the planar spaces"),
    (
        "arms.1.position_limits",
        [[1, 0]] * 7,
        "arms[1] (right).position_limits[0]: [1, 0]: crossed limits",
    ),
    ("arms.1.position_limits", [[NAN, 0]] * 7, "must be a number, or ±inf for none"),
    ("arms.1.position_limits", [[-1, 1]] * 6, "has 6 entries; 7 are needed, for panda_joint1"),
    ("arms.0.armature", [0.1] * 8, "arms[0] (left).armature: has 8 entries; 7 are needed"),
    ("arms.0.torque_limits", [0.0] * 7, "arms[0] (left).torque_limits[0]: 0.0 must be above zero"),
    ("arms.0.torque_limits", [NAN] * 7, "arms[0] (left).torque_limits[0]: nan must be above zero"),
    ("arms.0.start", [0.0] * 5, "arms[0] (left).start: has 5 entries; 7 are needed"),
    (
        "arms.0.start",
        [9, 0, 0, -1, 0, 1, 0],
        "arms[0] (left).start[0]: 9.0 is outside the limits of panda",
    ),
    (
        "arms.0.tip",
        "panda_hnd",
        "arms[0] (left).tip: 'panda_hnd' is no link of panda.urdf; did you mean",
    ),
    ("arms.0.root", "nowhere", "arms[0] (left).root: 'nowhere' is no link of panda.urdf"),
    (
        "arms.0.root",
        "panda_leftfinger",
        "arms[0] (left).root: 'panda_leftfinger' is not above the tip",
    ),
    (
        "arms.0.locked",
        {"panda_joint9": 0.0},
        "arms[0] (left).locked: 'panda_joint9' is no movable joint",
    ),
    ("arms.0.locked", {"panda_hand_joint": 0.0}, "is no movable joint"),
    (
        "arms.0.locked",
        {"panda_joint1": "x"},
        "arms[0] (left).locked.panda_joint1: 'x' must be a number",
    ),
    ("arms.0.tip", "panda_link5", "has 5 free joints (panda_joint1"),
    ("arms.0.tip", "panda_link0", "arms[0] (left): no free joint between"),
    ("arms.0.tip", "panda_leftfinger", "'panda_finger_joint2' mimics 'panda_finger_joint1', which"),
    ("arms.0.tool", {"mass": 1.0, "com": [0, 0, 0]}, "arms[0] (left).tool.inertia: missing"),
    ("constraints.joint_margin", 1.6, "constraints.joint_margin: 1.6 leaves nothing of the range"),
    ("constraints.joint_margin", -0.1, "constraints.joint_margin: -0.1 must be at least 0"),
    ("constraints.static_torque", 1, "constraints.static_torque: 1 must be true or false"),
    ("constraints.internal_force", 0, "constraints.internal_force: 0 must be above zero"),
    ("arms.0.grip", {"force": -1.0}, "arms[0] (left).grip.force: -1.0 must be above zero"),
    ("arms.0.grip", {"torque": 1.0}, "arms[0] (left).grip.torque: unknown key"),
    ("constraints.collision", 1, "constraints.collision: 1 must be true or false"),
    ("constraints.clearance", -0.1, "constraints.clearance: -0.1 must be at least 0"),
    ("objective.kind", "pay", "objective.kind: 'pay' is not allowed here; allowed: 'volume'"),
    ("objective", {"kind": "acceleration"}, "objective.direction: one of direction and directions"),
    ("objective", along([1, 0]), "objective.direction: has 2 entries; 6 are needed"),
    ("objective", along([1] * 6, directions=[[1] * 6]), "direction and directions, not both"),
    ("objective", {"kind": "acceleration", "directions": [[1] * 5]}, "directions[0].direction: h"),
    ("objective", {"kind": "payload", "acceleration": 2.0}, "objective.direction: missing"),
    ("objective", {"kind": "payload", "direction": [1] * 6}, "objective.acceleration: missing"),
    ("objective", {"kind": "all-round"}, "objective.axes: mixes linear and angular accelerations"),
    ("objective.kind", "volum", "did you mean 'volume'?"),
    ("objective.axes", ["x", "w"], "objective.axes[1]: 'w' is no coordinate of space 'spatial'"),
    ("objective.axes", ["x", "x"], "objective.axes[1]: 'x' is named twice"),
    ("objective.axes", [], "objective.axes: is empty"),
    ("objective", {"kind": "task-compatibility"}, "objective.directions: missing"),
    ("objective", {"kind": "volume", "directions": []}, "objective.directions: unknown key"),
    ("objective", task([1, 0]), "objective.directions[0].direction: has 2 entries; 6 are needed"),
    ("objective", task([0] * 6), "objective.directions[0].direction: [0, 0, 0, 0, 0, 0]: must not"),
    ("objective", task([1] * 6, weight=0.0), "directions[0].weight: 0.0: must not be zero\n"),
    ("objective", task([1] * 6, axes=["x", "y"]), "points outside axes: z, roll, pitch, yaw must"),
    ("objective", task([1] * 3, axes=["x", "y"]), "has 3 entries; 6 or 2 are needed"),
    ("ellipsoid.resolution", "torque", "ellipsoid.resolution: 'torque' is not allowed; allowed"),
    ("ellipsoid.gravity", 1, "ellipsoid.gravity: 1 must be true or false"),
    ("world.gravity", [0, 0], "world.gravity: has 2 entries; 3 are needed"),
    ("search.seed", -1, "search.seed: -1 must be at least 0"),
    ("search.seed", 0.5, "search.seed: 0.5 must be a whole number"),
    ("search.reachable", 1, "search.reachable: 1 must be true or false"),
    ("path", {"duration": 1.0}, "path.waypoints: missing"),
    ("path", {"waypoints": [{}]}, "path.waypoints: has 1 entry; at least 2 needed"),
    ("path", {"waypoints": [{}, {"angle": 1.0}]}, "path.waypoints[1].angle: unknown key"),
    (
        "path",
        stay(duration="fast"),
        "path.duration: 'fast': must be a number of seconds, or 'short",
    ),
    ("path", stay(duration=0), "path.duration: 0: must be from 0.001 to 1e5 s"),
    ("path", stay(duration=True), "path.duration: true: must be a number of seconds, or"),
    ("path", stay(knots=1), "path.knots: 1 must be at least 2"),
    ("path", stay(knots=50.0), "path.knots: 50.0 must be a whole number"),
    ("path", stay(aggregate="max"), "path.aggregate: 'max' is not allowed; allowed: 'mean' or"),
    ("path", stay(smoothness=-1), "path.smoothness: -1 must be at least 0"),
    ("path", stay(tolerance=0), "path.tolerance: 0 must be above zero"),
    ("arms.0.velocity_limits", [1, 0], "arms[0] (left).velocity_limits[1]: 0 must be above zero"),
    ("obstacles", [{"name": "a", "position": [0, 0, 0]}], "obstacles[0].shape: missing"),
    (
        "obstacles",
        [{"name": "a", "shape": {"kind": "disk", "radius": 1}, "position": [0, 0, 0]}],
        "obstacles[0].shape.kind: 'disk' is not allowed here",
    ),
    ("cases", [{"name": "a"}, {"name": "a"}], "two cases are called 'a'; give each its own"),
    ("cases", [{"name": "a", "direction": [1, 0, 0]}], "objective 'volume' has no direction"),
    (
        "obstacles",
        [{"name": "left", "shape": {"kind": "sphere", "radius": 1.0}, "position": [0, 0, 0]}],
        "obstacles[0].name: 'left' is the object's or an arm's; give it its own",
    ),
    ("arms.0.fixed", True, "a fixed arm is held at its start, which is missing; give one"),
]


@pytest.mark.parametrize(("path", "value", "expected"), SPATIAL, ids=lambda x: str(x)[:40])
def test_spatial_faults(path: str, value: object, expected: str, tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    file.write_text(toml(put(two_pandas(), path, value)))
    with pytest.raises(InputError) as caught:
        copose.check(load(file))
    message = str(caught.value)
    # A newline at the end of what is expected: nothing follows.
    assert expected in f"{message}\n" and message.startswith(str(file)) and "\n" not in message


PLANAR = [
    ("object.rpy", [0, 0, 0], "object.rpy: unknown key"),
    ("object.inertia", [0.1, 0.1, 0.1], "object.inertia: [0.1, 0.1, 0.1] must be a number"),
    ("object.inertia", 0.0, "object.inertia: 0.0 must be above zero"),
    ("object.shape", {"kind": "sphere", "radius": 1.0}, "allowed: 'box', 'disk'"),
    ("object.shape", {"kind": "box", "size": [1, 1, 1]}, "has 3 entries; at most 2 allowed"),
    ("arms.0.urdf", "x.urdf", "arms[0] (a1): an arm by its URDF belongs to the spatial spaces"),
    ("arms.0.links", [], "arms[0] (a1).links: has 0 entries; at least 1 needed"),
    (
        "arms.0.links",
        LINKS[:2],
        "arms[0] (a1): has 2 free joints (joint1, joint2); space 'planar' needs",
    ),
    ("arms.0.links.1.mass", 0.0, "arms[0] (a1).links[1].mass: 0.0 must be above zero"),
    ("arms.0.links.1.length", -1.0, "arms[0] (a1).links[1].length: -1.0 must be above zero"),
    (
        "arms.0.links.1.lenght",
        1.0,
        "arms[0] (a1).links[1].lenght: unknown key; did you mean 'length'?",
    ),
    ("arms.0.grasp", None, "arms[0] (a1).grasp: missing"),
    ("arms.0.grasp.rpy", [0, 0, 0], "arms[0] (a1).grasp.rpy: unknown key"),
    ("arms.0.start", [0, 0, INF], "arms[0] (a1).start[2]: inf must be finite"),
    ("object.inertia", None, "object.inertia: missing; space 'planar' needs"),
]


@pytest.mark.parametrize(("path", "value", "expected"), PLANAR, ids=lambda x: str(x)[:40])
def test_planar_faults(path: str, value: object, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        copose.check(parse(put(planar(2, 3, "planar"), path, value)))
    assert expected in str(caught.value)


def test_inertia_may_be_left_out_where_it_does_not_count() -> None:
    for cell in (two_pandas("spatial-linear"), planar()):
        parse(put(cell, "object.inertia", None))


def test_defaults_may_be_written_out() -> None:
    cell = two_pandas()
    cell["ellipsoid"] = {
        "resolution": "pseudoinverse",
        "torque_scaling": "unit",
        "load_distribution": "moore-penrose",
        "gravity": False,
    }
    cell["constraints"] = {"joint_margin": 0.0}
    cell["search"] = {"seed": 0}
    cell["description"] = "x"
    cell["object"]["rpy"] = [0, 0, 0]
    assert parse(cell).space.m == 6


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"format = ", "is not TOML: Invalid value (at end of document)"),
        (b"format = 1\nname = x\n", "(at line 2, column 8)"),
        (b"a = " + b"[" * 5000 + b"]" * 5000, "nested"),
        (b"a" + b".a" * 60 + b" = 1", "is nested more than 20 levels deep"),
        (b"name = '\xff\xfe'", "is not UTF-8 text (byte 8)"),
        (b"#" * 1_000_001, "is 1000001 bytes long; at most 1000000"),
        (b"x = " + b"9" * 5000, "is not TOML"),
        (b"", "format: missing"),
    ],
    ids=["broken", "line", "brackets", "dots", "utf8", "large", "huge-int", "empty"],
)
def test_files_that_are_no_problems(content: bytes, expected: str, tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load(file)
    assert expected in str(caught.value) and str(file) in str(caught.value)


def test_folders_and_missing_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder"):
        load(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        load(tmp_path / "nope.toml")
    with pytest.raises(InputError, match=r"no such file|cannot be read"):
        load("nul\0byte")


def test_messages_are_short_and_on_one_line() -> None:
    cell = planar()
    cell["object"]["x" * 5000 + "\n\x1b[31m"] = "y" * 10_000
    with pytest.raises(InputError) as caught:
        parse(cell)
    assert len(str(caught.value)) <= 600 and str(caught.value).isprintable()


def test_a_problem_cannot_be_changed() -> None:
    problem = parse(planar())
    with pytest.raises(ValueError, match="frozen"):
        problem.name = "x"  # type: ignore[misc]
    with pytest.raises(TypeError):
        problem.arms[0] = problem.arms[1]  # type: ignore[index]


def test_torque_limits_are_of_any_size() -> None:
    cell = two_pandas()
    cell["arms"][0]["torque_limits"] = [1e12, float("inf"), float("-inf"), 1.0, 1.0, 1.0, 1e-12]
    assert parse(cell).arms[0].torque_limits == (1e12, *[float("inf")] * 2, 1.0, 1.0, 1.0, 1e-12)
    cell["arms"][0]["torque_limits"][0] = float("nan")
    with pytest.raises(InputError, match="torque_limits"):
        parse(cell)
