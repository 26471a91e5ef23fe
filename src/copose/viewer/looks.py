"""Surfaces of the links of a problem's arms, each in the frame that moves it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from copose.collision import Carrier, Part
from copose.collision import link_looks as shapes_of_links
from copose.collision.shapes.mesh_files import UnreadableError
from copose.errors import InputError
from copose.poses import Array, Pose
from copose.problem import Problem
from copose.robots import Arm
from copose.viewer.surfaces.light_surfaces import Surface, light_surface, simplifier
from copose.viewer.surfaces.triangles import between


@dataclass(frozen=True)
class SkeletonLook:
    """The look of an arm without shapes."""

    radius: float = 0.03  # as a share of the arm's length
    least: float = 0.01  # m, radius
    most: float = 0.06  # m, radius


@dataclass(frozen=True, eq=False)
class Look:
    """The surface of a link."""

    name: str  # of the link
    carrier: Carrier  # the frame that moves it: a joint's after its motion, or an arm's root
    vertices: np.ndarray  # corners in that frame, m, (v, 3) of float32
    faces: np.ndarray  # corners of each triangle by number, (f, 3) of uint32
    shared: bool = False  # whether several arms stand on it


def link_looks(problem: Problem, arms: Sequence[Arm]) -> tuple[Look, ...]:
    """The looks of all links of a problem's arms, of few triangles each.

    A link's visual meshes are taken, else its collision shapes; an arm that has neither is shown by
    capsules from joint to joint. What cannot be read is left out.

    Raises:
        InputError: fast_simplification is not installed.
    """
    simplifier()
    looks = []
    made: dict[int, Surface | None] = {}
    with contextlib.suppress(InputError):
        for link in shapes_of_links(problem, arms):
            # Arms of one file have their links' shapes in common.
            if id(link.choices) not in made:
                made[id(link.choices)] = _surface(link.choices)
            surface = made[id(link.choices)]
            if surface is not None:
                vertices = _placed(surface.vertices, link.placement)
                looks.append(Look(link.name, link.carrier, vertices, surface.faces, link.shared))
    moved = {look.carrier.arm for look in looks if look.carrier.kind == "joint"}
    for number, arm in enumerate(arms):
        if number not in moved:
            looks += _skeleton(number, arm)
    return tuple(looks)


def _surface(choices: Sequence[tuple[Part, ...]]) -> Surface | None:
    """The first shapes of a link that can be read."""
    for parts in choices:
        readable = []
        with contextlib.suppress(UnreadableError):
            surface = light_surface(parts)
            if surface is not None:
                return surface
            continue
        for part in parts:
            with contextlib.suppress(UnreadableError):
                if light_surface((part,)) is not None:
                    readable.append(part)
        if readable:
            return light_surface(readable)
    return None


def _placed(vertices: np.ndarray, pose: Pose) -> np.ndarray:
    return np.asarray(vertices @ pose.rotation.T + pose.position, dtype=np.float32)


def _skeleton(number: int, arm: Arm) -> Iterator[Look]:
    """Capsules from joint to joint, each in the frame of the joint before."""
    ends: list[Array] = [joint.placement.position for joint in arm.joints] + [arm.tip.position]
    length = sum(float(np.linalg.norm(end)) for end in ends)
    radius = float(np.clip(SkeletonLook.radius * length, SkeletonLook.least, SkeletonLook.most))
    carriers = [Carrier("root", number)] + [Carrier("joint", number, j) for j in range(arm.n)]
    for carrier, end in zip(carriers, ends, strict=True):
        if np.linalg.norm(end) > 1e-6 or carrier.kind == "joint":
            made = between(np.zeros(3), end, radius)
            name = "base" if carrier.kind == "root" else f"link{carrier.joint + 1}"
            yield Look(
                name, carrier, made.vertices.astype(np.float32), made.faces.astype(np.uint32)
            )
