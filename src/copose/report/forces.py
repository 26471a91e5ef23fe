"""Contact forces as arrows."""

from __future__ import annotations

import numpy as np

from copose.poses import Array
from copose.report.style import three
from copose.results import Posture


def holding_arrows(posture: Posture, length: float) -> tuple[list[tuple[Array, Array]], str]:
    """The contact forces on the object that hold it, from tail to head at the grasp, in words.

    Args:
        posture: with the contact wrenches of its hold; without there are no arrows.
        length: of the largest, m.
    """
    wrenches = (posture.wrenches or {}).get("hold", {})
    size = len(posture.object.position)
    forces = {arm: np.array(each.wrench[:size]) for arm, each in wrenches.items()}
    largest = max((float(np.linalg.norm(force)) for force in forces.values()), default=0.0)
    if not largest:
        return [], ""
    arrows = []
    for arm, force in forces.items():
        head = np.array(posture.arms[arm].grasp[:size])
        arrows.append((head - force * (length / largest), head))
    return arrows, f"contact forces holding it, up to {three(largest)} N"
