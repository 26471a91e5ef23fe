"""Why no posture keeps the torque limits: which joint gives way, and what would be possible."""

from __future__ import annotations

import numpy as np

from copose.planning.cell import Cell
from copose.planning.limits_measures import HeldMass
from copose.planning.machinery import Machinery
from copose.planning.search import EFFORTS, search


def too_heavy(cell: Cell, seed: int) -> str:
    """A sentence on a cell in which no posture holds the object at rest.

    The posture that holds the most is searched for; there, with the object as it is, a joint's
    share of its limit is the largest.
    """
    assert cell.torque_limits is not None
    constraints = cell.problem.constraints.model_copy(update={"static_torque": False})
    free = cell.under(constraints)
    machinery = Machinery(free, HeldMass(cell.torque_limits, cell.problem.space))
    setting = machinery.setting(free)
    found = search(machinery, setting, seed, EFFORTS["normal"], lambda what, done: None)
    nothing = "no posture holds the object at rest within the torque limits"
    if not found.optima or setting.holding is None or machinery.capacity is None:
        return f"{nothing} and those of contact wrenches, however light it is"
    best = found.optima[0]
    parts = [mine[None] for mine in cell.system.split(best.q)]
    dynamics = machinery.capacity.dynamics(setting.holding, parts)
    hold = dynamics.hold(setting.holding.hold)
    if hold is None:
        return f"{nothing} and those of contact wrenches"
    shares = np.concatenate(
        [np.abs(t) / T for t, T in zip(hold.torques, cell.torque_limits, strict=True)]
    )
    names = [f"{arm.name}/{joint.name}" for arm in cell.arms for joint in arm.joints]
    # Several give way at once; rounding must not choose between them.
    worst = int(np.argmax(shares >= shares.max() - 1e-6))
    possible = f"a mass of {best.objective:.4g} kg would be possible"
    if best.objective <= 0:
        possible = "the arms cannot even hold themselves"
    return (
        f"{nothing}: joint {names[worst]} gives way, at best with {shares[worst]:.3g} times its "
        f"limit; {possible}"
    )
