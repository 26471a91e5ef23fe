"""Collisions: where solids are, how near they come, and which pairs count, against Pinocchio."""

from __future__ import annotations

import copy
import itertools
import math
import os
import re
import shutil
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import casadi as ca
import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

import cells
import copose
import reference
from copose.collision import (
    Bodies,
    Carrier,
    Placements,
    Primitive,
    Scene,
    Solid,
    configurations,
)
from copose.collision.carriers import carrier_poses, carriers_of
from copose.collision.distance.segments import Segments, segment_distances
from copose.collision.scene import possible_pairs
from copose.collision.shapes.meshes import Mesh
from copose.errors import InputError
from copose.mechanics.chain import Chain
from copose.poses import Pose
from copose.problem import Problem, parse
from copose.robots import Arm, finite_range, load_arms
from reference import example

ROBOTS = example("")
LIMIT = '<limit lower="-2" upper="2" effort="10" velocity="3"/>'
INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
)
# coal's GJK stops when a distance is known to 1e-6, from wherever it starts.
GJK = 5e-6


@dataclass(frozen=True)
class Setting:
    """A problem, read, with its scene."""

    table: dict
    problem: Problem
    arms: tuple[Arm, ...]
    scene: Scene

    @classmethod
    def of(cls, table: dict, source: Path | None = None) -> Setting:
        problem = parse(table, source=source)
        arms = load_arms(problem)
        return cls(table, problem, arms, Scene.of(problem, arms))

    @property
    def names(self) -> list[str]:
        return [solid.name for solid in self.scene.solids]

    @property
    def tested(self) -> set[frozenset[str]]:
        names = self.names
        return {frozenset((names[i], names[j])) for i, j in self.scene.pairs}

    @cached_property
    def bodies(self) -> Bodies:
        return self.scene.bodies(self.arms, self.problem.constraints.clearance)

    def x(self, q: list[np.ndarray]) -> np.ndarray:
        bases = [arm.base for arm in self.arms]
        return configurations(self.arms, bases, q, self.problem.object.pose)[0]

    def at(self, q: list[np.ndarray]) -> Placements:
        return self.bodies.placed(self.x(q)[None])[0]

    def exact(self, q: list[np.ndarray]) -> np.ndarray:
        return self.bodies.distances(self.at(q), self.bodies.every)

    def drawn(self, seed: int) -> list[np.ndarray]:
        rng = np.random.default_rng(seed)
        return [rng.uniform(*finite_range(arm.lower, arm.upper)) for arm in self.arms]


def with_collision(table: dict, **more: object) -> dict:
    table = copy.deepcopy(table)
    table["constraints"] = table.get("constraints", {}) | {"collision": True}
    return table | more


@pytest.fixture(scope="module")
def pandas() -> Setting:
    table = with_collision(cells.two_pandas())
    table["arms"][0]["base"] = {"position": [0.1, -0.05, 0.02], "rpy": [0.1, -0.2, 0.3]}
    table["arms"][0]["locked"] = {"panda_finger_joint1": 0.03}
    table["obstacles"] = [
        {"name": "rod", "position": [0.5, 0.5, 0.5], "rpy": [0.5, 1, 0],
         "shape": {"kind": "capsule", "radius": 0.03, "length": 0.6}},
        {"name": "post", "position": [0.5, -0.5, 0.3],
         "shape": {"kind": "cylinder", "radius": 0.05, "length": 0.6}},
        {"name": "shelf", "position": [0.5, 0, 1.1], "rpy": [0, 0.2, 0],
         "shape": {"kind": "box", "size": [0.5, 0.9, 0.04]}},
    ]  # fmt: skip
    return Setting.of(table)


@pytest.fixture(scope="module")
def baxter() -> Setting:
    table = with_collision(cells.tables("baxter-box"))
    for arm in table["arms"]:
        arm["base"] = {"position": [0.1, 0, 0.9], "rpy": [0, 0, 0.4]}
        arm["locked"] = {"head_pan": 0.7, "l_gripper_l_finger_joint": 0.01}
    table["object"]["position"] = [0.8, 0.3, 1.1]
    return Setting.of(table)


def truth(setting: Setting, q: list[np.ndarray]) -> dict[str, list[pin.GeometryObject]]:
    """Every shape at its place in the world, by the name of its solid, without copose."""
    shapes: dict[str, list[pin.GeometryObject]] = {}
    count = itertools.count()

    def add(name: str, geometry: object, place: pin.SE3) -> None:
        shape = pin.GeometryObject(f"shape{next(count)}", 0, 0, place, geometry)
        shapes.setdefault(name, []).append(shape)

    tables = setting.table["arms"]
    for i, table in enumerate(tables):
        file = str(example(table["urdf"].removeprefix("example-robot-data://")))
        model = pin.buildModelFromUrdf(file, mimic=True)
        # pin 4 warns where it is given folders, for it takes them for a geometry model first.
        os.environ["ROS_PACKAGE_PATH"] = str(ROBOTS.parents[1])
        geometry = pin.buildGeomFromUrdf(model, file, pin.GeometryType.COLLISION)
        position = pin.neutral(model)
        values = dict(zip(setting.arms[i].joint_names, q[i], strict=True)) | table.get("locked", {})
        for name, value in values.items():
            joint = model.joints[model.getJointId(name)]
            position[joint.idx_q : joint.idx_q + joint.nq] = (
                [math.cos(value), math.sin(value)] if joint.nq == 2 else [value]
            )
        data, placed = model.createData(), geometry.createData()
        pin.updateGeometryPlacements(model, data, geometry, placed, position)
        mine = {model.getJointId(name) for name in setting.arms[i].joint_names}
        others = [other for k, other in enumerate(tables) if k != i]
        one_robot = any(
            o["urdf"] == table["urdf"] and o.get("base") == table.get("base") for o in others
        )
        first = setting.arms[0 if one_robot else i].name
        theirs = {
            model.getJointId(name)
            for k, arm in enumerate(setting.arms)
            if one_robot and k != i
            for name in arm.joint_names
        }
        base = reference.pose(table.get("base", {}))
        for k, shape in enumerate(geometry.geometryObjects):
            above = set(model.supports[shape.parentJoint])
            link = model.frames[shape.parentFrame].name
            if above & theirs or (not above & mine and setting.arms[i].name != first):
                continue
            name = setting.arms[i].name if above & mine else first
            add(f"{name}/{link}", shape.geometry, base * placed.oMg[k])
    import coal

    kinds = {
        "box": lambda s: coal.Box(*s["size"]),
        "cylinder": lambda s: coal.Cylinder(s["radius"], s["length"]),
        "capsule": lambda s: coal.Capsule(s["radius"], s["length"]),
    }
    for name, table in [("object", setting.table["object"])] + [
        (obstacle["name"], obstacle) for obstacle in setting.table.get("obstacles", [])
    ]:
        add(name, kinds[table["shape"]["kind"]](table["shape"]), reference.pose(table))
    return shapes


