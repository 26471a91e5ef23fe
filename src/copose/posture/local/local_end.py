"""One local solve from a posture, without a search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.setting import Setting
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True, eq=False)
class LocalEnd:
    """End of a local solve.

    Attributes:
        joints: rad or m, by arm.
        objective: there.
        optimality: scaled error of the optimality conditions, as IPOPT measures it; infinite where
            no climb led anywhere better.
        converged: whether that meets IPOPT's tolerance, 1e-9, with every chain closed.
    """

    joints: dict[str, Array]
    objective: float
    optimality: float
    converged: bool


def local_solve(model: PostureModel, setting: Setting, joints: Sequence[Array]) -> LocalEnd:
    """The local optimum that a posture, by arm (n_i,), leads to once it is closed.

    It takes Newton steps where the objective is smooth and no torque limit matters, else one run of
    IPOPT.
    """
    cell, goals = setting.cell, setting.placement.goals
    q, gaps = [], []
    for i, start in enumerate(joints):
        closed, gap = project(
            model.arms[i], start[None], goals[i], setting.lower[i], setting.upper[i]
        )
        q.append(closed)
        gaps.append(gap[0])
    start = np.hstack(q)
    if model.objective.smooth and not model.feasibility.judged:
        polished = model.polisher(setting).polish(start)
        end, value, error = polished.q[0], polished.value[0], polished.error[0]
        converged = bool(polished.converged[0])
    else:
        from copose.posture.local.nlp_cuts import NlpCuts

        solved = next(NlpCuts(model).solve(setting, start))
        end, error, converged = solved.q, solved.optimality, solved.converged
        value, kept = model.objectives(setting, np.vstack([end, start]))
        if not value >= kept:
            # A step of IPOPT may leave for a worse optimum.
            end, value, error, converged = start[0], kept, np.inf, False
    parts = zip(cell.arms, cell.system.split(cell.all_folded(end)), strict=True)
    return LocalEnd(
        joints={arm.name: part for arm, part in parts},
        objective=float(value),
        optimality=float(error),
        converged=bool(converged and max(gaps) <= CLOSED),
    )
