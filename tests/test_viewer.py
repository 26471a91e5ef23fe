"""What a page shows: looks of links, ellipsoids, frames, and pages of results."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import KDTree

import copose
from cells import planar, tables
from copose import InputError
from copose.collision import Carrier, Primitive
from copose.collision import link_looks as shapes_of_links
from copose.commands.command_line import main
from copose.kernels import cache as folder
from copose.poses import Pose, rotation_rows
from copose.problem import Problem
from copose.results import (
    EllipsoidRecord,
    ExactSetRecord,
    Motion,
    Posture,
    Solution,
    read_result,
    to_json,
)
from copose.robots import Arm, load_arms
from copose.robots.files.file_paths import resolve
from copose.viewer import CellScene, Look, link_looks, page_html, quiet_server, stop
from copose.viewer.surfaces.light_surfaces import BUDGET, light_surface
from copose.viewer.surfaces.light_surfaces import _reduced as reduced
from copose.viewer.surfaces.triangles import Triangles, ball, box, capsule, cylinder, round_arrow
from reference import PROBLEMS

SNAPSHOTS = Path(__file__).parent / "snapshots"
SHIFTED = np.array([0.02, -0.01, 0.03])


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Looks are made anew by every run, in a folder of the tests'."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@cache
def cell(name: str) -> tuple[Problem, tuple[Arm, ...], tuple[Look, ...]]:
    problem = copose.load(PROBLEMS / f"{name}.toml")
    arms = load_arms(problem)
    return problem, arms, link_looks(problem, arms)


@cache
def solved(name: str) -> Solution | Motion:
    return read_result(SNAPSHOTS / f"{name}.json")


@pytest.fixture(scope="module")
def server() -> Iterator[object]:
    opened = quiet_server()
    yield opened
    stop(opened)


@pytest.fixture
def scene(server: object) -> Iterator[object]:
    server.scene.reset()
    yield server.scene


def placed(carrier: Carrier, arms: tuple[Arm, ...], q: list[np.ndarray]) -> Pose:
    return arms[carrier.arm].frames(q[carrier.arm])[carrier.joint + 1]


def moved(vertices: np.ndarray, pose: Pose) -> np.ndarray:
    return vertices @ pose.rotation.T + pose.position


def drawn(arms: tuple[Arm, ...], seed: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.uniform(arm.lower, arm.upper) for arm in arms]


def visual_corners(q: np.ndarray, base: Pose) -> dict[str, np.ndarray]:
    """Corners of a Panda's visual meshes in the world, by link, as Pinocchio has them."""
    urdf = resolve(tables("two-panda-box")["arms"][0]["urdf"], Path(), {})
    model, _, visual = pin.buildModelsFromUrdf(
        str(urdf), [str(urdf.parents[4])], geometry_types=[
            pin.GeometryType.COLLISION, pin.GeometryType.VISUAL]
    )  # fmt: skip
    data, shown = model.createData(), visual.createData()
    full = pin.neutral(model)
    full[:7] = q
    pin.updateGeometryPlacements(model, data, visual, shown, full)
    found: dict[str, list[np.ndarray]] = {}
    for each, pose in zip(visual.geometryObjects, shown.oMg, strict=True):
        local = each.geometry.vertices() * each.meshScale
        corners = local @ pose.rotation.T + pose.translation
        found.setdefault(model.frames[each.parentFrame].name, []).append(moved(corners, base))
    return {link: np.vstack(rows) for link, rows in found.items()}


def test_looks_are_where_pinocchio_has_the_visual_meshes() -> None:
    problem, arms, looks = cell("two-panda-box")
    for seed in range(3):
        q = drawn(arms, seed)
        for i, arm in enumerate(arms):
            truth = visual_corners(q[i], arm.base)
            whole = {
                link.name: moved(
                    np.vstack([moved(p.shape.vertices, p.placement) for p in link.choices[0]]),
                    placed(link.carrier, arms, q) @ link.placement,
                )
                for link in shapes_of_links(problem, arms)
                if link.carrier.arm == i and link.choices[0]
            }
            own = [look for look in looks if look.carrier.arm == i]
            assert {look.name for look in own} == set(truth) == set(whole)
            for look in own:
                corners = truth[look.name]
                assert KDTree(corners).query(whole[look.name])[0].max() < 1e-6
                near = moved(look.vertices, placed(look.carrier, arms, q))
                for end in (np.min, np.max):
                    assert np.abs(end(near, axis=0) - end(corners, axis=0)).max() < 5e-3


