"""Arms in a scene, links below the frames that move them; hands, and the grasps that they miss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from copose.poses import Array, Pose
from copose.report.look import LOOK
from copose.results import PlanarPlace, Posture
from copose.results.posture import SpatialFrame
from copose.robots import Arm
from copose.viewer.looks import Look
from copose.viewer.names import node, rgb
from copose.viewer.surfaces.light_surfaces import creased
from copose.viewer.surfaces.triangles import cylinder, turned_to

if TYPE_CHECKING:
    from viser import FrameHandle, MeshHandle, SceneApi


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
                opacity=ArmLook.ghost if ghost else None,
                side="front" if ghost else "double",
                cast_shadow=not (ghost or planar),
                receive_shadow=False,
            )
        if planar and not ghost:
            pin = creased(cylinder(ArmLook.pin, ArmLook.pin_length))
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


def object_pose(posture: Posture) -> Pose:
    """The pose of the object in the world, T_world_object."""
    place = posture.object
    if isinstance(place, PlanarPlace):
        return _planar(place)
    return Pose.from_quaternion(place.position, place.quaternion)


def frame_pose(frame: SpatialFrame | PlanarPlace) -> Pose:
    """The pose of a base or a grasp."""
    if isinstance(frame, PlanarPlace):
        return _planar(frame)
    return Pose.from_rpy(frame.position, frame.rpy)


def _planar(place: PlanarPlace) -> Pose:
    return Pose.from_rpy((*place.position, 0.0), (0.0, 0.0, place.angle))


@dataclass(frozen=True)
class FrameLook:
    """Sizes of the axes of a frame."""

    length: float = 0.06  # as a share of the scene
    radius: float = 0.045  # as a share of the length
    origin: float = 0.07  # radius of the origin, as a share of the length


class Hands:
    """The hands of a cell and where they are to hold the object.

    Nodes: ``/arms/NAME/tip/axes``, ``/grasps/NAME``, and ``/gaps/NAME`` between the two. A grasp
    that does not fix a hand's orientation has no axes to show.
    """

    def __init__(self, scene: SceneApi, arms: Sequence[Arm], *, rigid: bool) -> None:
        self._arms = tuple(arms)
        self._size = 1.0
        self._grasps: dict[str, FrameHandle] = {}
        self._tips: dict[str, FrameHandle] = {}
        self._gaps: dict[str, MeshHandle] = {}
        stick = cylinder(1.0, 1.0)
        for name in (arm.name for arm in arms):
            self._grasps[name] = scene.add_frame(node("grasps", name), show_axes=rigid)
            self._tips[name] = scene.add_frame(node("arms", name, "tip", "axes"))
            self._gaps[name] = scene.add_mesh_simple(
                node("gaps", name),
                stick.vertices,
                stick.faces,
                color=rgb(LOOK.over),
                visible=False,
                cast_shadow=False,
            )

    @property
    def frames(self) -> tuple[FrameHandle, ...]:
        """The axes of all hands and grasps."""
        return (*self._tips.values(), *self._grasps.values())

    def fit(self, size: float) -> None:
        """Give axes and lines their thickness in a scene of a size, m."""
        self._size = size
        for frame in self.frames:
            stretch(frame, size)

    def show(self, posture: Posture, place: Pose) -> None:
        """Move grasps with the object to its pose, and draw lines to them from hands that miss."""
        for arm in self._arms:
            moved = (posture.grasp or {}).get(arm.name)
            grasp = place @ (arm.grasp if moved is None else frame_pose(moved))
            move(self._grasps[arm.name], grasp)
            self._join(arm.name, np.array(posture.arms[arm.name].skeleton[-1]), grasp.position)

    def _join(self, name: str, tip: Array, grasp: Array) -> None:
        """Draw a line from a hand to the grasp that it misses."""
        gap, along = self._gaps[name], grasp - tip
        length = float(np.linalg.norm(along))
        gap.visible = length > 1e-4  # m
        if gap.visible:
            move(gap, Pose.from_rotation(turned_to(along), (tip + grasp) / 2))
            radius = 0.004 * self._size  # A share of the scene.
            gap.scale = (radius, radius, length)


def move(handle: FrameHandle | MeshHandle, pose: Pose) -> None:
    """Place a node."""
    handle.position, handle.wxyz = pose.position, pose.quaternion


def stretch(frame: FrameHandle, size: float) -> None:
    """Give a frame's axes their length in a scene of a size, m."""
    length = FrameLook.length * size
    frame.axes_length, frame.axes_radius = length, FrameLook.radius * length
    frame.origin_radius = FrameLook.origin * length
