"""Charts of what torque limits allow: exact sets of accelerations, and shares of the limits."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from copose.capability import Ellipsoid
from copose.poses import Array
from copose.problem import SPACES
from copose.report.charts.legends import legend_below
from copose.report.geometry.camera import View, frame, roomy
from copose.report.geometry.hulls import Hull
from copose.report.geometry.slices import Slice
from copose.report.look import LOOK, arm_colors
from copose.report.panels import Panel
from copose.report.words import (
    ANGULAR_AXES,
    LINEAR_AXES,
    acceleration_unit,
    largest_share,
    percent,
    short,
    three,
)
from copose.results import ExactSetRecord


class Label(StrEnum):
    """Entries of the legend."""

    SET = "exact set"
    ELLIPSOID = "ellipsoid within it"
    BALL = "largest ball around rest"
    REST = "rest"
    CENTER = "centre: zero torque"


@dataclass(frozen=True, eq=False)
class SetPicture:
    """An exact set of linear or of angular accelerations, in its own coordinates."""

    name: str  # linear or angular
    record: ExactSetRecord
    others: bool  # whether other accelerations are zero in it

    @property
    def color(self) -> str:
        """The colour of its ellipsoid."""
        return LOOK.system if self.name == "linear" else LOOK.angular

    @property
    def solid(self) -> bool:
        """True where it needs axes in space."""
        return len(self.record.axes) == 3

    @property
    def title(self) -> str:
        """The title: kind, unit, and the ball around rest."""
        record, zero = self.record, "others zero; " if self.others else ""
        ball = f"ball of radius {three(record.residual_radius)} around rest"
        if not record.vertices:
            ball = "none is within the torque limits"
        elif not record.residual_radius:
            ball = "rest is outside"
        unit = acceleration_unit(record.axes)
        return f"exact set of {self.name} accelerations, {unit}\n{zero}{ball}"

    @property
    def world(self) -> list[int]:
        """The coordinate of the picture that each coordinate of the set is."""
        axes = self.record.axes
        if not self.solid:
            return list(range(len(axes)))
        return [(LINEAR_AXES | ANGULAR_AXES)[axis] for axis in axes]

    @property
    def names(self) -> list[str]:
        """Names of the picture's coordinates."""
        return [self.record.axes[self.world.index(i)] for i in range(len(self.world))]

    @property
    def corners(self) -> Array:
        """Corners of the set in the picture's coordinates, (k, a)."""
        points = np.array(self.record.vertices).reshape(-1, len(self.world))
        return points[:, np.argsort(self.world)]

    @property
    def ellipsoid(self) -> Ellipsoid | None:
        """The ellipsoid in the picture's coordinates; None where there is none."""
        ellipsoid = self.record.ellipsoid.value
        return None if ellipsoid is None else ellipsoid.sliced(np.argsort(self.world).tolist())

    def surface(self, ellipsoid: Ellipsoid) -> Array:
        """Points of the ellipsoid's surface, (…, a), as `Slice` has them."""
        around = Slice(ellipsoid, tuple(range(len(self.world)))).surface
        return np.asarray(ellipsoid.center + around[..., : len(self.world)])


def set_pictures(panels: list[Panel]) -> list[SetPicture]:
    """The exact sets of a picture of one posture that holds the object."""
    panel = panels[0]
    if len(panels) > 1 or panel.misses:
        return []
    space = SPACES[panel.solution.problem.space]
    records = panel.posture.exact_sets or {}
    return [
        SetPicture(name, record, set(record.axes) != set(space.coordinates))
        for name, record in records.items()
    ]


