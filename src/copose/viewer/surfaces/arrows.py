"""Arrows as triangles: straight ones, and ones that go round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Pose
from copose.viewer.surfaces.triangles import Triangles, joined, revolved, turned_to


@dataclass(frozen=True)
class ArrowShape:
    """Proportions of an arrow of length 1, and of one that goes round at radius 1."""

    shaft: float = 0.025  # radius
    head: float = 0.07  # radius of the head
    point: float = 0.22  # length of the head
    turn: float = 1.5 * np.pi  # rad, that a round arrow goes
    steps: int = 36  # along a round arrow
    sides: int = 10  # corners of a cross-section of it


def arrow(shape: ArrowShape = ArrowShape()) -> Triangles:
    """An arrow of length 1 along z, from the origin."""
    shaft, head, neck = shape.shaft, shape.head, 1 - shape.point
    return revolved(np.array([0, shaft, shaft, head, 0]), np.array([0, 0, neck, neck, 1.0]))


def round_arrow(shape: ArrowShape = ArrowShape()) -> Triangles:
    """An arrow that goes round z at radius 1, counter-clockwise, and not all the way."""
    shaft, point, sides = shape.shaft, shape.point, shape.sides
    angles = np.linspace(0, shape.turn - 2 * point, shape.steps)
    about = np.arange(sides) * 2 * np.pi / sides
    a, b = np.meshgrid(angles, about, indexing="ij")
    out = 1 + 2 * shaft * np.cos(b)
    vertices = np.stack([out * np.cos(a), out * np.sin(a), 2 * shaft * np.sin(b)], axis=-1)
    k = np.arange(sides)
    after = (k + 1) % sides
    faces = []
    for step in range(shape.steps - 1):
        low, high = step * sides, (step + 1) * sides
        faces.append(np.column_stack([low + k, high + k, high + after]))
        faces.append(np.column_stack([low + k, high + after, low + after]))
    end = angles[-1]
    ahead = np.array([-np.sin(end), np.cos(end), 0.0])
    place = np.array([np.cos(end), np.sin(end), 0.0])
    head = revolved(np.array([0, 2 * shape.head, 0]), np.array([0, 0, 2 * point]))
    head = head.placed(Pose.make(place, turned_to(ahead), np.zeros(4)))
    return joined([Triangles(vertices.reshape(-1, 3), np.vstack(faces)), head])
