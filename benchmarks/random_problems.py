"""Forty problems of all kinds, drawn by their numbers; every one holds its object by construction.

    python benchmarks/random_problems.py FOLDER        writes them as problem files

Where an object takes several poses, in cases and along paths, a draw counts only where every arm is
closed at all of them, each from the posture before, by the least squares of `sampling.py`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import building
import numpy as np
import pinocchio as pin
from building import Joints, Tables
from cases import PANDA_POSTURE, Case
from sampling import CLOSED, project
from truth import Truth

from cells import toml
from reference import pose

_LINEAR = ["x", "y", "z"]
_DRAWS = 200  # of one problem, until one closes at all its poses
_STEPS = 16  # from one pose to the next
_Made = tuple[Tables, Joints]
_Draw = Callable[[str, int], _Made]


def _cell(*robots: str, **extra: Any) -> _Draw:
    """Robots round an object in space."""
    return lambda name, seed: building.cell(name, robots, seed, **extra)


def _planar(links: int, count: int, space: str, **extra: Any) -> _Draw:
    """Planar arms round a plate."""
    return lambda name, seed: building.planar(name, links, count, seed, space, **extra)


def _opposite(**extra: Any) -> _Draw:
    """Two Pandas on opposite sides of a plate: what ball contacts need to carry its weight."""

    def drawn(name: str, seed: int) -> _Made:
        q = np.array(PANDA_POSTURE) + np.random.default_rng(seed).uniform(-0.4, 0.4, 7)
        task = {"space": "spatial-linear"}
        tables, joints = building.ring(name, "panda", q.tolist(), 2, task=task, **extra)
        for arm in tables["arms"]:
            # Exactly opposite: two forces balance no moment about the line between them.
            grasp = arm["grasp"]
            grasp["position"] = [round(x, 12) + 0.0 for x in grasp["position"]]
        return tables, joints

    return drawn


def _limited(draw: _Draw, torque: float) -> _Draw:
    """Planar arms with torque limits, N·m at the first joint and less towards the tip."""

    def drawn(name: str, seed: int) -> _Made:
        tables, joints = draw(name, seed)
        for arm in tables["arms"]:
            arm["torque_limits"] = [torque / (k + 1) for k in range(len(arm["links"]))]
        return tables | {"world": {"gravity": [0.0, -9.81]}}, joints

    return drawn


def _objective(kind: str, **more: Any) -> Tables:
    return {"objective": {"kind": kind, **more}}


def _towards(*directions: list[float]) -> Tables:
    weighted = [{"direction": each, "weight": 1.0} for each in directions]
    return _objective("task-compatibility", directions=weighted)


def _free(draw: _Draw, what: str, *arms: int, **ranges: list[float]) -> _Draw:
    """The object, or bases or grasps of arms by number, free within ranges."""

    def drawn(name: str, seed: int) -> _Made:
        tables, joints = draw(name, seed)
        if what == "object":
            tables["object"]["freedom"] = ranges
        for i in arms:
            tables["arms"][i].setdefault("freedom", {})[what] = ranges
        return tables, joints

    return drawn


def _cases(draw: _Draw, count: int, shift: float, **varied: list[Any]) -> _Draw:
    """Cases about the object's pose, all of which close at the drawn bases and grasps."""

    def drawn(name: str, seed: int) -> _Made:
        rng = np.random.default_rng([seed, 1])
        tables, joints = draw(name, seed)
        cases = [{"name": f"case{k + 1}"} | _moved(tables, rng, shift) for k in range(count)]
        for key, values in varied.items():
            for case, value in zip(cases, values, strict=True):
                case[key] = value
        if not all(closes(tables, joints, [case]) for case in cases):
            raise _OpenError
        return tables | {"cases": cases}, joints

    return drawn


def _path(draw: _Draw, shift: float, **settings: Any) -> _Draw:
    """A path from the object's pose to another that the arms follow without a jump."""

    def drawn(name: str, seed: int) -> _Made:
        rng = np.random.default_rng([seed, 2])
        tables, joints = draw(name, seed)
        end = _moved(tables, rng, shift)
        if not closes(tables, joints, [end]):
            raise _OpenError
        return tables | {"path": {"waypoints": [{}, end], **settings}}, joints

    return drawn


class _OpenError(Exception):
    """A draw of which some arm does not close."""


def _moved(tables: Tables, rng: np.random.Generator, shift: float) -> Tables:
    """Another pose of the object, up to that far from its own, m and rad."""
    thing = tables["object"]
    off = rng.uniform(-shift, shift, len(thing["position"]))
    place: Tables = {"position": (np.array(thing["position"]) + off).tolist()}
    if "angle" in thing:
        return place | {"angle": thing["angle"] + float(rng.uniform(-shift, shift))}
    return place | {"rpy": (np.array(thing["rpy"]) + rng.uniform(-shift, shift, 3)).tolist()}


def closes(tables: Tables, joints: Joints, places: list[Tables]) -> bool:
    """Whether every arm follows its grasp through poses from a closed posture, within limits."""
    truth = Truth(Case(tables["name"], "", tables))
    q = [np.array([joints[name]]) for name in truth.names]
    for place in places:
        begin, end = truth.reference.object, pose(place)
        for k in range(1, _STEPS + 1):
            truth.place(pin.SE3.Interpolate(begin, end, k / _STEPS))
            for i in range(len(q)):
                q[i], gap = project(truth, i, q[i])
                if gap[0] > CLOSED:
                    return False
    return True


_OPTIMAL = {"ellipsoid": {"resolution": "torque-optimal"}}
_AT_LIMITS = {"ellipsoid": {"resolution": "torque-optimal", "torque_scaling": "limits"}}
_UP, _ASIDE = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
_IN_X, _IN_Y = {"x": [-0.15, 0.15]}, {"y": [-0.2, 0.2]}
_SLICE = {"objective": {"kind": "volume", "axes": _LINEAR}}