def test_looks_are_light_and_keep_their_shape() -> None:
    problem, arms, looks = cell("two-panda-box")
    raw = {link.name: link for link in shapes_of_links(problem, arms)}
    assert max(len(look.faces) for look in looks) <= BUDGET == 1500
    assert sum(look.vertices.nbytes + look.faces.nbytes for look in looks) < 1e6
    rng = np.random.default_rng(0)
    for look in looks[:11]:
        assert look.vertices.dtype == np.float32 and look.faces.dtype == np.uint32
        (part,) = raw[look.name].choices[0]
        before = Triangles(part.shape.vertices, part.shape.triangles).placed(part.placement)
        before = before.placed(raw[look.name].placement)
        after = Triangles(look.vertices.astype(float), look.faces.astype(int))
        size = np.linalg.norm(np.ptp(before.vertices, axis=0))
        for one, other in ((before, after), (after, before)):
            far, _ = KDTree(other.scattered(40_000, rng)).query(one.scattered(4_000, rng))
            assert np.percentile(far, 95) < 0.02 * size and far.max() < 0.06 * size
        assert abs(after.areas.sum() / before.areas.sum() - 1) < 0.35


def test_arms_of_one_file_share_their_looks() -> None:
    _, _, looks = cell("two-panda-box")
    left, right = ([look for look in looks if look.carrier.arm == i] for i in (0, 1))
    assert all(a.faces is b.faces for a, b in zip(left, right, strict=True))
    assert not any(look.shared for look in looks)


