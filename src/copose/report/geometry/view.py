"""Views of scenes in space, and the axes that they are drawn in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from copose.poses import Array


@dataclass(frozen=True)
class View:
    """The direction that a scene is seen from."""

    elevation: float = 18.0  # above the horizon, degrees
    azimuth: float = -62.0  # about the vertical, from x, degrees

    @property
    def axes(self) -> Array:
        """Unit vectors to the right, up and towards the eye, (3, 3), as from afar."""
        elevation, azimuth = np.radians((self.elevation, self.azimuth))
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        flat = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        to_eye = np.cos(elevation) * flat + np.array([0.0, 0.0, np.sin(elevation)])
        return np.array([right, np.cross(to_eye, right), to_eye])


def roomy(points: Array) -> tuple[Array, Array]:
    """The box around points, (k, 3), with a margin; a flat one is made thicker to be drawn in."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    thin = np.maximum(0.35 * size - (high - low), 0.0) / 2
    return low - thin - 0.03 * size, high + thin + 0.03 * size


def frame(
    ax: Any, low: Array, high: Array, labels: Sequence[str], view: View, *, whole: bool = False
) -> None:
    """Axes from low to high at one scale.

    A tall box is drawn smaller, and with ``whole`` any, so that labels stay within the panel.
    """
    width, depth, height = high - low
    tall = height / max(width, depth)
    zoom = min(1.0 if whole else 1.08, (1.2 / tall) ** 0.5)
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_zlim(low[2], high[2])
    ax.set_box_aspect(high - low, zoom=zoom)
    ax.view_init(elev=view.elevation, azim=view.azimuth)
    ax.locator_params(nbins=4)
    ax.tick_params(labelsize=8, pad=-1)
    ax.set_xlabel(labels[0], labelpad=0)
    ax.set_ylabel(labels[1], labelpad=-2)
    ax.set_zlabel(labels[2], labelpad=1)