def all_distances(setting: Setting, q: list[np.ndarray]) -> dict[frozenset[str], float]:
    """Pinocchio's distances of all tested pairs."""
    shapes = truth(setting, q)
    model, geometry = pin.Model(), pin.GeometryModel()
    number = {
        shape.name: geometry.addGeometryObject(shape) for some in shapes.values() for shape in some
    }
    owners = []
    for pair in setting.tested:
        a, b = sorted(pair)
        for s, t in itertools.product(shapes[a], shapes[b]):
            geometry.addCollisionPair(pin.CollisionPair(number[s.name], number[t.name]))
            owners.append(pair)
    data = geometry.createData()
    pin.computeDistances(model, model.createData(), geometry, data, np.zeros(0))
    found: dict[frozenset[str], float] = {}
    for pair, result in zip(owners, data.distanceResults, strict=True):
        found[pair] = min(found.get(pair, np.inf), result.min_distance)
    return found


@pytest.fixture(scope="module", params=["pandas", "baxter"])
def setting(request: pytest.FixtureRequest) -> Setting:
    return request.getfixturevalue(request.param)


def test_every_shape_is_a_solid(setting: Setting) -> None:
    shapes = truth(setting, setting.drawn(0))
    assert len(set(setting.names)) == len(setting.names)
    assert set(setting.names) == set(shapes)
    for solid in setting.scene.solids:
        assert len(solid.parts) == len(shapes[solid.name])


@pytest.mark.parametrize("seed", range(6))
def test_distances_are_pinocchios(setting: Setting, seed: int) -> None:
    """Where bodies are apart; Pinocchio knows no depth, nor what lies wholly within a mesh."""
    q = setting.drawn(seed)
    bodies, expected = setting.bodies, all_distances(setting, q)
    found = {frozenset(bodies.names(k)): d for k, d in enumerate(setting.exact(q))}
    for pair, wanted in expected.items():
        assert (
            found[pair] <= 0
            if wanted <= 0 or found[pair] <= 0
            else found[pair] == (pytest.approx(wanted, abs=GJK))
        )
    enclosed = {pair for pair in expected if found[pair] <= 0 < expected[pair]}
    nearest, hit = bodies.nearest(setting.x(q)), bodies.overlapping(setting.x(q))
    assert nearest is not None and nearest.distance == min(found.values())
    if min(expected.values()) > 0 and not enclosed:
        assert expected[frozenset(nearest.pair)] == pytest.approx(nearest.distance, abs=GJK)
        assert hit is None
    else:
        assert nearest.distance <= 0
        assert hit is not None and found[frozenset(hit)] <= 0


def test_some_of_these_postures_are_free_and_others_are_not(pandas: Setting) -> None:
    least = [min(all_distances(pandas, pandas.drawn(seed)).values()) for seed in range(6)]
    assert min(least) <= 0 < max(least)


@pytest.mark.parametrize("seed", range(6))
def test_bounds_are_never_larger_than_distances(setting: Setting, seed: int) -> None:
    q = setting.drawn(100 + seed)
    bodies, where, exact = setting.bodies, setting.at(q), setting.exact(q)
    hulls = bodies.hull_distances(where, bodies.every)
    assert np.all(bodies.bounds(where, bodies.every) <= hulls + 1e-9)
    assert np.all(hulls <= np.maximum(exact, 0) + 1e-9)


def test_what_keeps_clear_is_what_distances_say(setting: Setting) -> None:
    """Of single pairs, of each arm's own, of two arms' and of all, whatever was asked before."""
    bodies, rng = setting.bodies, np.random.default_rng(0)
    drawn = [setting.drawn(300 + k) for k in range(25)]
    x = np.array([setting.x(q) for q in drawn])
    near = np.array([setting.exact(q) < bodies.clearance for q in drawn])
    for pairs in (bodies.every, bodies.own(0), bodies.own(1), bodies.shared):
        clear = bodies.clear(x, pairs)
        np.testing.assert_array_equal(clear, ~near[:, pairs].any(axis=1))
        order = rng.permutation(len(x))
        np.testing.assert_array_equal(bodies.clear(x[order], pairs), clear[order])
    for row, mine in zip(x[:5], near[:5], strict=True):
        np.testing.assert_array_equal(bodies.too_near(row, bodies.every), mine)


def test_arms_that_are_far_apart_keep_clear(setting: Setting) -> None:
    drawn = [setting.drawn(600 + k) for k in range(12)]
    chosen, far, hit, least = combined(setting, drawn)
    assert 0 < far.sum() < len(far)
    assert np.all(least[far] >= setting.bodies.clearance)
    # Nothing is called near for the sake of balls that lie apart.
    q = [setting.x([drawn[i][0], drawn[j][1]]) for i, j in chosen]
    rough = setting.bodies.bounds(setting.bodies.placed(np.array(q)), setting.bodies.shared)
    np.testing.assert_array_equal(far, (rough >= setting.bodies.clearance).all(axis=1))
    assert not hit.any()


