"""Paths among bodies: what keeping clear costs, and whether it is kept at every time.

    python benchmarks/path_collision.py [--paths 5] [--checked 20] [--output FILE]

Random straight carries of two Pandas and of two xArm7 among obstacles. Times are the processor's,
of a plan with collision over one without, in one process, planners built and kernels compiled; the
least of three each. Then random straight carries of two Pandas with a box or a ball near the way:
the least distance of the bodies at 50 times in every interval between knots, asked of coal directly
on the original meshes, where Pinocchio has the links. Writes a page of Markdown.
"""

from __future__ import annotations

import argparse
import copy
import time
from pathlib import Path
from typing import Any

import numpy as np
from cases import case
from collision import obstacle, without

import copose
from copose.paths import PathPlanner
from copose.results import Motion

HERE = Path(__file__).parent
CLEARANCE = 0.01
REPEATS = 3


def carry(robot: str, seed: int, obstacles: int = 3) -> dict[str, Any]:
    """Two arms, and an object that goes straight from about where the shipped problem has it."""
    rng = np.random.default_rng([seed, len(robot), 7])
    tables = copy.deepcopy(dict(case({"panda": "two-panda-box", "xarm7": "xarm-bar"}[robot]).tables))
    middle, drawn = np.array(tables["object"]["position"]), rng.uniform(-0.15, 0.15, 3)
    turn = float(rng.uniform(-0.2, 0.2))
    tables["path"] = {
        "waypoints": [
            {"position": [*(middle - drawn)], "rpy": [0.0, 0.0, -turn]},
            {"position": [*(middle + drawn)], "rpy": [0.0, 0.0, turn]},
        ],
        "duration": 2.0,
    }
    tables["obstacles"] = [obstacle(robot, k, rng) for k in range(obstacles)]
    tables["constraints"] = {"collision": True, "clearance": CLEARANCE}
    return tables


def seconds(tables: dict[str, Any]) -> tuple[float, Motion]:
    """What a plan takes of the processor, and the motion."""
    planner = PathPlanner(copose.parse(tables))
    planner.compile()
    motion, spent = planner.plan(), []
    for _ in range(REPEATS):
        began = time.process_time()
        planner.plan()
        spent.append(time.process_time() - began)
    return min(spent), motion
