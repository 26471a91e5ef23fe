"""Arms in a scene: links are nodes below the frames that move them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from copose.report.look import LOOK
from copose.results import Posture
from copose.robots import Arm
from copose.viewer.looks import Look
from copose.viewer.names import node, rgb
from copose.viewer.surfaces.light_surfaces import creased
from copose.viewer.surfaces.triangles import cylinder

if TYPE_CHECKING:
    from viser import FrameHandle, SceneApi


@dataclass(frozen=True)
class ArmLook:
    """The look of arms."""

    ghost: float = 0.22  # opacity of the arms of an earlier posture
    pin: float = 0.018  # m, radius of the pins that mark the joints of planar arms
    pin_length: float = 0.08  # m; a pin stands out of the links


class Robots:
    """The arms of a cell in a scene.

    Their frames are nodes, ``/arms/NAME/root``, ``/arms/NAME/joint1`` … and ``/arms/NAME/tip``, on
    which links hang by their own names; those of a ghost, an earlier posture, are translucent and
    under ``/before``. In the plane joints are pins.

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
        look: ArmLook = ArmLook(),
    ) -> None:
        top = "before" if ghost else "arms"
        self.top = scene.add_frame(node(top), show_axes=False)
        self.frames: dict[str, list[FrameHandle]] = {}
        for arm in arms:
            names = ["root", *(f"joint{j + 1}" for j in range(arm.n)), "tip"]
            self.frames[arm.name] = [
                scene.add_frame(node(top, arm.name, name), show_axes=False) for name in names
            ]
        colors = LOOK.arms * len(arms)
        for link in looks:
            arm = arms[link.carrier.arm]
            frame = self.frames[arm.name][link.carrier.joint + 1]
            scene.add_mesh_simple(
                f"{frame.name}{node(link.name)}",
                link.vertices,
                link.faces,
                color=rgb(LOOK.before if link.shared or ghost else colors[link.carrier.arm]),
                opacity=look.ghost if ghost else None,
                side="front" if ghost else "double",
                cast_shadow=not (ghost or planar),
                receive_shadow=False,
            )
        if planar and not ghost:
            pin = creased(cylinder(look.pin, look.pin_length))
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