def test_pieces_are_held_by_a_skin() -> None:
    # A ball in 30,000 triangles, none of which touches another.
    whole = ball()
    for _ in range(3):
        a, b, c = np.swapaxes(whole.vertices[whole.faces], 0, 1)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = np.stack([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]])
        corners = np.moveaxis(corners, 2, 1).reshape(-1, 3)
        corners /= np.linalg.norm(corners, axis=1, keepdims=True)
        whole = Triangles(corners, np.arange(len(corners)).reshape(-1, 3))
    corners = whole.vertices[whole.faces]
    middle = corners.mean(axis=1, keepdims=True)
    shrunk = (middle + 0.9 * (corners - middle)).reshape(-1, 3)
    apart = Triangles(shrunk, np.arange(len(shrunk)).reshape(-1, 3))
    made = reduced(apart)
    assert len(whole.faces) > 30_000 and 500 < len(made.faces) <= BUDGET
    assert np.abs(np.linalg.norm(made.vertices, axis=1) - 1).max() < 0.03
    # It is closed: every edge has two faces.
    edges = np.sort(np.vstack([made.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert np.mean(count == 2) > 0.99
    assert abs(volume(made) / (4 / 3 * np.pi) - 1) < 0.05


def volume(surface: Triangles) -> float:
    a, b, c = np.swapaxes(surface.vertices[surface.faces], 0, 1)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize(
    ("made", "exact"),
    [
        (box(np.array([0.2, 0.3, 0.4])), 0.024),
        (cylinder(0.1, 0.5), np.pi * 0.01 * 0.5),
        (capsule(0.1, 0.5), np.pi * (0.01 * 0.5 + 4 / 3 * 0.001)),
        (ball(), 4 / 3 * np.pi),
    ],
)
def test_solids_are_closed_and_wound_outwards(made: Triangles, exact: float) -> None:
    edges = np.sort(np.vstack([made.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    assert exact * 0.95 < volume(made) <= exact * 1.0001


def test_a_round_arrow_goes_counter_clockwise() -> None:
    made = round_arrow()
    tip = made.vertices[np.linalg.norm(made.vertices, axis=1).argmax()]
    assert volume(made) > 0 and np.degrees(np.arctan2(tip[1], tip[0])) % 360 > 200


def test_looks_are_kept_and_damage_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, arms, _ = cell("two-panda-box")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    parts = next(x.choices[0] for x in shapes_of_links(problem, arms) if "finger" in x.name)
    first = light_surface(parts)
    (file,) = (tmp_path / "copose").glob("look-*.npz")
    whole = file.read_bytes()

    def again() -> bytes:
        found = light_surface(parts)
        assert (found.vertices == first.vertices).all() and (found.faces == first.faces).all()
        (kept,) = (tmp_path / "copose").glob("look-*.npz")
        return kept.read_bytes()

    monkeypatch.setattr(
        "copose.viewer.surfaces.light_surfaces._reduced", lambda _: pytest.fail("is kept")
    )
    assert again() == whole
    monkeypatch.undo()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    file.write_bytes(whole[: len(whole) // 2])
    assert again() == whole
    # Whole, and still no surface.
    key = "-".join(file.name.split("-")[:3])
    file.unlink()
    folder.store(key, ".npz", b"no surface")
    assert light_surface(parts).faces.shape == first.faces.shape


def test_other_content_is_another_look(tmp_path: Path) -> None:
    mesh = '<visual><geometry><mesh filename="a.stl"/></geometry></visual>'
    (tmp_path / "r.urdf").write_text(chain(mesh))
    for length in (1.0, 2.0):
        (tmp_path / "a.stl").write_text(stl(length))
        problem = copose.parse(arm_of("r.urdf"), tmp_path / "p.toml")
        (look,) = link_looks(problem, load_arms(problem))
        assert np.ptp(look.vertices, axis=0).max() == pytest.approx(length)


INERTIA = """<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial>"""


def chain(shape: str) -> str:
    """A robot of three links in a row, 0.5 m apart, of which the first has a shape."""
    links = "".join(
        f'<link name="{name}">{shape if name == "a" else ""}{INERTIA}</link>' for name in "abc"
    )
    joints = "".join(
        f'''<joint name="j{child}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
        <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'''
        for parent, child in (("base", "a"), ("a", "b"), ("b", "c"))
    )
    return f'<robot name="r"><link name="base"/>{links}{joints}</robot>'


def stl(length: float) -> str:
    """A tetrahedron of some length along x."""
    corners = [(0, 0, 0), (length, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    rows = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corners[i]) for i in face)
        + "endloop\nendfacet\n"
        for face in faces
    )
    return f"solid a\n{rows}endsolid a\n"


def arm_of(file: str) -> dict:
    return {
        "format": 1, "name": "x", "task": {"space": "spatial-linear"},
        "object": {"mass": 1.0, "position": [0.5, 0, 0]},
        "arms": [{"name": "a/b", "urdf": file, "tip": "c", "grasp": {"position": [0, 0, 0]}}],
    }  # fmt: skip


def test_what_has_no_visual_is_shown_all_the_same(tmp_path: Path) -> None:
    shape = """<visual><geometry><mesh filename="package://gone/a.dae"/></geometry></visual>
      <collision><origin xyz="0.1 0 0"/><geometry><box size="0.4 0.1 0.1"/></geometry>
      </collision>"""
    (tmp_path / "r.urdf").write_text(chain(shape))
    problem = copose.parse(arm_of("r.urdf"), tmp_path / "p.toml")
    arms = load_arms(problem)
    (look,) = link_looks(problem, arms)
    assert look.name == "a" and look.carrier == Carrier("joint", 0, 0)
    assert np.allclose(look.vertices.min(axis=0), [-0.1, -0.05, -0.05])
    assert np.allclose(look.vertices.max(axis=0), [0.3, 0.05, 0.05])
    (tmp_path / "r.urdf").write_text(chain(""))
    sticks = link_looks(problem, arms)
    assert [look.name for look in sticks] == ["base", "link1", "link2", "link3"]
    # Capsules reach from joint to joint.
    assert all(np.ptp(look.vertices[:, 0]) > 0.5 for look in sticks[:3])


def test_planar_links_have_their_own_width() -> None:
    data = planar(n_arms=1)
    data["arms"][0]["links"][0]["radius"] = 0.05
    problem = copose.parse(data)
    looks = link_looks(problem, load_arms(problem))
    ends = [np.array([look.vertices.min(axis=0), look.vertices.max(axis=0)]) for look in looks]
    assert [round(float(np.ptp(end[:, 1])), 3) for end in ends] == [0.1, 0.06, 0.06]
    assert np.allclose([np.ptp(end[:, 0]) for end in ends], [0.5, 0.46, 0.46])


def shown(scene: object, name: str, posture: Posture) -> CellScene:
    made = CellScene(scene, *cell(name))
    made.show(posture)
    return made


def quadratic(handle: object, scale: float) -> np.ndarray:
    """The G of {a : aᵀ G a ≤ 1} that a ball of radius 1 shows, turned and stretched."""
    R = np.array(rotation_rows(handle.wxyz))
    assert np.linalg.det(R) == pytest.approx(1.0)
    return R @ np.diag((np.array(handle.scale) / scale) ** -2.0) @ R.T


def test_balls_are_the_slices_of_the_ellipsoid(scene: object) -> None:
    after = solved("spatial").after
    made = shown(scene, "two-panda-box", after)
    gram = np.array(after.ellipsoid.gram)
    for kind, rows in (("linear", slice(0, 3)), ("angular", slice(3, 6))):
        ball = made.slices.balls[kind]
        assert ball.name == f"/ellipsoid/{kind}" and ball.visible
        found = quadratic(ball, made.slices.scales[kind])
        assert np.allclose(found, gram[rows, rows], rtol=1e-6, atol=1e-9 * abs(gram).max())
    assert np.allclose(made.slices.balls["linear"].position, after.object.position)
    above = made.slices.balls["angular"].position - np.array(after.object.position)
    assert np.allclose(above, [0, 0, made.slices.lift]) and made.slices.lift > 0.2
    longest = [max(made.slices.balls[kind].scale) for kind in ("linear", "angular")]
    assert np.allclose(longest, 0.18 * made.size)
    made.show_ellipsoids(linear=False, angular=True)
    assert not made.slices.balls["linear"].visible and made.slices.balls["angular"].visible
    # One scale while the object is dragged: a smaller ellipsoid is a smaller ball.
    before = dict(made.slices.scales)
    made.show(solved("spatial").before)
    assert made.slices.scales == before


def test_an_ellipse_lies_in_the_plane(scene: object) -> None:
    after = solved("planar").after
    made = shown(scene, "paper-fig2", after)
    scale = made.slices.scales["linear"]
    found = quadratic(made.slices.balls["linear"], scale)
    assert np.allclose(found[:2, :2], after.ellipsoid.gram, rtol=1e-6)
    assert np.allclose(found[2, :2], 0, atol=1e-6) and made.slices.balls["linear"].scale[2] < 0.01
    for name, arm in after.arms.items():
        rim = made.slices.rims[name]
        R = np.array(rotation_rows(rim.wxyz))[:2, :2]
        own = R @ np.diag((np.array(rim.scale[:2]) / scale) ** -2.0) @ R.T
        assert np.allclose(own, arm.ellipsoid.gram, rtol=1e-6) and rim.visible
        assert np.allclose(rim.position[:2], arm.skeleton[-1][:2])
    assert "angular" not in made.slices.balls


def test_frames_are_the_postures_and_no_mesh_is_sent_again(server: object, scene: object) -> None:
    solution = solved("spatial")
    made = shown(scene, "two-panda-box", solution.before)
    made.show_before(solution.before)
    record = server.get_scene_serializer()
    already = len(record._messages)
    made.show(solution.after)
    kinds = {message["type"] for _, message in record._messages[already:]}
    record.serialize()
    assert kinds <= {
        "SetPositionMessage", "SetOrientationMessage", "SceneNodeUpdateMessage",
        "SetSceneNodeVisibilityMessage",
    }  # fmt: skip
    for top, posture in (("arms", solution.after), ("before", solution.before)):
        for name, arm in posture.arms.items():
            steps = ["root", *(f"joint{j + 1}" for j in range(7)), "tip"]
            for step, position, quaternion in zip(
                steps, arm.skeleton, arm.quaternions, strict=True
            ):
                handle = scene.get_handle_by_name(f"/{top}/{name}/{step}")
                assert np.allclose(handle.position, position)
                assert np.allclose(handle.wxyz, quaternion)
        for look in cell("two-panda-box")[2]:
            name = ("left", "right")[look.carrier.arm]
            step = "root" if look.carrier.kind == "root" else f"joint{look.carrier.joint + 1}"
            mesh = scene.get_handle_by_name(f"/{top}/{name}/{step}/{look.name}")
            assert (mesh.vertices == look.vertices).all() and (mesh.position == 0).all()
    assert np.allclose(made.object.position, solution.after.object.position)
    ghost = scene.get_handle_by_name("/before")
    made.show_ghosts(False)
    assert not ghost.visible
    made.show_ghosts(True)
    made.show_before(None)
    assert not ghost.visible


def test_an_object_out_of_reach_is_red_and_lines_join_hands_with_grasps(scene: object) -> None:
    after = solved("spatial").after
    made = shown(scene, "two-panda-box", after)
    shape, gap = (scene.get_handle_by_name(each) for each in ("/object/shape", "/gaps/left"))
    usual = tuple(shape.color)
    assert not gap.visible
    made.mark_object(unreachable=True)
    made.place_object(Pose.from_rpy(np.array(after.object.position) + SHIFTED))
    assert tuple(shape.color) == (192, 0, 0) and gap.visible
    assert gap.scale[2] == pytest.approx(np.linalg.norm(SHIFTED), abs=1e-4)
    tip = np.array(after.arms["left"].skeleton[-1])
    assert np.allclose(gap.position, tip + SHIFTED / 2, atol=1e-4)
    made.show(after)
    made.mark_object(unreachable=False)
    assert tuple(shape.color) == usual and not gap.visible


def test_obstacles_have_their_names_and_move(scene: object) -> None:
    data = tables("two-panda-box")
    data["obstacles"] = [
        {"name": "a/b", "shape": {"kind": "capsule", "radius": 0.1, "length": 0.3},
         "position": [0.1, 0.2, 0.3]},
        {"name": "floor", "shape": {"kind": "box", "size": [2, 2, 0.1]}, "position": [0, 0, -0.1]},
    ]  # fmt: skip
    problem, (_, arms, looks) = copose.parse(data), cell("two-panda-box")
    made = CellScene(scene, problem, arms, looks)
    handle = scene.get_handle_by_name("/obstacles/a%2Fb")
    assert np.allclose(handle.position, [0.1, 0.2, 0.3])
    assert np.allclose(np.ptp(handle.vertices, axis=0), [0.2, 0.2, 0.5], atol=1e-6)
    made.place_obstacle("a/b", Pose.from_rpy([1, 2, 3], [0, 0, 1]))
    assert np.allclose(handle.position, [1, 2, 3])
    assert np.allclose(handle.wxyz, [np.cos(0.5), 0, 0, np.sin(0.5)])


def test_directions_are_arrows(scene: object) -> None:
    made = shown(scene, "two-panda-box", solved("spatial").after)
    assert not [name for name in scene._handle_from_node_name if "/directions/linear/" in name]
    made.point([(0, 0.6, 0, 0, 0, 0), (1, 0, 0, 0, -1, 0)])
    for name, along in (
        ("linear/1", (0, 1, 0)),
        ("linear/2", (1, 0, 0)),
        ("angular/2", (0, -1, 0)),
    ):
        handle = scene.get_handle_by_name(f"/directions/{name}")
        assert np.allclose(np.array(rotation_rows(handle.wxyz))[:, 2], along)
        assert 0.05 < handle.scale < 0.6
    assert scene.get_handle_by_name("/directions/angular/1") is None
    assert np.allclose(
        scene.get_handle_by_name("/directions/linear").position, made.object.position
    )
    made.point([])
    assert scene.get_handle_by_name("/directions/linear/1") is None


@pytest.mark.parametrize("scaling", ["limits", "unit"])
def test_exact_sets_are_drawn_at_the_ellipsoids_scale(scaling: str, scene: object) -> None:
    data = tables("two-panda-box")
    data["ellipsoid"] = {"torque_scaling": scaling}
    sets = {
        "linear": exact_set(("x", "y", "z"), np.array(list(np.ndindex(2, 2, 2))) - 0.5),
        "angular": exact_set(("yaw", "roll"), np.array([[3, 0], [0, 3], [-3, 0], [0, -3]])),
    }
    told = solved("spatial").after.model_copy(update={"exact_sets": sets})
    made = CellScene(scene, copose.parse(data), *cell("two-panda-box")[1:])
    made.show(told)
    made.show_exact_set(told)
    scales = made.slices.scales
    if scaling == "unit":
        # Their units differ, so their farthest corners are drawn a share of the scene long.
        scales = {"linear": 0.25 * made.size / np.sqrt(0.75), "angular": 0.25 * made.size / 3}
    for kind, faces, edges in (("linear", 12, 12), ("angular", 2, 4)):
        mesh = scene.get_handle_by_name(f"/exact/{kind}")
        lines = scene.get_handle_by_name(f"/exact/{kind} edges")
        assert len(mesh.faces) == faces and len(lines.points) == edges
        assert np.allclose(mesh.position, made.slices.center(told, kind))
    corners = scene.get_handle_by_name("/exact/linear").vertices
    assert np.allclose(np.ptp(corners, axis=0), scales["linear"])
    wound = Triangles(corners.astype(float), scene.get_handle_by_name("/exact/linear").faces)
    assert volume(wound) == pytest.approx(scales["linear"] ** 3, rel=1e-5)
    flat = scene.get_handle_by_name("/exact/angular").vertices
    assert np.allclose(flat[0], [0, 0, 3 * scales["angular"]]) and not flat[:, 1].any()
    made.show_exact_set(None)
    assert scene.get_handle_by_name("/exact/linear") is None


def exact_set(axes: tuple[str, ...], vertices: np.ndarray) -> ExactSetRecord:
    nothing = EllipsoidRecord.of(None)
    return ExactSetRecord(axes=axes, vertices=vertices.tolist(), residual_radius=0.5,
                          ellipsoid=nothing)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "result"), [("two-panda-box", "spatial"), ("paper-fig2", "planar")]
)
def test_the_first_eye_sees_all(name: str, result: str, scene: object) -> None:
    problem, arms, looks = cell(name)
    after = solved(result).after
    made = shown(scene, name, after)
    eye = made.camera(after)
    corners = np.vstack([
        moved(look.vertices, placed(look.carrier, arms, [after.joints[a.name] for a in arms]))
        for look in looks
    ])  # fmt: skip
    right, up, toward = eye.axes
    off = corners - eye.position
    depth = -off @ toward
    assert (depth > 0).all()
    assert np.abs(off @ up / depth).max() < np.tan(eye.angle / 2)
    assert np.abs(off @ right / depth).max() < 1.3 * np.tan(eye.angle / 2)
    if problem.space.planar:
        assert np.allclose(toward, [0, 0, 1]) and np.allclose(eye.up, [0, 1, 0])
    else:
        assert toward[2] > 0.2


@pytest.mark.parametrize(
    ("name", "result"),
    [("two-panda-box", "spatial"), ("paper-fig2", "planar"), ("panda-carry-path", "path"),
     ("panda-three-cases", "cases")],
)  # fmt: skip
def test_a_page_is_one_light_file(
    name: str, result: str, capfd: pytest.CaptureFixture[str]
) -> None:
    before = set(threading.enumerate())
    page = page_html(solved(result), cell(name)[0])
    assert set(threading.enumerate()) == before
    assert not any(capfd.readouterr())
    assert 0.8e6 < len(page.encode()) < 1.3e6
    assert f"<title>{name}</title>" in page and 'id="copose-caption"' in page
    assert page.index("__VISER_EMBED_DATA__") < page.index("copose-caption")


def test_names_in_a_page_are_text() -> None:
    data = planar(n_arms=1, n_links=2)
    data["name"] = "a<b> & c"
    data["arms"][0]["name"] = "<script>"
    problem = copose.parse(data)
    page = page_html(copose.solve(problem, effort="low"), problem)
    assert "<title>a&lt;b&gt; &amp; c</title>" in page and "arm &lt;script&gt;" in page


def test_a_page_is_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    problem = PROBLEMS / "paper-fig2.toml"
    file = tmp_path / "result.json"
    file.write_text(to_json(solved("planar")))
    assert main(["export", str(file), "--to", "html", "--problem", str(problem)]) == 0
    assert capsys.readouterr().out == f"written to {tmp_path / 'posture.html'}\n"
    assert (tmp_path / "posture.html").stat().st_size > 8e5
    wrong = PROBLEMS / "push-x.toml"
    far = solved("planar").model_copy(update={"joint_names": {"a": ("b",)}})
    nothing = {"status": "infeasible", "reason": "arms are short", "after": None}
    file.write_text(to_json(solved("planar").model_copy(update=nothing)))
    assert main(["export", str(file), "--to", "html"]) == 2
    assert "has no posture to export, it is infeasible: arms" in capsys.readouterr().err
    file.write_text(to_json(solved("planar")))
    assert main(["export", str(file), "--to", "html"]) == 2
    assert "names no problem file; html needs the problem" in capsys.readouterr().err
    with pytest.raises(InputError, match="other arms or joints"):
        page_html(far, copose.load(wrong))
    longer = tables("paper-fig2")
    longer["arms"][0]["links"][1]["length"] += 0.1
    with pytest.raises(InputError, match="'a1' stand otherwise"):
        page_html(solved("planar"), copose.parse(longer))


@pytest.mark.parametrize("missing", ["viser", "fast_simplification"])
def test_without_the_extra_it_is_named(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(InputError, match=r"pip install 'copose\[live\]'"):
        page_html(solved("planar"), cell("paper-fig2")[0])


def test_mujoco_models_show_what_nothing_touches(tmp_path: Path) -> None:
    model = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 0 1" range="-1 1"/>
      <geom type="box" size=".1 .1 .1" mass="1" group="3"/>
      <geom type="sphere" size=".3" contype="0" conaffinity="0" group="2" mass="0"/>
      <body name="b" pos="1 0 0"><joint name="k"/><geom type="box" size=".1 .2 .3" mass="1"
      group="3"/><body name="c" pos="1 0 0"><joint name="l"/><geom type="capsule" size=".1 .2"
      mass="1"/></body></body></body></worldbody></mujoco>"""
    (tmp_path / "m.xml").write_text(model)
    data = arm_of("m.xml")
    data["arms"][0] = {"name": "a", "mjcf": "m.xml", "tip": "c", "grasp": {"position": [0, 0, 0]}}
    problem = copose.parse(data, tmp_path / "p.toml")
    looks = {look.name: look for look in link_looks(problem, load_arms(problem))}
    assert np.allclose(np.ptp(looks["a"].vertices, axis=0), 0.6, atol=0.02)
    assert np.allclose(np.ptp(looks["b"].vertices, axis=0), [0.2, 0.4, 0.6])
    assert np.allclose(np.ptp(looks["c"].vertices, axis=0), [0.2, 0.2, 0.6])
    first = next(link for link in shapes_of_links(problem, load_arms(problem)) if link.name == "a")
    assert first.choices[0][0].shape == Primitive("sphere", (0.3,))
