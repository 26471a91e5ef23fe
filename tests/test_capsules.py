"""Capsules against independent truth: sampled points are inside, and coal says what sticks out."""

from __future__ import annotations

import itertools
from functools import cache

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull, Delaunay

from copose.collision.capsules import MOST, Capsule, around_surface
from reference import example

PANDA = "panda_description/urdf/panda.urdf"
XARM7 = "xarm_description/urdf/xarm7.urdf"
SLACK = 1e-9


def gaps(points: np.ndarray, capsules: tuple[Capsule, ...]) -> np.ndarray:
    """How far each point is from the nearest capsule; negative inside."""
    nearest = np.full(len(points), np.inf)
    for c in capsules:
        e = c.b - c.a
        t = np.clip((points - c.a) @ e / max(e @ e, 1e-300), 0, 1)
        gap = np.linalg.norm(points - c.a - t[:, None] * e, axis=1) - c.radius
        nearest = np.minimum(nearest, gap)
    return nearest


def skin(capsule: Capsule, count: int, seed: int = 0) -> np.ndarray:
    """Points of a capsule's surface, on its end spheres and between."""
    u = np.random.default_rng(seed).normal(size=(count, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    ends = [capsule.a + capsule.radius * u, capsule.b + capsule.radius * u]
    e = capsule.b - capsule.a
    across = u - np.outer(u @ e, e) / max(e @ e, 1e-300)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    between = capsule.a + np.linspace(0, 1, count)[:, None] * e + capsule.radius * across
    return np.vstack([*ends, between])


def convex(points: np.ndarray) -> coal.Convex:
    hull = ConvexHull(points)
    place = {v: i for i, v in enumerate(hull.vertices)}
    corners, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for v in hull.vertices:
        corners.append(points[v])
    for (i, j, k), n in zip(hull.simplices, hull.equations[:, :3], strict=True):
        if np.cross(points[j] - points[i], points[k] - points[i]) @ n < 0:
            j, k = k, j
        faces.append(coal.Triangle(place[i], place[j], place[k]))
    return coal.Convex(corners, faces)


def sticks_out(points: np.ndarray, capsules: tuple[Capsule, ...], count: int = 150) -> float:
    """Largest distance by coal from points of the capsules to the convex hull of points."""
    hull, origin = convex(points), coal.Transform3s.Identity()
    ball, request, farthest = coal.Sphere(1e-9), coal.DistanceRequest(), -np.inf
    for p in np.vstack([skin(c, count, seed) for seed, c in enumerate(capsules)]):
        result = coal.DistanceResult()
        place = coal.Transform3s(np.eye(3), p)
        farthest = max(farthest, coal.distance(hull, origin, ball, place, request, result))
    return farthest + 1e-9


def sampled(vertices: np.ndarray, triangles: np.ndarray, count: int = 20000) -> np.ndarray:
    """Vertices and random points of a surface, more where there is more of it."""
    rng = np.random.default_rng(1)
    corners = vertices[triangles]
    sides = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    # Every triangle at least once.
    some = np.append(
        np.arange(len(triangles)), rng.choice(len(area), size=count, p=area / area.sum())
    )
    weights = rng.dirichlet(np.ones(3), size=len(some))
    return np.vstack([vertices[triangles.ravel()], (weights[:, :, None] * corners[some]).sum(1)])


def inner(points: np.ndarray, count: int = 20000) -> np.ndarray:
    """Random points of a convex hull, its corners, and as many near its surface."""
    rng = np.random.default_rng(2)
    hull = ConvexHull(points)
    tetrahedra = points[hull.vertices][Delaunay(points[hull.vertices]).simplices]
    volume = np.abs(np.linalg.det(tetrahedra[:, 1:] - tetrahedra[:, :1]))
    some = rng.choice(len(volume), size=count, p=volume / volume.sum())
    weights = rng.dirichlet(np.ones(4), size=count)
    inside = (weights[:, :, None] * tetrahedra[some]).sum(axis=1)
    return np.vstack([inside, sampled(points, hull.simplices, count)])


@cache
def meshes(urdf: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    path = example(urdf)
    model = pin.buildModelFromUrdf(str(path))
    share = path.parents[4]
    geometry = pin.buildGeomFromUrdf(
        model, str(path), pin.GeometryType.COLLISION, package_dirs=[str(share)]
    )
    found = {}
    for thing in geometry.geometryObjects:
        mesh = thing.geometry
        if isinstance(mesh, coal.BVHModelBase):
            faces = [mesh.tri_indices(i) for i in range(mesh.num_tris)]
            triangles = np.array([[f[0], f[1], f[2]] for f in faces], dtype=np.intp)
            found[thing.name] = np.array(mesh.vertices()), triangles
    return found


@cache
def around_mesh(urdf: str, name: str) -> tuple[Capsule, ...]:
    return around_surface(*meshes(urdf)[name])


LINKS = [(urdf, name) for urdf in (PANDA, XARM7) for name in meshes(urdf)]


def box(*sides: float) -> np.ndarray:
    return np.array(list(itertools.product(*((-s / 2, s / 2) for s in sides))))


def cylinder(radius: float, length: float) -> np.ndarray:
    angle = np.arange(48) * np.pi / 24
    circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    ends = [np.column_stack([circle, np.full(48, z)]) for z in (-length / 2, length / 2)]
    return np.vstack(ends)


def turned(points: np.ndarray, seed: int = 3) -> np.ndarray:
    q = np.random.default_rng(seed).normal(size=4)
    return points @ pin.Quaternion(q / np.linalg.norm(q)).matrix().T + [0.3, -0.2, 0.5]


@pytest.mark.parametrize(("urdf", "name"), LINKS)
def test_meshes_of_arms_are_enclosed_tightly(urdf: str, name: str) -> None:
    vertices, triangles = meshes(urdf)[name]
    capsules = around_mesh(urdf, name)
    assert gaps(sampled(vertices, triangles), capsules).max() <= SLACK
    assert sticks_out(vertices, capsules) <= MOST + 1e-6


def test_meshes_of_arms_take_few_capsules() -> None:
    counts = {link: len(around_mesh(*link)) for link in LINKS}
    # The base of the Panda is large and has sharp edges all around.
    assert counts.pop((PANDA, "panda_link0_0")) <= 10
    assert max(counts.values()) <= 6
    assert sum(counts.values()) <= 60
