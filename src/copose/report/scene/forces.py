"""Contact forces as arrows."""

from __future__ import annotations

import numpy as np

from copose.poses import Array
from copose.report.style import three
from copose.results import Posture

# The largest force drawn, as a share of the scene.
_LONGEST = 0.16


def holding_arrows(posture: Posture, size: float) -> tuple[list[tuple[Array, Array]], str]:
    """The contact forces on the object that hold it, from tail to head at the grasp, in words.

    Args:
        posture: with the contact wrenches of its hold; without there are no arrows.
        size: of the scene, m.
    """
    wrenches = (posture.wrenches or {}).get("hold", {})
    d = len(posture.object.position)
    forces = {arm: np.array(each.wrench[:d]) for arm, each in wrenches.items()}
    largest = max((float(np.linalg.norm(force)) for force in forces.values()), default=0.0)
    if not largest:
        return [], ""
    arrows = []
    for arm, force in forces.items():
        head = np.array(posture.arms[arm].grasp[:d])
        arrows.append((head - force * (_LONGEST * size / largest), head))
    return arrows, f"contact forces holding it, up to {three(largest)} N"