def draw_set(figure: Figure, place: SubplotSpec, picture: SetPicture, columns: int) -> None:
    """A set, its ellipsoid, the ball around rest, rest and the ellipsoid's centre, in a place of a
    figure; a legend has some columns, 0 for none.
    """
    height = 0.96 if picture.solid else None
    if not picture.solid:
        # Room for labels and legend, which axes in space have within them.
        rooms = place.subgridspec(
            3, 2, height_ratios=[0.03, 1, 0.1], width_ratios=[0.08, 1], hspace=0, wspace=0
        )
        place = rooms[1, 1]
    if not picture.record.vertices:
        nothing = figure.add_subplot(place)
        nothing.set_title(picture.title, loc="left", y=height)
        nothing.set_axis_off()
        return
    ax: Any = figure.add_subplot(place, projection="3d" if picture.solid else None)
    ax.tick_params(labelsize=8)
    {1: _interval, 2: _polygon, 3: _solid}[len(picture.world)](ax, picture)
    ax.set_title(picture.title, loc="left", y=height)
    if columns:
        handles, labels = ax.get_legend_handles_labels()
        if picture.solid:
            # Faces and surfaces have no entries of their own.
            patches = {Label.SET: (LOOK.exact_set, 0.4), Label.ELLIPSOID: (picture.color, 0.9)}
            if picture.ellipsoid is None:
                del patches[Label.ELLIPSOID]
            handles = [*(Patch(color=color) for color in patches.values()), *handles]
            labels = [*patches, *labels]
        legend_below(ax, handles, labels, columns=columns, points=8 if picture.solid else 36)


def _interval(ax: Any, picture: SetPicture) -> None:
    """A set with one axis: a bar, the ellipsoid's part of it, and the ball as a bracket."""
    ends, radius = picture.corners, picture.record.residual_radius
    ax.fill_between(ends[:, 0], -1, 1, color=LOOK.exact_set, alpha=0.3, label=Label.SET)
    if picture.ellipsoid is not None:
        inner = picture.surface(picture.ellipsoid)[:, 0]
        ax.fill_between(inner, -0.5, 0.5, color=picture.color, alpha=0.6,
                        label=Label.ELLIPSOID)  # fmt: skip
    if radius:
        ax.plot([-radius, radius], [0, 0], color=LOOK.ink, linestyle=":", marker="|",
                markersize=14, label=Label.BALL)  # fmt: skip
    _points(ax, picture)
    ax.set_ylim(-1.5, 1.5)
    ax.set_yticks([])
    ax.set_box_aspect(0.25)
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.set_xlabel(_labels(picture)[0])


def _polygon(ax: Any, picture: SetPicture) -> None:
    """A set with two axes: polygon, ellipse and circle."""
    ax.grid(True, color=LOOK.grid, linewidth=0.8)
    ax.set_axisbelow(True)
    ax.fill(*picture.corners.T, facecolor=(LOOK.exact_set, 0.3), edgecolor=LOOK.exact_set,
            linewidth=1.8, label=Label.SET)  # fmt: skip
    if picture.ellipsoid is not None:
        curve = picture.surface(picture.ellipsoid)
        ax.fill(*curve.T, facecolor=(picture.color, 0.45), edgecolor=picture.color,
                linewidth=1.8, label=Label.ELLIPSOID)  # fmt: skip
    if picture.record.residual_radius:
        ax.plot(*picture.record.residual_radius * _circle().T, color=LOOK.ink, linewidth=1.4,
                linestyle=":", label=Label.BALL)  # fmt: skip
    _points(ax, picture)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel(_labels(picture)[0])
    ax.set_ylabel(_labels(picture)[1])


