"""Why no posture keeps the torque limits: which joint gives way, and what would be possible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.planning.cell import Cell
from copose.planning.limits_measures import Payload
from copose.planning.machinery import Machinery
from copose.planning.search import EFFORTS, search
from copose.poses import Array


@dataclass(frozen=True, eq=False)
class Heaviest:
    """The postures of a cell that hold the most.

    Attributes:
        q: stacked joints, (count, N), that of the largest mass first.
        mass: kg that the first holds, None where no posture holds anything.
        reason: a sentence on a cell in which no posture holds the object at rest: a joint's share
            of its limit is the largest in the first posture with the object as it is.
    """

    q: Array
    mass: float | None
    reason: str


def heaviest(cell: Cell, seed: int) -> Heaviest:
    """Search for them."""
    assert cell.torque_limits is not None
    constraints = cell.problem.constraints.model_copy(update={"static_torque": False})
    free = cell.under(constraints)
    rest = np.zeros(cell.problem.space.m)
    machinery = Machinery(free, Payload(cell.torque_limits, rest, cell.problem.space))
    setting = machinery.setting(free)
    found = search(machinery, setting, seed, EFFORTS["normal"], lambda what, done: None)
    nothing = "no posture holds the object at rest within the torque limits"
    q = np.array([optimum.q for optimum in found.optima])
    if len(q) == 0 or setting.holding is None or machinery.capacity is None:
        return Heaviest(q, None, f"{nothing} and those of contact wrenches, however light it is")
    best = found.optima[0]
    parts = [mine[None] for mine in cell.system.split(best.q)]
    hold = machinery.capacity.dynamics(setting.holding, parts).hold(setting.holding.hold)
    if hold is None:
        return Heaviest(q, best.objective, f"{nothing} and those of contact wrenches")
    shares = np.concatenate(
        [np.abs(t) / T for t, T in zip(hold.torques, cell.torque_limits, strict=True)]
    )
    names = [f"{arm.name}/{joint.name}" for arm in cell.arms for joint in arm.joints]
    # Several give way at once; rounding must not choose between them.
    worst = int(np.argmax(shares >= shares.max() - 1e-6))
    possible = f"a mass of {best.objective:.4g} kg would be possible"
    if best.objective <= 0:
        possible = "the arms cannot even hold themselves"
    reason = (
        f"{nothing}: joint {names[worst]} gives way, at best with {shares[worst]:.3g} times its "
        f"limit; {possible}"
    )
    return Heaviest(q, best.objective, reason)
