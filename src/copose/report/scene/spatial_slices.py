"""Slices of ellipsoids in scenes in space."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from copose.poses import Array
from copose.report.geometry.camera import roomy
from copose.report.geometry.link_bodies import LinkBody
from copose.report.geometry.shapes import spatial_points
from copose.report.geometry.slices import Slice, angular_slice, linear_slice
from copose.report.look import LOOK
from copose.report.panels import Panel, shared_scales
from copose.report.scene.polygons import ON_TOP, Polygons
from copose.report.words import round_scale, semi_axis_units
from copose.results import EllipsoidRecord


@dataclass(frozen=True)
class SliceLook:
    """Sizes of slices, as shares of the scene, and their opacity."""

    longest: float = 0.18  # the longest semi-axis
    lift: float = 0.42  # height at which angular slices float above linear ones, at least
    opacity: float = 0.35


@dataclass(frozen=True)
class SliceKind:
    """One kind of slices of all panels, linear or angular, as they are drawn."""

    name: str  # linear or angular
    # The function that takes the slice of an ellipsoid.
    part: Callable[[EllipsoidRecord, Sequence[str]], Slice | None]
    color: str
    index: int  # place of its unit among those of semi-axes
    scales: list[float]  # metres drawn per unit, by panel
    lift: float  # height above the object at which it floats, m

    def of(self, panel: Panel) -> Slice | None:
        """A posture's slice."""
        return self.part(panel.posture.ellipsoid, panel.solution.problem.axes)

    def center(self, panel: Panel) -> Array:
        """The place of its centre in a panel."""
        return np.asarray(panel.posture.object.position + np.array([0.0, 0.0, self.lift]))

    def unit(self, panel: Panel) -> str:
        """The unit of its semi-axes in a panel."""
        return semi_axis_units(panel.solution)[self.index]

    def units(self, panels: list[Panel]) -> list[str]:
        """The units of its semi-axes in all panels, each once."""
        return list(dict.fromkeys(self.unit(panel) for panel in panels))

    def words(self, panels: list[Panel]) -> str:
        """A line on the length at which accelerations are drawn."""
        where = ", lifted above the object" if self.lift else " at the object"
        drawn = []
        for unit, scale in {
            self.unit(p): s for p, s in zip(panels, self.scales, strict=True)
        }.items():
            value = round_scale(0.2 / scale)
            drawn.append(f"{value * scale:.2g} m drawn = {value:g} {unit}")
        return f"{self.name} slice{where}: {'; '.join(drawn)}"


def slice_kinds(
    panels: list[Panel], links: list[list[LinkBody]], look: SliceLook = SliceLook()
) -> list[SliceKind]:
    """The kinds of slices that postures have, each at one scale for all that share a unit."""
    low, high = roomy(drawn_points(panels, []))
    size = float((high - low).max())
    kinds: list[SliceKind] = []
    for index, (name, part, color) in enumerate(
        (("linear", linear_slice, LOOK.system), ("angular", angular_slice, LOOK.angular))
    ):
        slices = [part(p.posture.ellipsoid, p.solution.problem.axes) for p in panels]
        longest = [0.0 if each is None else float(each.ellipsoid.radii[0]) for each in slices]
        scales = shared_scales(panels, longest, look.longest * size)
        if scales is not None:
            # Where both are drawn the angular one floats above the other.
            lift = _lift(panels, links, slices, scales, size, look.lift) if kinds else 0.0
            kinds.append(SliceKind(name, part, color, index, scales, lift))
    return kinds


def _lift(
    panels: list[Panel], links: list[list[LinkBody]], slices: list[Slice | None],
    scales: list[float], size: float, share: float,
) -> float:  # fmt: skip
    """The height above the object at which slices float, m: clear of links in their way."""
    lift = share * size
    for panel, bodies, part, scale in zip(panels, links, slices, scales, strict=True):
        if part is not None and bodies:
            extent = np.abs(scale * part.surface.reshape(-1, 3)).max(axis=0)
            points = np.vstack([link.points for link in bodies])
            offset = points - np.array(panel.posture.object.position)
            above = (np.abs(offset) <= 1.1 * extent + [0, 0, np.inf])[:, :2].all(axis=1)
            lift = max(lift, offset[above, 2].max(initial=0.0) + 1.2 * extent[2])
    return lift


def drawn_points(panels: list[Panel], kinds: list[SliceKind]) -> Array:
    """Points of arms, objects and slices, (k, 3)."""
    points = [spatial_points(panel.posture, panel.solution) for panel in panels]
    for kind in kinds:
        for panel, scale in zip(panels, kind.scales, strict=True):
            part = kind.of(panel)
            if part is not None:
                points.append((kind.center(panel) + scale * part.surface).reshape(-1, 3))
    return np.vstack(points)


def draw_slice(
    ax: Any, polygons: Polygons, panel: Panel, kind: SliceKind, scale: float,
    look: SliceLook = SliceLook(),
) -> None:  # fmt: skip
    """The slice of a panel, with a stem to the object where it floats above it."""
    part = kind.of(panel)
    if part is None:
        return
    center = kind.center(panel)
    points = center + scale * part.surface
    if points.ndim == 3:
        quads = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], 2)
        quads = quads.reshape(-1, 4, 3)
        normals = np.zeros_like(quads[:, 0])
        world = list(part.world)
        normals[:, world] = (quads.mean(axis=1) - center)[:, world] @ part.ellipsoid.gram
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        polygons.clear(quads, kind.color, look.opacity, normals)
    else:
        ax.plot(*points.T, color=kind.color, linewidth=3.5)
        fan = [np.array([center, *ends]) for ends in pairwise(points)]
        polygons.clear(fan if len(points) > 2 else [], kind.color, look.opacity)
    if kind.lift:
        stem = np.array([panel.posture.object.position, center])
        ax.plot(*stem.T, color=kind.color, linewidth=1, linestyle=":", zorder=ON_TOP)


def outline_slice(ax: Any, panel: Panel, kind: SliceKind, scale: float) -> None:
    """The slice of another panel as an outline."""
    part = kind.of(panel)
    if part is None:
        return
    grid = np.moveaxis(kind.center(panel) + scale * part.surface, -1, 0)
    if grid.ndim == 3:
        ax.plot_wireframe(*grid, color=LOOK.ink, linewidth=0.5, rstride=4, cstride=4)
    else:
        ax.plot(*grid, color=LOOK.ink, linewidth=1.2, linestyle="--")