def _solid(ax: Any, picture: SetPicture) -> None:
    """A set with three axes: the polyhedron's back, ellipsoid, its front, outline of the ball."""
    ax.computed_zorder = False
    ax.set_proj_type("ortho")
    seen = View()
    view = seen.axes
    points = [np.zeros((1, 3)), picture.corners]
    solid = Hull.of(picture.corners)
    if solid is not None:
        _shell(ax, solid, view)
    if picture.ellipsoid is not None:
        surface = picture.surface(picture.ellipsoid)
        points.append(surface.reshape(-1, 3))
        normals = (surface - picture.ellipsoid.center) @ picture.ellipsoid.gram
        bright = _lit(normals, view, 0.6)[..., None] * to_rgb(picture.color)
        ax.plot_surface(*np.moveaxis(surface, -1, 0), facecolors=bright, shade=False, linewidth=0,
                        rstride=1, cstride=1, antialiased=False, zorder=3)  # fmt: skip
    radius = picture.record.residual_radius
    if radius:
        circle = radius * _circle() @ view[:2]
        points.append(circle)
        ax.plot(*circle.T, color=LOOK.ink, linewidth=1.3, linestyle=":", zorder=6,
                label=Label.BALL)  # fmt: skip
    _points(ax, picture, zorder=7)
    frame(ax, *roomy(np.vstack(points)), _labels(picture), seen, whole=True)


def _shell(ax: Any, solid: Hull, view: Array, *, sharp: float = 45.0) -> None:
    """A solid that one looks into: its back in shades, its front as a veil with edges.

    Faces that meet at less than a sharp angle, degrees, have a finer edge between them.
    """
    front = solid.normals @ view[2] > 0
    behind = np.flatnonzero(~front)
    # Seen from inside.
    pale = 0.9 * _lit(-solid.normals[behind], view, 0.5)[:, None]
    tints = pale + (1 - pale) * to_rgb(LOOK.exact_set)
    back = Poly3DCollection([solid.faces[k] for k in behind], facecolors=tints, edgecolors=tints,
                            linewidth=0.4, zorder=2)  # fmt: skip
    # In one piece: translucent faces would show their seams.
    rim = solid.outline(view[:2])
    veil = Poly3DCollection([rim], facecolor=LOOK.exact_set, alpha=0.2, zorder=4)
    meeting = front[solid.sides].all(axis=1)
    one, other = solid.normals[solid.sides[meeting].T]
    angles = np.degrees(np.arccos(np.clip(np.sum(one * other, axis=1), -1, 1)))
    edges = Line3DCollection(solid.edges[meeting], colors=LOOK.exact_set, zorder=5,
                             linewidths=0.9 * np.minimum(angles / sharp, 1))  # fmt: skip
    for part in (back, veil, edges):
        # Limits are set by hand, and faces of unequal length have none to tell.
        ax.add_collection(part, autolim=False)
    ax.plot(*np.vstack([rim, rim[:1]]).T, color=LOOK.exact_set, linewidth=1.5, zorder=5)


def _lit(normals: Array, view: Array, least: float) -> Array:
    """Brightness, up to 1, of surfaces in light from the upper left, by their normals, (…, 3)."""
    light = np.array([-0.4, 0.7, 0.7]) @ view
    cosines = normals @ light / np.linalg.norm(light) / np.linalg.norm(normals, axis=-1)
    return np.asarray(least + (1 - least) * np.clip(cosines, 0, 1))


def _labels(picture: SetPicture) -> list[str]:
    """Coordinates with their unit."""
    unit = acceleration_unit(picture.record.axes)
    return [f"{name}, {unit}" for name in picture.names]


def _circle() -> Array:
    """Points of the unit circle, (k, 2)."""
    angle = np.linspace(0, 2 * np.pi, 181)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _points(ax: Any, picture: SetPicture, **more: Any) -> None:
    """Rest and the ellipsoid's centre."""
    rest = np.zeros((max(len(picture.world), 2), 1))
    ax.plot(*rest, linestyle="", marker="o", markersize=7, color=LOOK.ink,
            markeredgecolor="white", label=Label.REST, **more)  # fmt: skip
    if picture.ellipsoid is not None:
        center = rest.copy()
        center[: len(picture.world), 0] = picture.ellipsoid.center
        ax.plot(*center, linestyle="", marker="P", markersize=9, color="white",
                markeredgecolor=LOOK.ink, label=Label.CENTER, **more)  # fmt: skip


