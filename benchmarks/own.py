"""copose as the benchmark calls it: all that is asked of `copose.Planner` stands here."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from cases import Case
from programs import End
from truth import Array, truth_of

import copose
from copose.poses import Pose


class Own:
    """A planner of one case, compiled where that is possible and not switched off.

    Attributes:
        build_s: seconds that building took.
        compile_s: seconds that waiting for compiled kernels took after that.
        compiled: whether they are in use.
    """

    def __init__(self, case: Case, effort: str) -> None:
        """Build, and wait for the compiler."""
        self._truth = truth_of(case)
        began = time.perf_counter()
        self._planner = copose.Planner(case.problem)
        self._effort = effort
        self.build_s = time.perf_counter() - began
        began = time.perf_counter()
        self.compiled = bool(self._planner.compile())
        self.compile_s = time.perf_counter() - began

    def search(self, seed: int) -> tuple[dict[str, Any] | None, float]:
        """A global search: joints by arm, None where it is not solved, and its seconds."""
        solution = self._planner.solve(seed=seed, effort=self._effort)
        joints = solution.after.joints if solution.status == "solved" else None
        return joints, solution.timing.search_s

    def local_solve(
        self, start: Array, object_pose: Pose | None = None, warm: End | None = None
    ) -> tuple[End, float]:
        """A local solve from stacked joints or from an earlier end, and its seconds."""
        begin = start if warm is None else warm.q
        place = None
        if object_pose is not None:
            size = len(self._planner.problem.object.position)
            place = {"position": object_pose.position[:size].tolist()}
        began = time.perf_counter()
        end = self._planner.polish(self._truth.split(begin), object_pose=place)
        spent = time.perf_counter() - began
        q = np.concatenate([end.joints[name] for name in self._truth.names])
        return End(q, end.converged, ""), spent

    def measure(self, postures: dict[str, Array]) -> Array:
        """Objectives of many postures, (count,)."""
        return np.asarray(self._planner.measure(postures).objective)
