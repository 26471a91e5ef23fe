"""Light from all sides, mostly from above, and from beside the eye that first sees a page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from copose.poses import Array
from copose.viewer.names import node

if TYPE_CHECKING:
    from viser import SceneApi


@dataclass(frozen=True)
class LightLook:
    """Brightness, colour and direction of lights."""

    around: float = 1.5  # brightness of light from all sides
    ground: tuple[int, int, int] = (150, 150, 150)  # colour of what comes from below
    front: float = 1.3  # brightness of light from beside the eye
    distance: float = 30.0  # m, of that light; only its direction counts
    aside: float = 0.45  # how far beside and above the eye it is, as a share of its distance


def light(scene: SceneApi, *, planar: bool, look: LightLook = LightLook()) -> None:
    """Light a scene without pictures of surroundings, which cost most of a page's drawing."""
    scene.configure_environment_map(None)
    scene.configure_default_lights(cast_shadow=not planar)
    scene.add_light_hemisphere(
        node("lights", "around"), ground_color=look.ground, intensity=look.around
    )


def light_from(
    scene: SceneApi, right: Array, up: Array, toward: Array, look: LightLook = LightLook()
) -> None:
    """Light a scene from beside an eye.

    Args:
        scene: which.
        right: the direction to the right in the eye's picture, unit, (3,).
        up: the direction up in the picture, unit, (3,).
        toward: the direction towards the eye, unit, (3,).
        look: brightness and distance.
    """
    x, y, z = look.distance * (toward + look.aside * (up - right))
    scene.add_light_directional(
        node("lights", "front"), intensity=look.front, position=(float(x), float(y), float(z))
    )
