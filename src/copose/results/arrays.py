"""Joint positions as arrays, data frames and datasets."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from copose.errors import InputError
from copose.poses import Array

if TYPE_CHECKING:
    import pandas
    import xarray

    from copose.results.motion import Knot, Motion
    from copose.results.posture import Posture
    from copose.results.solution import Solution


def q_names(answer: Solution | Motion) -> tuple[str, ...]:
    """``arm/joint`` of every joint, arms in file order, joints root to tip."""
    return tuple(f"{arm}/{joint}" for arm, names in answer.joint_names.items() for joint in names)


def stacked(parts: dict[str, tuple[float, ...]]) -> Array:
    """Numbers by arm in one row, (N,)."""
    return np.concatenate([np.asarray(part, dtype=float) for part in parts.values()])


def solution_frame(solution: Solution) -> pandas.DataFrame:
    """A row a joint, a column a posture."""
    pandas = package("pandas")
    columns = {name: posture.q for name, posture in _postures(solution).items()}
    return pandas.DataFrame(columns, index=pandas.Index(q_names(solution), name="joint"))


def motion_frame(motion: Motion) -> pandas.DataFrame:
    """A row a knot, by its time, a column a joint."""
    pandas = package("pandas")
    index = pandas.Index(motion.time or (), name="time")
    return pandas.DataFrame(motion.q, index=index, columns=q_names(motion))


def solution_dataset(solution: Solution) -> xarray.Dataset:
    """``q`` by posture and joint."""
    postures = _postures(solution)
    coordinates = {"posture": list(postures), **_joints(solution)}
    q = np.array([posture.q for posture in postures.values()])
    variables = {"q": (("posture", "joint"), q)}
    return package("xarray").Dataset(variables, coordinates)


def motion_dataset(motion: Motion) -> xarray.Dataset:
    """Numbers of a motion's knots, by time and by time and joint; NaN where there are none."""
    by_joint = ("time", "joint")
    knots: tuple[Knot, ...] = motion.knots or ()
    none = np.full(len(q_names(motion)), np.nan)
    torque = [none if knot.torque is None else stacked(knot.torque) for knot in knots]
    variables = {
        "q": (by_joint, motion.q),
        "velocity": (by_joint, np.array([stacked(knot.velocity) for knot in knots])),
        "acceleration": (by_joint, np.array([stacked(knot.acceleration) for knot in knots])),
        "torque": (by_joint, np.array(torque)),
        "objective": ("time", np.array([knot.objective for knot in knots], dtype=float)),
    }
    coordinates = {"time": list(motion.time or ()), **_joints(motion)}
    return package("xarray").Dataset(variables, coordinates)


def positions(motion: Motion) -> Array:
    """Joint positions of all knots, (K, N).

    Raises:
        InputError: nothing moves.
    """
    if motion.knots is None:
        raise InputError(f"no motion, it is {motion.status}: {motion.reason}")
    return np.array([knot.q for knot in motion.knots])


def _postures(solution: Solution) -> dict[str, Posture]:
    if solution.cases:
        return {case.name: case for case in solution.cases}
    both = {"before": solution.before, "after": solution.after}
    return {name: posture for name, posture in both.items() if posture is not None}


def _joints(answer: Solution | Motion) -> dict[str, Any]:
    arms = [arm for arm, joints in answer.joint_names.items() for _ in joints]
    return {"joint": list(q_names(answer)), "arm": ("joint", arms)}


def package(name: str, extra: str = "notebook") -> Any:
    """A package that an extra of copose installs.

    Raises:
        InputError: it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        installed = name.partition(".")[0]
        text = f"the package {installed} is not installed; pip install 'copose[{extra}]'"
        raise InputError(text) from None
