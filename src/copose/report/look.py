"""Colours and settings of Matplotlib that all pictures share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from copose.results import Posture


@dataclass(frozen=True)
class PictureLook:
    """The look of all pictures, in colours of Okabe and Ito that people with colour-blindness tell
    apart.
    """

    system: str = "#D55E00"  # the object's linear accelerations by all arms together
    angular: str = "#8B3A8B"  # its angular accelerations
    arms: tuple[str, ...] = (  # arms, in their order
        "#0072B2", "#009E73", "#E69F00", "#56B4E9", "#666666", "#CC79A7", "#999933", "#332288",
    )  # fmt: skip
    held_object: str = "#BBBBBB"
    obstacle: str = "#6E6E6E"
    exact_set: str = "#5F7F9F"
    ink: str = "#222222"  # words and thin lines
    before: str = "#9A9A9A"  # earlier postures, and links that arms share
    over: str = "#C00000"  # limits, and numbers beyond them
    grid: str = "#EEEEEE"
    axes: tuple[str, str, str] = ("#D55E00", "#009E73", "#0072B2")  # x, y, z of a frame
    dashes: Any = (0, (2.2, 1.3))  # line style of ranges and of frames still to be reached

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of Matplotlib, by their keys."""
        return {
            "font.size": 11,
            "axes.titlesize": 11,
            "axes.labelsize": 10,
            "font.family": "sans-serif",
            "svg.hashsalt": "copose",
            "svg.fonttype": "none",
            # Names are not formulas.
            "text.parse_math": False,
        }


LOOK = PictureLook()


def arm_colors(posture: Posture) -> dict[str, str]:
    """Colours of arms, by name."""
    return dict(zip(posture.arms, LOOK.arms * len(posture.arms), strict=False))
