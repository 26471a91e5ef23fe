"""Light: from all sides, mostly from above, and some from where a page first looks from."""

from __future__ import annotations

from typing import TYPE_CHECKING

from copose.poses import Array
from copose.viewer.names import node

if TYPE_CHECKING:
    from viser import SceneApi

# Brightness of light from all sides.
_AROUND = 1.5
# Colour of what comes from below, 0 to 255.
_GROUND = 150
# Brightness of light from beside the eye.
_FRONT = 1.3
# How far away that is, m; its direction alone counts.
_FAR = 30.0
# How far beside the eye, and above it, it comes from, as shares of that.
_ASIDE = 0.45


def light(scene: SceneApi, *, planar: bool) -> None:
    """Light a scene without pictures of surroundings, which cost most of a page's drawing."""
    scene.configure_environment_map(None)
    scene.configure_default_lights(cast_shadow=not planar)
    scene.add_light_hemisphere(
        node("lights", "around"), ground_color=(_GROUND, _GROUND, _GROUND), intensity=_AROUND
    )


def light_from(scene: SceneApi, right: Array, up: Array, toward: Array) -> None:
    """Light a scene from beside an eye.

    Args:
        scene: which.
        right: of the eye's picture, unit, (3,); ``up`` and ``toward`` the eye alike.
        up: see there.
        toward: see there.
    """
    x, y, z = _FAR * (toward + _ASIDE * (up - right))
    scene.add_light_directional(
        node("lights", "front"), intensity=_FRONT, position=(float(x), float(y), float(z))
    )
