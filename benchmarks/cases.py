"""The named problems of the benchmark: those of `problems/` and independent ones.

python benchmarks/cases.py      prints them
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import building
from building import Joints, Tables

import copose
from reference import PROBLEMS

PANDA_POSTURE = [0.0, -0.2, 0.0, -2.0, 0.0, 1.9, 0.8]


@dataclass(frozen=True, eq=False)
class Case:
    """A named problem.

    Attributes:
        name: of the problem.
        what: what it is for, in a line.
        tables: as a problem file has them.
        closed: joints that hold the object by construction, where the problem was built so.
        effort: of the search that is asked to find its optimum.
    """

    name: str
    what: str
    tables: Tables
    closed: Joints | None = None
    effort: str = "normal"

    @property
    def problem(self) -> copose.Problem:
        """The problem as copose reads it."""
        return copose.parse(self.tables)

    @property
    def kind(self) -> str:
        """The objective's."""
        return str(self.tables.get("objective", {}).get("kind", "volume"))


_SHIPPED = {
    "baxter-box": "two arms of one robot, rigid grasps, the best posture at two limits",
    "fast-fine": "planar arms on hinges; fast along one direction, fine along another",
    "panda-carry": "volume of the linear slice",
    "panda-worst": "worst of six mixed directions: two semi-axes meet",
    "paper-fig2": "planar arms on hinges",
    "paper-fig3": "planar arms on hinges",
    "paper-fig4": "three planar arms on hinges",
    "push-x": "planar arms on hinges, one direction",
    "two-panda-box": "two 7-joint arms: dozens of local optima",
    "two-planar-4r": "planar, rigid grasps, joint margin",
    "xarm-bar": "torque-optimal at the torque limits, wide joints",
}


def _objective(kind: str, **more: Any) -> Tables:
    return {"objective": {"kind": kind, **more}}


_LINEAR, _ANGULAR = ["x", "y", "z"], ["roll", "pitch", "yaw"]
_UPWARDS = {"direction": [0, 0, 1], "weight": 1.0}
_SIDEWAYS = {"direction": [1, 0, 0], "weight": -0.4}
_OPTIMAL = {"ellipsoid": {"resolution": "torque-optimal"}}
_AT_LIMITS = {"ellipsoid": {"resolution": "torque-optimal", "torque_scaling": "limits"}}
_NONSQUEEZING = {"ellipsoid": {"load_distribution": "nonsqueezing"}}

_Made = tuple[Tables, Joints]
# By name: what it is for, the effort of its search, how it is built.
_BUILT: dict[str, tuple[str, str, Callable[[str], _Made]]] = {
    "ur5-pair": (
        "6-joint arms: finitely many postures, every joint turns twice",
        "normal",
        lambda name: building.cell(name, ("ur5", "ur5"), 20),
    ),
    "ur10-ur5": (
        "6-joint arms of two sizes, weighted directions",
        "normal",
        lambda name: building.cell(
            name, ("ur10", "ur5"), 4,
            **_objective("task-compatibility", axes=_LINEAR, directions=[_UPWARDS, _SIDEWAYS]),
        ),
    ),
    "kinova-pair": (
        "6-joint arms with continuous joints and tiny inertias",
        "normal",
        lambda name: building.cell(name, ("kinova", "kinova"), 5),
    ),
    "xarm7-pair": (
        "7-joint arms with wide joints: many local optima",
        "normal",
        lambda name: building.cell(name, ("xarm7", "xarm7"), 6),
    ),
    "z1-panda": (
        "a 6-joint arm with a 7-joint one, isotropy of the linear axes",
        "normal",
        lambda name: building.cell(
            name, ("z1", "panda"), 7, **_objective("isotropy", axes=_LINEAR)
        ),
    ),
    "panda-xarm7": (
        "two makes of 7-joint arms, torque-optimal",
        "normal",
        lambda name: building.cell(name, ("panda", "xarm7"), 8, **_OPTIMAL),
    ),
    "pr2-dual": (
        "two arms of one robot with continuous joints",
        "normal",
        lambda name: building.cell(name, ("pr2-left", "pr2-right"), 31),
    ),
    "tiago-dual": (
        "two arms of one robot, torso locked; worst linear direction, torque-optimal at limits",
        "normal",
        lambda name: building.cell(
            name, ("tiago-left", "tiago-right"), 13,
            **_objective("worst-direction", axes=_LINEAR), **_AT_LIMITS,
        ),
    ),
    "talos-xarm7": (
        "a humanoid's arm with narrow joints, nonsqueezing loads",
        "normal",
        lambda name: building.cell(name, ("talos", "xarm7"), 11, **_NONSQUEEZING),
    ),
    "three-robots": (
        "three different arms on one object",
        "normal",
        lambda name: building.cell(name, ("panda", "ur5", "kinova"), 12),
    ),
    "three-planar-plate": (
        "three planar 4-joint arms on one plate, rigid grasps",
        "normal",
        lambda name: building.planar(name, 4, 3, 13, "planar"),
    ),
    "four-pandas-plate": (
        "four 7-joint arms round a plate: 28 joints, symmetric",
        "normal",
        lambda name: building.ring(name, "panda", PANDA_POSTURE, 4),
    ),
    "panda-balls": (
        "ball contacts: four free dimensions an arm, the best posture at four limits",
        "high",
        lambda name: building.cell(name, ("panda", "panda"), 14, space="spatial-linear"),
    ),
    "ur5-balls": (
        "ball contacts: three free dimensions an arm, torque-optimal",
        "high",
        lambda name: building.cell(
            name, ("ur5", "ur5"), 15, space="spatial-linear", **_OPTIMAL
        ),
    ),
    "planar-hinges": (
        "three planar 4-joint arms on hinges, two free dimensions each, worst direction",
        "high",
        lambda name: building.planar(
            name, 4, 3, 16, "planar-linear", **_objective("worst-direction")
        ),
    ),
    "panda-turning": (
        "two 7-joint arms, worst angular direction",
        "normal",
        lambda name: building.cell(
            name, ("panda", "panda"), 17, **_objective("worst-direction", axes=_ANGULAR)
        ),
    ),
}  # fmt: skip

NAMES: tuple[str, ...] = (*_SHIPPED, *_BUILT)
QUICK: tuple[str, ...] = ("two-panda-box", "ur5-pair", "paper-fig4")


@cache
def case(name: str) -> Case:
    """A case by its name.

    Raises:
        KeyError: there is none of this name.
    """
    if name in _SHIPPED:
        tables = tomllib.loads((PROBLEMS / f"{name}.toml").read_text())
        return Case(name, _SHIPPED[name], tables)
    what, effort, build = _BUILT[name]
    tables, closed = build(name)
    return Case(name, what, tables, closed, effort)


def ring_case(count: int) -> Case:
    """``count`` Pandas round a plate, for cost against the number of arms."""
    name = f"ring-{count}"
    tables, closed = building.ring(name, "panda", PANDA_POSTURE, count, radius=0.35)
    return Case(name, f"{count} identical arms round a plate", tables, closed)


def main() -> None:
    """Print the names and what they are for."""
    width = max(map(len, NAMES))
    for name in NAMES:
        one = case(name)
        print(f"{name:{width}}  {one.kind:18}  {len(one.tables['arms'])} arms  {one.what}")


if __name__ == "__main__":
    main()
