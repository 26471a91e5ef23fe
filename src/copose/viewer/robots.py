"""Links of arms as nodes of a scene: each hangs on the frame that moves it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from copose.report import style
from copose.results import Posture
from copose.robots import Arm
from copose.viewer.looks import Look
from copose.viewer.meshes import creased
from copose.viewer.names import node
from copose.viewer.solids import cylinder

if TYPE_CHECKING:
    from viser import FrameHandle, SceneApi

# Opacity of ghosts.
_GHOST = 0.22
# Radius of a pin, by which joints of planar arms are told from their links, m.
_PIN = 0.018
# Length of it, m: it looks out of the links.
_LONG = 0.08


class Robots:
    """The arms of a cell, all at once.

    Their frames are nodes, ``/arms/NAME/root``, ``/arms/NAME/joint1`` … and ``/arms/NAME/tip``, on
    which links hang by their own names.

    Args:
        scene: where.
        arms: the arms.
        looks: of their links.
        planar: whether joints are pins in the plane.
        ghost: whether these are only what was before, translucent and under ``/before``.

    Attributes:
        top: the node above them all.
        frames: root, joints and tip of each arm, by name.
    """

    def __init__(
        self,
        scene: SceneApi,
        arms: Sequence[Arm],
        looks: Sequence[Look],
        *,
        planar: bool,
        ghost: bool = False,
    ) -> None:
        top = "before" if ghost else "arms"
        self.top = scene.add_frame(node(top), show_axes=False)
        self.frames: dict[str, list[FrameHandle]] = {}
        for arm in arms:
            names = ["root", *(f"joint{j + 1}" for j in range(arm.n)), "tip"]
            self.frames[arm.name] = [
                scene.add_frame(node(top, arm.name, name), show_axes=False) for name in names
            ]
        colors = style.ARMS * len(arms)
        for look in looks:
            arm = arms[look.carrier.arm]
            frame = self.frames[arm.name][look.carrier.joint + 1]
            scene.add_mesh_simple(
                f"{frame.name}{node(look.name)}",
                look.vertices,
                look.faces,
                color=rgb(style.BEFORE if look.shared or ghost else colors[look.carrier.arm]),
                opacity=_GHOST if ghost else None,
                side="front" if ghost else "double",
                cast_shadow=not (ghost or planar),
                receive_shadow=False,
            )
        if planar and not ghost:
            pin = creased(cylinder(_PIN, _LONG))
            for arm in arms:
                for frame in self.frames[arm.name][1:-1]:
                    scene.add_mesh_simple(
                        f"{frame.name}/pin",
                        pin.vertices,
                        pin.faces,
                        color=(255, 255, 255),
                        cast_shadow=False,
                    )

    def show(self, posture: Posture) -> None:
        """Place all frames as a posture has them."""
        for name, frames in self.frames.items():
            record = posture.arms[name]
            for frame, position, quaternion in zip(
                frames, record.skeleton, record.quaternions, strict=True
            ):
                frame.position = position  # type: ignore[assignment]
                frame.wxyz = quaternion  # type: ignore[assignment]


def rgb(color: str) -> tuple[int, int, int]:
    """Red, green and blue of a colour such as ``#D55E00``, 0 to 255."""
    red, green, blue = bytes.fromhex(color.removeprefix("#"))
    return red, green, blue