@dataclass(frozen=True)
class ShareLook:
    """Sizes of a chart of shares."""

    narrow: float = 0.3  # width of bars below which their values are written upwards, inches
    letters: int = 12  # letters of an arm's name to an inch
    bar: float = 0.92  # width of a bar, as a share of its place
    between: float = 0.8  # between two arms, in places of joints


def share_panels(panels: list[Panel]) -> list[Panel]:
    """Panels whose posture states the torques that hold the object; none beside a nearest miss."""
    if any(panel.misses for panel in panels):
        return []
    return [panel for panel in panels if panel.posture.static_torque]


def draw_shares(ax: Axes, panels: list[Panel], *, named: bool) -> None:
    """Each joint's share of its torque limit to hold the object, by arm; earlier panels in grey,
    and told apart by a legend where they are named.
    """
    shares = [panel.posture.static_torque or {} for panel in panels]
    colors = arm_colors(panels[-1].posture)
    width = ShareLook.between / len(panels)
    count = sum(map(len, shares[0].values())) + ShareLook.between * len(shares[0])
    inches = ax.get_window_extent().width / ax.get_figure().dpi  # type: ignore[union-attr]
    upwards = inches / count * width < ShareLook.narrow
    ticks: list[float] = []
    start = 0.0
    for arm, color in colors.items():
        joints = [start + i for i in range(len(shares[0][arm]))]
        ticks += joints
        for k, by_arm in enumerate(shares):
            places = [x + (k - (len(panels) - 1) / 2) * width for x in joints]
            _draw_bars(ax, places, by_arm[arm], width * ShareLook.bar, upwards=upwards,
                       color=color if k + 1 == len(panels) else LOOK.before)  # fmt: skip
        letters = int(ShareLook.letters * (len(joints) + ShareLook.between) * inches / count)
        ax.text(
            (joints[0] + joints[-1]) / 2, -0.2, short(f"arm {arm}", max(3, min(24, letters))),
            ha="center", va="top", transform=ax.get_xaxis_transform(), fontsize=9, color=color,
        )  # fmt: skip
        start = joints[-1] + 1.8
    ax.axhline(100, color=LOOK.over, linewidth=1.2, linestyle="--")
    ax.text(1, 100, "limit", transform=ax.get_yaxis_transform(), ha="right", va="bottom",
            fontsize=8, color=LOOK.over)  # fmt: skip
    highest = max(100.0, *(100 * largest_share(by_arm) for by_arm in shares))
    ax.set_ylim(0, 1.25 * highest)
    ax.set_xlim(-0.8, start - 0.6)
    numbers = [str(i + 1) for joints in shares[0].values() for i in range(len(joints))]
    ax.set_xticks(ticks, numbers)
    ax.set_yticks([])
    ax.tick_params(axis="x", labelsize=8, length=0)
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.set_title("joint torque that holds the object, % of its limit", fontsize=10, loc="left")
    if named:
        names = [short(panel.name) for panel in panels]
        shown = [LOOK.before] * (len(panels) - 1) + [next(iter(colors.values()))]
        patches = [Patch(color=color) for color in shown]
        ax.legend(patches, names, frameon=False, fontsize=9, loc="lower right",
                  bbox_to_anchor=(1, 0.98), ncols=len(panels), borderaxespad=0.1)  # fmt: skip


def _draw_bars(
    ax: Axes, places: list[float], shares: tuple[float, ...], width: float, *, upwards: bool,
    color: str,
) -> None:  # fmt: skip
    """The bars of one arm in one panel, with their values on white: red above the limit."""
    bars = ax.bar(places, [100 * share for share in shares], width, color=color)
    white = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
    words = ax.bar_label(bars, list(map(percent, shares)), fontsize=8, padding=2,
                         rotation=90 if upwards else 0, bbox=white)  # fmt: skip
    for text, share in zip(words, shares, strict=True):
        if share > 1:
            text.set(color=LOOK.over, fontweight="bold")