# In the order of their numbers: kind, and how one is drawn.
_PROBLEMS: tuple[tuple[str, _Draw], ...] = (
    ("plain", _cell("panda", "panda")),
    ("plain", _cell("xarm7", "xarm7", **_AT_LIMITS)),
    ("plain", _cell("baxter-left", "baxter-right", **_SLICE)),
    ("plain", _cell("ur5", "ur5", **_objective("worst-direction", axes=_LINEAR))),
    ("plain", _cell("panda", "ur5", **_towards(_UP, _ASIDE))),
    ("plain", _cell("talos", "xarm7", **_objective("isotropy", axes=_LINEAR))),
    ("plain", _cell("panda", "xarm7", **_OPTIMAL)),
    ("plain", _cell("kinova", "panda", **_objective("velocity-volume"))),
    ("planar", _planar(4, 2, "planar")),
    ("planar", _planar(3, 2, "planar-linear", **_objective("worst-direction"))),
    ("planar", _planar(4, 2, "planar", constraints={"joint_margin": 0.05})),
    ("three arms", _cell("panda", "panda", "panda", **_SLICE)),
    ("three arms", _cell("panda", "xarm7", "ur5")),
    ("three arms", _planar(4, 3, "planar")),
    ("three arms", _planar(4, 3, "planar-linear", **_objective("worst-direction"))),
    ("ball contacts", _cell("panda", "panda", space="spatial-linear")),
    ("ball contacts", _cell("ur5", "ur5", space="spatial-linear", **_OPTIMAL)),
    ("ball contacts", _opposite(**_objective("acceleration", direction=[0.0, 0.0, 1.0]))),
    ("ball contacts", _opposite(**_objective("payload"))),
    ("acceleration", _cell("panda", "panda", **_objective("acceleration", direction=_UP))),
    ("acceleration", _limited(_planar(4, 2, "planar", **_objective(
        "acceleration", directions=[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])), 60.0)),
    ("payload", _cell("xarm7", "xarm7", **_objective("payload"))),
    ("payload", _cell("ur5", "ur5", **_objective("payload"))),
    ("all-round", _cell("panda", "ur5", **_objective("all-round", axes=_LINEAR))),
    ("all-round", _limited(_planar(4, 2, "planar-linear", **_objective("all-round")), 60.0)),
    ("free base", _free(_cell("panda", "panda"), "base", 1, **_IN_X, **_IN_Y)),
    ("free base", _free(_planar(4, 2, "planar"), "base", 1, **_IN_X, **_IN_Y)),
    ("free grasp", _free(_cell("panda", "xarm7", **_SLICE), "grasp", 0, 1, y=[-0.1, 0.1])),
    ("free grasp", _free(_planar(4, 2, "planar"), "grasp", 1, x=[-0.1, 0.1], twist=[-0.4, 0.4])),
    ("free object", _free(_cell("panda", "panda"), "object", z=[-0.1, 0.1], yaw=[-0.4, 0.4])),
    ("free object", _free(_cell("ur5", "panda", **_towards(_UP)), "object", **_IN_X)),
    ("free object", _free(_planar(4, 2, "planar"), "object", **_IN_X, **_IN_Y,
                          angle=[-0.3, 0.3])),
    ("free object", _free(_planar(3, 2, "planar-linear"), "object", **_IN_X, **_IN_Y)),
    ("cases", _free(_cases(_planar(4, 2, "planar"), 2, 0.1), "base", 1, **_IN_X, **_IN_Y)),
    ("cases", _free(_cases(_planar(4, 2, "planar-linear"), 3, 0.15, weight=[2.0, 1.0, 1.0]),
                    "grasp", 1, x=[-0.1, 0.1], y=[-0.1, 0.1])),
    ("cases", _free(_cases(_cell("panda", "panda", **_towards(_UP)), 2, 0.08,
                           direction=[_UP, _ASIDE]), "base", 1, **_IN_X)),
    ("path", _path(_planar(4, 2, "planar"), 0.15, knots=30)),
    ("path", _path(_cell("panda", "panda"), 0.15, knots=30)),
    ("path", _path(_planar(4, 2, "planar-linear"), 0.15, knots=30, aggregate="worst")),
    ("path", _path(_limited(_planar(4, 2, "planar"), 60.0), 0.15, knots=30, duration="shortest")),
)  # fmt: skip
COUNT = len(_PROBLEMS)


def random_problem(number: int) -> tuple[str, Tables]:
    """Kind and tables of a problem: the first of its draws that closes at all its poses.

    Raises:
        IndexError: there is none of this number.
        RuntimeError: no draw closes.
    """
    kind, draw = _PROBLEMS[number]
    name = f"random-{number:02d}-{kind.replace(' ', '-')}"
    for k in range(_DRAWS):
        try:
            return kind, draw(name, 1000 * number + k)[0]
        except _OpenError:
            continue
    raise RuntimeError(f"{name}: no draw closes")


def written(folder: Path) -> list[Path]:
    """All of them as problem files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number in range(COUNT):
        kind, tables = random_problem(number)
        file = folder / f"{tables['name']}.toml"
        cases = [f"[[cases]]\n{_lines(case)}" for case in tables.pop("cases", [])]
        file.write_text("\n".join([f"# {kind}", toml(tables), *cases]))
        files.append(file)
    return files


def _lines(table: Tables) -> str:
    return "".join(f"{key} = {toml(value, 'x')}\n" for key, value in table.items())


if __name__ == "__main__":
    for problem_file in written(Path(sys.argv[1])):
        print(problem_file)