def combined(
    setting: Setting, drawn: list[list[np.ndarray]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """All combinations of two arms' postures; which are told to be clear, and which not, also where
    few are asked for; and the arms' least distances.
    """
    x = np.array([setting.x(q) for q in drawn])
    chosen = np.array(list(itertools.product(range(len(x)), repeat=2)))
    judge = setting.bodies.judge([x, x])
    clear, hit = judge(chosen)
    few = np.random.default_rng(0).permutation(len(chosen))[: len(chosen) // 10]
    for mine, every in zip(judge(chosen[few]), (clear, hit), strict=True):
        np.testing.assert_array_equal(mine, every[few])
    shared = setting.bodies.shared
    q = [[drawn[i][0], drawn[j][1]] for i, j in chosen]
    least = [setting.bodies.distances(setting.at(each), shared).min() for each in q]
    return chosen, clear, hit, np.array(least)


def test_normals_at_witnesses_are_slopes_of_distances(pandas: Setting) -> None:
    """n·(b − a) moved along with the carriers, against differences of distances."""
    bodies, seen = pandas.bodies, 0
    for seed in range(40):
        q = pandas.drawn(500 + seed)
        x = pandas.x(q)
        witnesses = [w for w in bodies.witnesses(x, 0.1) if w.distance > 1e-3]
        here = bodies.placed(x[None])[0]
        number = {carrier: k for k, carrier in enumerate(bodies.carriers)}
        step = np.random.default_rng(seed).normal(size=sum(map(len, q)))
        for w in witnesses[:3]:
            ends = []
            for h in (-1e-5, 1e-5):
                moved = np.split(np.concatenate(q) + h * step, [len(q[0])])
                there = pandas.at(moved)
                a, b = (there.rotations[number[c]] @ p + there.positions[number[c]]
                        for c, p in ((w.first, w.a), (w.second, w.b)))  # fmt: skip
                exact = bodies.distances(there, np.array([w.pair]))[0]
                ends.append((w.normal @ (b - a), exact))
            if bodies.distances(here, np.array([w.pair]))[0] < w.distance - 1e-9:
                continue
            rows, exact = np.diff(np.array(ends), axis=0)[0] / 2e-5
            assert w.distance == pytest.approx(np.mean([d for d, _ in ends]), abs=1e-6)
            seen += abs(rows - exact) < 1e-3 * (1 + abs(exact))
            seen -= abs(rows - exact) > 1e-2 * (1 + abs(exact))
    assert seen > 20


CHAINS = {
    "baxter from its root": {
        "urdf": "example-robot-data://baxter_description/urdf/baxter.urdf", "tip": "left_gripper",
    },
    "panda from a moved link": {
        "urdf": cells.PANDA, "root": "panda_link1", "tip": "panda_hand",
        "locked": {"panda_joint1": 0.7},
    },
    "tiago with its lift": {
        "urdf": "example-robot-data://tiago_description/robots/tiago_dual.urdf",
        "tip": "arm_left_7_link", "locked": {"arm_left_3_joint": 0.4},
    },
}  # fmt: skip


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
def test_frames_are_pinocchios(chain: dict) -> None:
    table = chain | {
        "name": "arm", "grasp": {"position": [0, 0, 0]},
        "base": {"position": [1, 2, 3], "rpy": [0.1, 0.2, 0.3]},
    }  # fmt: skip
    problem = parse(cells.two_pandas("spatial-linear") | {"arms": [table]})
    (arm,) = load_arms(problem)
    assert arm.joints[0].kind == ("prismatic" if "tiago" in chain["urdf"] else "revolute")
    truth = reference.UrdfArm(table, list(arm.joint_names))
    x = ca.SX.sym("q", arm.n)
    frames = Chain.of(arm, x).frames
    own = ca.Function("f", [x], [ca.horzcat(f.rotation, f.position) for f in frames])
    for seed in range(5):
        q = np.random.default_rng(seed).uniform(*finite_range(arm.lower, arm.upper))
        where = carrier_poses([arm], configurations([arm], [arm.base], [q], problem.object.pose))[0]
        data = truth.model.createData()
        pin.forwardKinematics(truth.model, data, truth.configuration(q))
        numbers = {carrier: k for k, carrier in enumerate(carriers_of([arm]))}
        for j in range(arm.n):
            k = numbers[Carrier("joint", 0, j)]
            there = truth.origin * data.oMi[j + 1]
            np.testing.assert_allclose(where.rotations[k], there.rotation, atol=1e-12)
            np.testing.assert_allclose(where.positions[k], there.translation, atol=1e-12)
            symbolic = np.array(own(q)[j])
            np.testing.assert_allclose(
                where.rotations[k], arm.base.rotation @ symbolic[:, :3], atol=1e-12
            )
        for carrier, pose in [
            (Carrier("world"), Pose.from_rpy()),
            (Carrier("object"), problem.object.pose),
            (Carrier("root", 0), arm.base),
        ]:
            k = numbers[carrier]
            np.testing.assert_allclose(where.rotations[k], pose.rotation, atol=1e-15)
            np.testing.assert_array_equal(where.positions[k], pose.position)


def test_other_bases_and_objects_move_what_hangs_on_them(pandas: Setting) -> None:
    moved = Pose.from_rpy((0.3, 0.1, 0.2), (0.1, 0.5, -0.4))
    q = pandas.drawn(3)
    here = pandas.at(q)
    bases = [moved @ arm.base for arm in pandas.arms]
    x = configurations(pandas.arms, bases, q, moved @ pandas.problem.object.pose)
    there = carrier_poses(pandas.arms, x)[0]
    for k in range(1, len(here.positions)):
        np.testing.assert_allclose(
            there.positions[k], moved.rotation @ here.positions[k] + moved.position, atol=1e-12
        )
        np.testing.assert_allclose(
            there.rotations[k], moved.rotation @ here.rotations[k], atol=1e-12
        )


# Hulls


def outline(solid: Solid) -> np.ndarray:
    """Points of a solid's surface, in its carrier's frame."""
    rng = np.random.default_rng(1)
    found = []
    for part in solid.parts:
        shape = part.shape
        if isinstance(shape, Mesh):
            corners = shape.vertices[shape.triangles[rng.integers(len(shape.triangles), size=2000)]]
            share = rng.dirichlet(np.ones(3), size=2000)
            points = np.vstack([shape.vertices, np.einsum("kij,ki->kj", corners, share)])
        else:
            turn = rng.uniform(0, 2 * np.pi, 4000)
            rim = np.column_stack([np.cos(turn), np.sin(turn), rng.choice([-1, 1], 4000)])
            if shape.kind == "box":
                points = rng.uniform(-1, 1, size=(4000, 3))
                side = rng.integers(3, size=4000)
                points[np.arange(4000), side] = rng.choice([-1, 1], 4000)
                points *= np.array((*shape.size, 0.0)[:3]) / 2
            elif shape.kind == "cylinder":
                points = rim * np.array([shape.size[0], shape.size[0], shape.size[1] / 2])
            else:
                points = rng.normal(size=(4000, 3))
                if shape.flat:
                    points[:, 2] = 0
                points *= shape.size[0] / np.linalg.norm(points, axis=1)[:, None]
                if shape.kind == "capsule":
                    points[:, 2] += np.sign(points[:, 2]) * shape.size[1] / 2
        pose = solid.placement @ part.placement
        found.append(points @ pose.rotation.T + pose.position)
    return np.vstack(found)


def test_hulls_enclose_solids(pandas: Setting, baxter: Setting) -> None:
    """And no point of a hull is farther from what it encloses than it says."""
    for each in (pandas, baxter, planar_cell()):
        for solid in each.scene.solids:
            points, hulls = outline(solid), []
            for part in solid.parts:
                corners, beyond = part.shape.hull
                pose = solid.placement @ part.placement
                hulls.append((corners @ pose.rotation.T + pose.position, beyond))
            # In random directions a solid reaches no farther than one of its hulls.
            for d in np.random.default_rng(0).normal(size=(20, 3)):
                d /= np.linalg.norm(d)
                if solid.parts[0].shape.__class__ is Primitive and solid.parts[0].shape.flat:
                    d[2] = 0.0
                most = max((corners @ d).max() + beyond * np.linalg.norm(d)
                           for corners, beyond in hulls)  # fmt: skip
                assert (points @ d).max() <= most + 1e-9, solid.name


def test_the_prism_round_a_cylinder_contains_it() -> None:
    corners, beyond = Primitive("cylinder", (0.2, 0.6)).hull
    assert beyond == 0
    faces = ConvexHull(corners).equations
    turn = np.linspace(0, 2 * np.pi, 1000)
    for z in (-0.3, 0.3):
        rim = np.column_stack([0.2 * np.cos(turn), 0.2 * np.sin(turn), np.full(1000, z)])
        assert np.all(rim @ faces[:, :3].T + faces[:, 3] <= 1e-12)
    assert np.linalg.norm(corners[:, :2], axis=1).max() < 0.2 * 1.01


# Which pairs


def link(name: str, shapes: str = "", *, mass: bool = True) -> str:
    return f'<link name="{name}">{INERTIAL if mass else ""}{shapes}</link>'


def collision(geometry: str, xyz: str = "0 0 0", tag: str = "collision") -> str:
    return f'<{tag}><origin xyz="{xyz}"/><geometry>{geometry}</geometry></{tag}>'


def joint(parent: str, child: str, kind: str, xyz: str, axis: str = "0 1 0") -> str:
    return (
        f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>{LIMIT}</joint>'
    )


AXES = ["0 0 1", "0 1 0", "1 0 0", "0 1 0", "0 0 1", "0 1 0"]


def torso(sides: tuple[str, ...] = ("l", "r")) -> str:
    """A torso with a head on a joint, and arms of six joints whose links 1 and 3 are one place."""
    ball = collision('<sphere radius="0.04"/>')
    parts = [
        link("pedestal", collision('<box size="0.2 0.2 0.1"/>', "0 0 -0.6")),
        link("trunk", collision('<cylinder radius="0.1" length="0.5"/>')),
        joint("pedestal", "trunk", "fixed", "0 0 0"),
        link("head", collision('<sphere radius="0.1"/>')),
        joint("trunk", "head", "revolute", "0 0 0.4"),
    ]
    for side in sides:
        out = 1 if side == "l" else -1
        parts += [link(f"{side}mount", mass=False),
                  joint("trunk", f"{side}mount", "fixed", f"0 {0.12 * out} 0.2")]  # fmt: skip
        above = f"{side}mount"
        for i, axis in enumerate(AXES):
            name = f"{side}{i}"
            # Joints 2 and 3 turn about the same point, so links 1 and 3 always overlap.
            xyz = "0 0 0" if i in (2, 3) else f"0 {0.12 * out} 0"
            parts += [link(name, ball), joint(above, name, "revolute", xyz, axis)]
            above = name
        parts += [
            link(f"{side}hand", collision('<box size="0.05 0.05 0.05"/>')),
            joint(above, f"{side}hand", "fixed", f"0 {0.06 * out} 0"),
            link(f"{side}finger", collision('<box size="0.01 0.02 0.01"/>')),
            joint(f"{side}hand", f"{side}finger", "prismatic", f"0 {0.04 * out} 0"),
        ]
    return f'<robot name="torso">{"".join(parts)}</robot>'


def torso_cell(folder: Path, text: str | None = None, **more: object) -> Setting:
    (folder / "torso.urdf").write_text(torso() if text is None else text)
    arm = {"urdf": "torso.urdf", "grasp": {"position": [0, 0, 0]}}
    table = {
        "format": 1, "name": "t", "task": {"space": "spatial"},
        "object": {"mass": 1, "inertia": [0.01] * 3, "position": [0.6, 0, 0.2],
                   "shape": {"kind": "sphere", "radius": 0.05}},
        "arms": [arm | {"name": "left", "tip": "lhand"}, arm | {"name": "right", "tip": "rhand"}],
        "obstacles": [
            {"name": "table", "position": [0, 0, -0.7],
             "shape": {"kind": "box", "size": [1, 1, 0.12]}},
            {"name": "lamp", "position": [0.6, 0, 0.2],
             "shape": {"kind": "sphere", "radius": 0.03}},
        ],
    }  # fmt: skip
    return Setting.of(with_collision(table | more), folder / "p.toml")


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Setting:
    return torso_cell(tmp_path_factory.mktemp("torso"))


def test_two_arms_of_one_robot_share_its_static_links(robot: Setting) -> None:
    arms = [
        f"{arm}/{arm[0]}{i}" for arm in ("left", "right") for i in (*range(6), "hand", "finger")
    ]
    static = ["left/pedestal", "left/trunk", "left/head"]
    assert sorted(robot.names) == sorted([*arms, *static, "object", "table", "lamp"])
    carriers = {solid.name: solid.carrier for solid in robot.scene.solids}
    assert all(carriers[name] == Carrier("root", 0) for name in static)
    assert carriers["right/r3"] == Carrier("joint", 1, 3)
    assert carriers["right/rfinger"] == carriers["right/rhand"] == Carrier("joint", 1, 5)
    assert carriers["object"] == Carrier("object")
    assert carriers["lamp"] == Carrier("world")


@pytest.mark.parametrize(
    ("a", "b", "tested"),
    [
        ("left/l0", "left/l1", False),  # neighbours
        ("left/l0", "left/l2", True),
        ("left/l1", "left/l2", False),
        ("left/l1", "left/l3", False),  # always near: at one place
        ("left/l2", "left/l4", True),
        ("left/l5", "left/lhand", False),  # one body
        ("left/l4", "left/lhand", False),
        ("left/l3", "left/lhand", True),
        ("left/lhand", "left/lfinger", False),
        ("left/l0", "left/trunk", False),  # what the arm is mounted on
        ("left/l0", "left/pedestal", False),  # one body with it
        ("left/l0", "left/head", True),  # on a joint of its own
        ("left/l1", "left/trunk", True),
        ("left/l3", "left/head", True),
        ("right/r0", "left/trunk", False),
        ("right/r1", "left/trunk", True),
        ("left/l0", "right/r0", True),  # arm and arm
        ("left/l5", "right/rfinger", True),
        ("left/lhand", "object", False),  # what holds the object
        ("left/lfinger", "object", False),
        ("left/l5", "object", False),
        ("left/l4", "object", True),
        ("left/trunk", "object", True),
        ("left/head", "object", True),
        ("lamp", "object", True),  # though they always overlap
        ("table", "object", True),
        ("table", "lamp", False),  # both static
        ("table", "left/pedestal", False),
        ("left/trunk", "left/head", False),
        ("left/trunk", "left/pedestal", False),
        ("table", "left/l0", True),
        ("lamp", "right/rfinger", True),
    ],
)
def test_tested_pairs(robot: Setting, a: str, b: str, tested: bool) -> None:
    assert {a, b} <= set(robot.names)
    assert (frozenset((a, b)) in robot.tested) == tested


def test_only_what_is_always_near_is_left_out(robot: Setting, baxter: Setting) -> None:
    lone = {frozenset((f"{arm}/{arm[0]}1", f"{arm}/{arm[0]}3")) for arm in ("left", "right")}
    for cell, mounts in [
        (robot, {(i, f"left/{name}") for i in (0, 1) for name in ("trunk", "pedestal")}),
        (baxter, {(i, f"left/{name}") for i in (0, 1) for name in
                  ("torso", "pedestal", "sonar_ring", "collision_head_link_1",
                   "collision_head_link_2")}),
    ]:  # fmt: skip
        names = cell.names
        possible = {
            frozenset((names[i], names[j]))
            for i, j in possible_pairs(cell.scene.solids, cell.arms, mounts)
        }
        assert cell.tested <= possible
        if cell is robot:
            assert possible - cell.tested == lone
        shapes = [truth(cell, cell.drawn(900 + s)) for s in range(10)] if cell is baxter else []
        for pair in possible - cell.tested:
            a, b = sorted(pair)
            for some in shapes:
                gaps = [distance_of(s, t) for s in some[a] for t in some[b]]
                assert min(gaps) < 0.01


def distance_of(s: pin.GeometryObject, t: pin.GeometryObject) -> float:
    model, geometry = pin.Model(), pin.GeometryModel()
    numbers = geometry.addGeometryObject(s), geometry.addGeometryObject(t)
    geometry.addCollisionPair(pin.CollisionPair(*numbers))
    data = geometry.createData()
    pin.computeDistances(model, model.createData(), geometry, data, np.zeros(0))
    return float(data.distanceResults[0].min_distance)


def test_shoulders_of_baxter_may_touch_the_torso_and_nothing_beyond(baxter: Setting) -> None:
    for arm in ("left", "right"):
        assert frozenset(("left/torso", f"{arm}/{arm}_upper_shoulder")) not in baxter.tested
        assert frozenset(("left/head", f"{arm}/{arm}_upper_shoulder")) in baxter.tested
        for beyond in ("lower_shoulder", "upper_elbow", "lower_forearm", "hand_link"):
            for static in ("torso", "head", "pedestal", "collision_head_link_1"):
                assert frozenset((f"left/{static}", f"{arm}/{arm}_{beyond}")) in baxter.tested


def test_robots_on_two_bases_are_two(tmp_path: Path, pandas: Setting) -> None:
    assert frozenset(("left/panda_link0", "right/panda_link3")) in pandas.tested
    assert frozenset(("left/panda_link0", "right/panda_link0")) not in pandas.tested
    assert frozenset(("left/panda_link0", "object")) in pandas.tested
    assert frozenset(("left/panda_link0", "left/panda_link1")) not in pandas.tested
    assert frozenset(("left/panda_link0", "left/panda_link2")) in pandas.tested
    assert frozenset(("rod", "left/panda_link0")) not in pandas.tested
    assert frozenset(("rod", "object")) in pandas.tested
    table = torso_cell(tmp_path).table
    table["arms"][1]["base"] = {"position": [0, 3, 0]}
    two = Setting.of(table, tmp_path / "p.toml")
    assert {"left/trunk", "right/trunk"} <= set(two.names)
    # The other arm of the same URDF is no arm of this robot: it stands still.
    static = {solid.name for solid in two.scene.solids if solid.carrier.static}
    assert {"left/r3", "right/l3"} <= static
    assert frozenset(("left/l3", "right/trunk")) in two.tested


def test_a_clearance_of_zero_still_leaves_out_what_always_overlaps(tmp_path: Path) -> None:
    cube(tmp_path / "cube.stl", 0.06)
    for text in (torso(), torso().replace('<sphere radius="0.04"/>', mesh("cube.stl"))):
        cell = torso_cell(tmp_path, text, constraints={"clearance": 0.0})
        assert cell.scene.notes == ()
        assert frozenset(("left/l1", "left/l3")) not in cell.tested
        assert frozenset(("left/l2", "left/l4")) in cell.tested


def test_bases_that_may_be_moved_are_moved(tmp_path: Path) -> None:
    table = torso_cell(tmp_path).table
    beside = {
        "name": "wall",
        "position": [0, 0.24, 0.2],
        "shape": {"kind": "sphere", "radius": 0.1},
    }
    still = Setting.of(table | {"obstacles": [beside]}, tmp_path / "p.toml")
    pair = frozenset(("wall", "left/l0"))
    assert pair not in still.tested
    table = table | {"arms": [table["arms"][0] | {"freedom": {"base": {"x": [-1, 1]}}}]}
    free = Setting.of(table | {"obstacles": [beside]}, tmp_path / "p.toml")
    assert pair in free.tested


def test_the_same_scene_again(pandas: Setting) -> None:
    again = Scene.of(pandas.problem, pandas.arms)
    np.testing.assert_array_equal(again.pairs, pandas.scene.pairs)


def test_no_pairs_no_distance(tmp_path: Path) -> None:
    table = cells.planar(1, 2)
    cell = Setting.of(with_collision(table))
    assert cell.bodies.nearest(cell.x([np.zeros(2)])) is None
    assert cell.bodies.overlapping(cell.x([np.zeros(2)])) is None
    assert cell.bodies.clear(cell.x([np.zeros(2)])[None]).all()
    (note,) = cell.scene.notes
    assert note.startswith("the object has no shape: nothing is tested against it")


# Meshes


def cube(file: Path, size: float) -> None:
    """A cube about the origin as binary STL."""
    corner = np.array(list(itertools.product((-1, 1), repeat=3))) * size / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    data = b"\0" * 80 + struct.pack("<I", 12)
    for a, b, c, d in quads:
        for face in ((a, b, c), (a, c, d)):
            data += struct.pack("<12fH", 0, 0, 0, *corner[list(face)].ravel(), 0)
    file.write_bytes(data)


def chain(shapes: dict[int, str], base: str = "") -> str:
    """Six links in a row, with shapes."""
    parts = [link("base", base, mass=False)]
    for i, axis in enumerate(AXES):
        parts += [
            link(f"l{i}", shapes.get(i, "")),
            joint("base" if i == 0 else f"l{i - 1}", f"l{i}", "revolute", "0.2 0 0", axis),
        ]
    return f'<robot name="chain">{"".join(parts)}</robot>'


def cell_table(urdf: str) -> dict:
    return {
        "format": 1, "name": "c", "task": {"space": "spatial"},
        "object": {"mass": 1, "inertia": [0.01] * 3, "position": [0.6, 0.9, 0],
                   "shape": {"kind": "sphere", "radius": 0.05}},
        "arms": [{"name": "arm", "urdf": urdf, "tip": "l5", "grasp": {"position": [0, 0, 0]}}],
    }  # fmt: skip


def chain_cell(folder: Path, text: str, **more: object) -> Setting:
    (folder / "chain.urdf").write_text(text)
    return Setting.of(with_collision(cell_table("chain.urdf") | more), folder / "p.toml")


def mesh(name: str, scale: str = "1 1 1") -> str:
    return f'<mesh filename="{name}" scale="{scale}"/>'


def test_shapes_that_cannot_be_read_are_refused_by_their_links(tmp_path: Path) -> None:
    ball = '<sphere radius="0.03"/>'
    cube(tmp_path / "good.stl", 0.06)
    (tmp_path / "bad.stl").write_text("solid x\n facet rubbish")
    fine = {
        0: collision(mesh("good.stl")),
        1: collision(mesh("gone.stl")) + collision(ball, tag="visual"),
        4: collision(ball, "0 0 0.1"),
        # A point is no shape: many a frame has one.
        5: collision('<sphere radius="0"/>') + collision(ball),
    }
    broken = {
        2: collision(mesh("l2.stl")),
        3: collision(mesh("bad.stl")) + collision(mesh("bad.stl"), tag="visual"),
        4: collision(mesh("bad.stl")) + collision(ball),
    }
    with pytest.raises(InputError) as error:
        chain_cell(tmp_path, chain(fine | broken, collision('<box size="0 0.1 0.1"/>')))
    assert error.value.key == "arms[0] (arm).urdf"
    assert error.value.file == tmp_path / "p.toml"
    assert str(error.value).endswith(
        "collision needs shapes of chain.urdf that cannot be read: "
        "link 'base': a box has no extent: [0.0, 0.1, 0.1]; "
        "link 'l2': mesh 'l2.stl' was not found; "
        "link 'l3': bad.stl is no mesh that can be read; "
        "link 'l4': bad.stl is no mesh that can be read"
    )
    away = {i: collision(mesh("package://nowhere/m.stl")) for i in (2, 3)}
    with pytest.raises(InputError) as error:
        chain_cell(tmp_path, chain(fine | away))
    assert "link 'l2': mesh 'package://nowhere/m.stl' was not found (and 1 more); " in str(
        error.value
    )
    assert "'nowhere' was not found; name its folder by packages = {" in str(error.value)
    cell = chain_cell(tmp_path, chain(fine))
    assert cell.names == ["arm/l0", "arm/l1", "arm/l4", "arm/l5", "object"]
    shapes = {solid.name: [part.shape for part in solid.parts] for solid in cell.scene.solids}
    assert shapes["arm/l1"] == shapes["arm/l5"] == [Primitive("sphere", (0.03,))]
    assert cell.scene.notes == (
        "chain.urdf: links tested by visual geometry, for no collision geometry can be read: "
        "l1 (mesh 'gone.stl' was not found)",
    )
    # Where no collision is asked for, nothing is needed of them.
    still = parse(cell.table | {"constraints": {}}, tmp_path / "p.toml")
    (tmp_path / "chain.urdf").write_text(chain(broken))
    assert not any("chain.urdf" in note for note in copose.check(still).notes)


def test_a_robot_without_collision_elements_is_tested_by_its_visuals(tmp_path: Path) -> None:
    cell = chain_cell(tmp_path, chain({2: collision('<sphere radius="0.03"/>', tag="visual")}))
    assert cell.names == ["arm/l2", "object"]
    assert cell.scene.notes == (
        "chain.urdf has no collision geometry; its visual geometry is tested",
    )
    # One collision element is enough for visuals to be but looks.
    both = collision('<sphere radius="0.03"/>', tag="visual")
    cell = chain_cell(tmp_path, chain({2: both, 3: collision('<sphere radius="0.03"/>')}))
    assert cell.names == ["arm/l3", "object"]
    assert cell.scene.notes == ()


@pytest.mark.parametrize(
    ("shapes", "base", "why"),
    [
        ({}, "", "chain.urdf has no shape"),
        ({}, collision('<box size="1 1 1"/>'), "chain.urdf has no shape"),
        ({3: collision(mesh("gone.stl"))}, "", "link 'l3': mesh 'gone.stl' was not found"),
    ],
)
def test_an_arm_without_geometry_is_refused(
    tmp_path: Path, shapes: dict[int, str], base: str, why: str
) -> None:
    with pytest.raises(InputError) as error:
        chain_cell(tmp_path, chain(shapes, base))
    assert error.value.key == "arms[0] (arm).urdf"
    assert error.value.file == tmp_path / "p.toml"
    assert why in str(error.value)


def collada(file: Path, edges: tuple[float, float, float], asset: str, node: str = "") -> None:
    """A box from the origin, in the file's units."""
    corners = np.array(list(itertools.product((0, 1), repeat=3))) * edges
    points = " ".join(map(str, corners.ravel()))
    faces = "0 1 3 0 3 2 4 6 7 4 7 5 0 4 5 0 5 1 2 3 7 2 7 6 0 2 6 0 6 4 1 5 7 1 7 3"
    file.write_text(
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f'{asset}<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" '
        f'count="24">{points}</float_array><technique_common><accessor source="#a" count="8" '
        'stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" '
        'type="float"/></accessor></technique_common></source><vertices id="v"><input '
        'semantic="POSITION" source="#p"/></vertices><triangles count="12"><input '
        f'semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles></mesh></geometry>'
        '</library_geometries><library_visual_scenes><visual_scene id="s"><node id="n">'
        f'{node}<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )


@pytest.mark.parametrize(
    ("asset", "metres"),
    [
        ('<asset><unit name="mm" meter="0.001"/><up_axis>{}</up_axis></asset>', 0.001),
        ('<asset><contributor/><unit meter="0.0254"/><up_axis>{}</up_axis></asset>', 0.0254),
        ('<asset><unit name="m" meter="1"/><up_axis>{}</up_axis></asset>', 1.0),
        ("<asset><up_axis>{}</up_axis></asset>", 1.0),
        ("", 1.0),
    ],
)
def test_meshes_have_the_unit_that_they_declare(tmp_path: Path, asset: str, metres: float) -> None:
    """As in RViz and Gazebo: the unit counts, once; the axis that points up does not."""
    edges = np.array([0.1, 0.2, 0.3]) / metres
    for up in ("X_UP", "Y_UP", "Z_UP"):
        file = tmp_path / "m.dae"
        # The place of a node in its scene is in the file's unit too.
        collada(file, tuple(edges), asset.format(up), f"<translate>{edges[0]} 0 0</translate>")
        cell = chain_cell(tmp_path, chain({2: collision(mesh("m.dae", "1 2 1"))}))
        (part,) = next(s for s in cell.scene.solids if s.name == "arm/l2").parts
        assert isinstance(part.shape, Mesh)
        np.testing.assert_allclose(part.shape.extent, [[0.1, 0, 0], [0.2, 0.4, 0.3]], atol=1e-7)
        assert cell.scene.notes == ()


def test_a_unit_that_is_none_is_refused(tmp_path: Path) -> None:
    for unit in ("0", "-1", "nan", "x"):
        collada(tmp_path / "m.dae", (1, 1, 1), f'<asset><unit meter="{unit}"/></asset>')
        with pytest.raises(InputError, match=r"link 'l2': the unit of m\.dae"):
            chain_cell(tmp_path, chain({2: collision(mesh("m.dae"))}))


def test_what_is_larger_than_robots_is_told(tmp_path: Path) -> None:
    cube(tmp_path / "m.stl", 60.0)
    shapes = {
        1: collision('<box size="0.1 9.9 0.1"/>'),
        2: collision(mesh("m.stl")),
        3: collision('<cylinder radius="0.1" length="12"/>', "0 0 3"),
        4: collision('<sphere radius="7"/>'),
    }
    text = chain(shapes, collision(mesh("gone.stl")))
    told = "chain.urdf: links larger than any robot's: l2 (60 m), l3 (12 m), l4 (14 m)"
    (tmp_path / "chain.urdf").write_text(text)
    cell = cell_table("chain.urdf")
    # Nothing need be readable where no collision is asked for.
    assert copose.check(parse(cell, tmp_path / "p.toml")).notes[-1] == told
    (tmp_path / "chain.urdf").write_text(chain(shapes))
    assert told in copose.check(parse(with_collision(cell), tmp_path / "p.toml")).notes


def test_scale_and_places_of_meshes(tmp_path: Path) -> None:
    (tmp_path / "pack/meshes").mkdir(parents=True)
    (tmp_path / "pack/urdf").mkdir()
    cube(tmp_path / "pack/meshes/cube.stl", 100)
    for name in ("package://pack/meshes/cube.stl", "../meshes/cube.stl",
                 f"file://{tmp_path}/pack/meshes/cube.stl"):  # fmt: skip
        shape = collision(mesh(name, "0.001 0.002 0.003"), "0 0 0.5")
        ball = collision('<sphere radius="0.03"/>')
        cell = chain_cell(tmp_path / "pack/urdf", chain({1: shape, 5: ball}))
        assert cell.scene.notes == ()
        points = outline(cell.scene.solids[0])
        np.testing.assert_allclose(np.ptp(points, axis=0), [0.1, 0.2, 0.3], atol=1e-6)
        np.testing.assert_allclose(points.max(axis=0), [0.05, 0.1, 0.65], atol=1e-6)
    shutil.rmtree(tmp_path / "pack/meshes")


def test_what_lies_wholly_within_a_mesh_overlaps_it(tmp_path: Path) -> None:
    cube(tmp_path / "cube.stl", 0.4)
    shapes = {5: collision(mesh("cube.stl")), 1: collision('<sphere radius="0.03"/>')}
    lamp = {"name": "lamp", "shape": {"kind": "sphere", "radius": 0.02}}
    for x, depth in ((1.2, 0.22), (1.3, 0.12), (1.37, 0.05)):
        cell = chain_cell(tmp_path, chain(shapes), obstacles=[lamp | {"position": [x, 0, 0]}])
        x = cell.x([np.zeros(6)])
        nearest = cell.bodies.nearest(x)
        assert nearest is not None
        assert nearest.pair == ("arm/l5", "lamp")
        assert nearest.distance == pytest.approx(-depth, abs=1e-6)
        assert cell.bodies.overlapping(x) == ("arm/l5", "lamp")
        assert not cell.bodies.clear(x[None]).any()
    cell = chain_cell(tmp_path, chain(shapes), obstacles=[lamp | {"position": [1.45, 0, 0]}])
    nearest = cell.bodies.nearest(cell.x([np.zeros(6)]))
    assert nearest is not None
    assert nearest.distance == pytest.approx(0.03, abs=1e-6)


def test_a_mesh_may_have_a_flat_face_of_many_corners(tmp_path: Path) -> None:
    turns, up = np.linspace(0, 2 * np.pi, 400, endpoint=False), np.array([0, 0, 0.1])
    ring = 0.05 * np.column_stack([np.cos(turns), np.sin(turns), np.zeros(400)])
    low, high = ring - up, ring + up
    side = np.roll(np.arange(400), -1)
    triangles = np.vstack([
        np.stack([low, low[side], high[side]], axis=1),
        np.stack([low, high[side], high], axis=1),
        np.stack([np.tile(low[0], (398, 1)), low[2:], low[1:-1]], axis=1),
        np.stack([np.tile(high[0], (398, 1)), high[1:-1], high[2:]], axis=1),
    ])  # fmt: skip
    records = np.zeros(len(triangles), dtype="(3,)<f4, (3,3)<f4, <u2")
    records["f1"] = triangles
    head = b"\0" * 80 + struct.pack("<I", len(records))
    (tmp_path / "rod.stl").write_bytes(head + records.tobytes())
    shapes = {5: collision(mesh("rod.stl")), 1: collision('<sphere radius="0.03"/>')}
    lamp = {"name": "lamp", "shape": {"kind": "sphere", "radius": 0.02}}
    for beyond in (0.03, 0.3):
        place = [1.2, 0, 0.1 + 0.02 + beyond]
        cell = chain_cell(tmp_path, chain(shapes), obstacles=[lamp | {"position": place}])
        nearest = cell.bodies.nearest(cell.x([np.zeros(6)]))
        assert nearest is not None
        assert nearest.distance == pytest.approx(beyond, abs=1e-6)


def test_pairs_that_are_ignored(tmp_path: Path) -> None:
    """By the problem or an SRDF of the URDF's name beside it; what both do not name counts."""
    text = chain({i: collision('<sphere radius="0.03"/>') for i in range(6)})

    def pairs(*ignored: list[str]) -> tuple[set[frozenset[str]], tuple[str, ...]]:
        arm = cell_table("chain.urdf")["arms"][0] | {"ignore_collisions": list(ignored)}
        cell = chain_cell(tmp_path, text, arms=[arm])
        return cell.tested, cell.scene.notes

    def links(*names: str) -> frozenset[str]:
        return frozenset(f"arm/{name}" for name in names)

    every, notes = pairs()
    assert {links("l0", "l2"), links("l1", "l3"), links("l1", "l5")} <= every and notes == ()
    fewer, notes = pairs(["l2", "l0"], ["l0", "l1"])
    assert every - fewer == {links("l0", "l2")}
    assert notes == (
        "collisions of 2 pairs of links are ignored by ignore_collisions of arm 'arm'",
    )
    with pytest.raises(InputError, match=r"chain\.urdf has no link 'l9'") as error:
        pairs(["l9", "l0"])
    assert error.value.key == "arms[0] (arm).ignore_collisions"
    srdf = tmp_path / "chain.srdf"
    disabled = '<disable_collisions link1="l1" link2="l3" reason="Never"/>'
    srdf.write_text(f'<robot name="chain">{disabled}<disable_collisions link1="gone"/></robot>')
    fewer, notes = pairs(["l0", "l2"])
    assert every - fewer == {links("l0", "l2"), links("l1", "l3")}
    assert notes[1] == "collisions of 2 pairs of links are ignored by chain.srdf"
    srdf.write_text("<robot")
    same, notes = pairs()
    assert same == every
    assert re.match(r"chain\.srdf cannot be read, and disables no pair of links: ", notes[0])


# The plane


def planar_cell(space: str = "planar", **thing: object) -> Setting:
    shape = {"kind": "box", "size": [0.2, 0.1]}
    table = cells.planar(2, 3, space)
    table["object"] |= {"shape": shape, "angle": 0.3} | thing
    table["arms"][0]["links"][1]["radius"] = 0.05
    table["obstacles"] = [
        {"name": "wall", "position": [0.2, -0.6], "angle": 0.4,
         "shape": {"kind": "box", "size": [0.9, 0.1]}},
        {"name": "post", "position": [-0.3, 0.6], "shape": {"kind": "disk", "radius": 0.07}},
    ]  # fmt: skip
    return Setting.of(with_collision(table))


def gap_2d(a: np.ndarray, b: np.ndarray) -> float:
    """Distance of two convex polygons' edges in the plane, which do not cross: ends to edges."""

    def to_edge(p: np.ndarray, u: np.ndarray, v: np.ndarray) -> float:
        t = np.clip((p - u) @ (v - u) / max((v - u) @ (v - u), 1e-300), 0, 1)
        return float(np.linalg.norm(u + t * (v - u) - p))

    def crossing(u: np.ndarray, v: np.ndarray, x: np.ndarray, y: np.ndarray) -> bool:
        def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> float:
            return float(np.sign((q - p)[0] * (r - p)[1] - (q - p)[1] * (r - p)[0]))

        return side(u, v, x) * side(u, v, y) < 0 and side(x, y, u) * side(x, y, v) < 0

    def edges(p: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        return [(p[i], p[(i + 1) % len(p)]) for i in range(len(p))]

    if any(crossing(*e, *f) for e in edges(a) for f in edges(b)):
        return 0.0
    ends = [to_edge(p, *e) for p in a for e in edges(b)] + [
        to_edge(p, *e) for p in b for e in edges(a)
    ]
    return min(ends)


@pytest.mark.parametrize("thing", [{}, {"shape": {"kind": "disk", "radius": 0.08}}])
@pytest.mark.parametrize("seed", range(8))
def test_planar_distances(thing: dict, seed: int) -> None:
    cell = planar_cell(**thing)
    q = cell.drawn(seed)
    outlines: dict[str, tuple[np.ndarray, float]] = {}
    for table, angles in zip(cell.table["arms"], q, strict=True):
        point = np.array(table["base"]["position"], dtype=float)
        turn = np.cumsum(angles) + table["base"].get("angle", 0.0)
        for i, (row, a) in enumerate(zip(table["links"], turn, strict=True)):
            end = point + row["length"] * np.array([math.cos(a), math.sin(a)])
            outlines[f"{table['name']}/link{i + 1}"] = (
                np.array([point, end]),
                row.get("radius", 0.03),
            )
            point = end
    for name, table in [("object", cell.table["object"])] + [
        (each["name"], each) for each in cell.table["obstacles"]
    ]:
        shape, a = table["shape"], table.get("angle", 0.0)
        if shape["kind"] == "disk":
            outlines[name] = np.array([table["position"]], dtype=float), shape["radius"]
        else:
            R = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
            corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array(shape["size"]) / 2
            outlines[name] = corners @ R.T + table["position"], 0.0
    assert set(outlines) == set(cell.names)
    exact, least = cell.exact(q), np.inf
    for k, (i, j) in enumerate(cell.scene.pairs):
        (a, r), (b, s) = (outlines[cell.names[n]] for n in (i, j))
        wanted = gap_2d(a, b) - r - s
        found = exact[k]
        if wanted > 0:
            assert found == pytest.approx(wanted, abs=1e-5)
        else:
            assert found <= 1e-9
        least = min(least, wanted)
    nearest = cell.bodies.nearest(cell.x(q))
    assert nearest is not None
    assert nearest.distance == pytest.approx(least, abs=1e-5) or nearest.distance <= 0 >= least


def test_planar_pairs() -> None:
    cell = planar_cell()
    names = {"a1/link1", "a1/link2", "a1/link3", "a2/link1", "a2/link2", "a2/link3"}
    assert set(cell.names) == names | {"object", "wall", "post"}
    free = {
        ("a1/link1", "a1/link2"), ("a1/link2", "a1/link3"), ("a2/link1", "a2/link2"),
        ("a2/link2", "a2/link3"), ("a1/link3", "object"), ("a2/link3", "object"),
        ("wall", "post"),
    }  # fmt: skip
    every = {frozenset(pair) for pair in itertools.combinations(cell.names, 2)}
    assert cell.tested == every - {frozenset(pair) for pair in free}
    assert cell.scene.notes == ()


def test_round_bodies_of_the_plane_are_judged_by_their_distances() -> None:
    cell = planar_cell()
    drawn = [cell.drawn(40 + k) for k in range(30)]
    _, clear, hit, least = combined(cell, drawn)
    np.testing.assert_array_equal(clear, least >= cell.bodies.clearance)
    np.testing.assert_array_equal(hit, ~clear)
    assert 0 < hit.sum() < len(hit)
    x, exact = np.array([cell.x(q) for q in drawn]), np.array([cell.exact(q) for q in drawn])
    for pairs in (cell.bodies.every, cell.bodies.own(0), cell.bodies.own(1), cell.bodies.shared):
        expected = (exact[:, pairs] >= cell.bodies.clearance).all(axis=1)
        np.testing.assert_array_equal(cell.bodies.clear(x, pairs), expected)
    # What nearly is the clearance, too.
    shared = cell.bodies.shared
    k, pair = np.argwhere((exact[:, shared] > 0.01) & (exact[:, shared] < 0.1))[0]
    pair = shared[pair]
    for more, kept in ((-1e-8, True), (-1e-7, True), (1e-7, False), (1e-8, False)):
        bodies = cell.scene.bodies(cell.arms, float(exact[k, pair]) + more)
        assert bodies.clear(x[[k]], np.array([pair]))[0] == kept


def test_distances_of_segments_are_those_of_thin_capsules() -> None:
    rng = np.random.default_rng(5)
    ends = rng.uniform(-1, 1, (60, 4, 3))
    # Some are parallel, one behind the other or side by side, and some are points.
    along = ends[20:40, 1] - ends[20:40, 0]
    ends[20:40, 3] = ends[20:40, 2] + along * rng.uniform(-2, 2, (20, 1))
    ends[40:50, 1] = ends[40:50, 0]
    ends[45:55, 3] = ends[45:55, 2]
    a0, a1, b0, b1 = ends.swapaxes(0, 1)
    found = segment_distances(Segments(a0, a1 - a0), Segments(b0, b1 - b0))
    for gap, *four in zip(found, a0, a1, b0, b1, strict=True):
        shapes = [capsule_between(*four[:2]), capsule_between(*four[2:])]
        thin = coal.distance(*shapes[0], *shapes[1], coal.DistanceRequest(), coal.DistanceResult())
        assert thin == pytest.approx(gap - 2e-3, abs=1e-5)


def capsule_between(a: np.ndarray, b: np.ndarray) -> tuple[coal.Capsule, coal.Transform3s]:
    """All within 1 mm of a segment, and where that is."""
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length if length else np.array([0.0, 0.0, 1.0])
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).matrix()
    return coal.Capsule(1e-3, length), coal.Transform3s(turn, (a + b) / 2)
