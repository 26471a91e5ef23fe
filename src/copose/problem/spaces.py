"""The four task spaces: which of the six components of a twist or wrench count."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

SpaceName: TypeAlias = Literal["spatial", "spatial-linear", "planar", "planar-linear"]


@dataclass(frozen=True)
class Space:
    """A task space as a choice of rows of the spatial twist [vx vy vz ωx ωy ωz].

    Attributes:
        name: as written in a problem file.
        rows: the rows that are tasks; m = len(rows).
        coordinates: their names.
        planar: whether everything moves in the x-y plane.
    """

    name: SpaceName
    rows: tuple[int, ...]
    coordinates: tuple[str, ...]
    planar: bool

    @property
    def m(self) -> int:
        """Dimension of the task."""
        return len(self.rows)

    @property
    def linear(self) -> tuple[int, ...]:
        """Indices, within the task vector, of the linear components."""
        return tuple(i for i, row in enumerate(self.rows) if row < 3)

    @property
    def angular(self) -> tuple[int, ...]:
        """Indices, within the task vector, of the angular components."""
        return tuple(i for i, row in enumerate(self.rows) if row >= 3)

    @property
    def balance(self) -> tuple[int, ...]:
        """Rows of a wrench that must balance for the object not to spin: moments too, though ball
        joints and hinges transmit none; in the plane the moment about its normal.
        """
        return (0, 1, 5) if self.planar else (0, 1, 2, 3, 4, 5)

    @property
    def rigid(self) -> bool:
        """True where a contact transmits moments too: the grasp fixes the tip's orientation."""
        return bool(self.angular)


SPACES: dict[str, Space] = {
    space.name: space
    for space in (
        Space("spatial", (0, 1, 2, 3, 4, 5), ("x", "y", "z", "roll", "pitch", "yaw"), False),
        Space("spatial-linear", (0, 1, 2), ("x", "y", "z"), False),
        Space("planar", (0, 1, 5), ("x", "y", "angle"), True),
        Space("planar-linear", (0, 1), ("x", "y"), True),
    )
}
