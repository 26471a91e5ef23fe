"""Contact forces as arrows."""

from __future__ import annotations

from typing import Any

import numpy as np

from copose.poses import Array
from copose.report.look import LOOK
from copose.report.words import three
from copose.results import Posture


def holding_arrows(
    posture: Posture, size: float, *, longest: float = 0.16
) -> tuple[list[tuple[Array, Array]], str]:
    """Contact forces that hold the object: arrows from tail to head at the grasp, and in words;
    none where they are not known. The longest is a share of the scene's size, m.
    """
    wrenches = (posture.wrenches or {}).get("hold", {})
    d = len(posture.object.position)
    forces = {arm: np.array(record.wrench[:d]) for arm, record in wrenches.items()}
    largest = max((float(np.linalg.norm(force)) for force in forces.values()), default=0.0)
    if not largest:
        return [], ""
    arrows = []
    for arm, force in forces.items():
        head = np.array(posture.arms[arm].grasp[:d])
        arrows.append((head - force * (longest * size / largest), head))
    return arrows, f"contact forces holding it, up to {three(largest)} N"


def draw_arrows(ax: Any, arrows: list[tuple[Array, Array]], words: str) -> None:
    """Arrows from tail to head, in axes in the plane or in space, with an entry of the legend."""
    for tail, head in arrows:
        if ax.name == "3d":
            ax.quiver(*tail, *(head - tail), color=LOOK.ink, linewidth=1.8, arrow_length_ratio=0.3)
        else:
            ax.annotate("", tuple(head), tuple(tail), zorder=7,
                        arrowprops={"arrowstyle": "-|>", "color": LOOK.ink, "linewidth": 1.8,
                                    "shrinkA": 0, "shrinkB": 0, "mutation_scale": 14})  # fmt: skip
    if arrows:
        ax.plot([], [], color=LOOK.ink, linewidth=1.8, label=words)
