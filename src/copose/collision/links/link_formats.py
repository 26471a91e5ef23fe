"""The formats of robot files, by how they give shapes to links: one line each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from copose.collision.links.link_geometry import Geometry, LinkPair, Looks
from copose.collision.links.mjcf_geoms import kept_apart, mjcf_geometry, mjcf_looks
from copose.collision.links.urdf_elements import urdf_geometry, urdf_looks
from copose.robots.files.tree import Tree
from copose.robots.robot import Robot


@dataclass(frozen=True)
class LinkFormat:
    """The readers of links' shapes in one format of robot files.

    Attributes:
        elements: what gives a link its shape in such a file, in words.
        geometry: shapes to be tested, of a robot; the flag tells that only their sizes are needed,
            for which meshes are read in a third of the time.
        looks: shapes by which a robot's links are shown.
        kept_apart: pairs of links that a file itself keeps from touching, by what in it does so.
    """

    elements: str
    geometry: Callable[[Robot, bool], Geometry]
    looks: Callable[[Robot], Looks]
    kept_apart: Callable[[Tree], Mapping[str, set[LinkPair]]]


LINK_FORMATS = {
    "urdf": LinkFormat(
        "<collision> or <visual> elements", urdf_geometry, urdf_looks, lambda _tree: {}
    ),
    "mjcf": LinkFormat("geoms", mjcf_geometry, mjcf_looks, kept_apart),
}
