"""Arguments of a planner's calls: seed, effort, postures by name, and warm starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.errors import InputError, nearest
from copose.poses import Array
from copose.posture.placement.placed import Placed
from copose.posture.search.effort import EFFORTS, Effort, EffortName
from copose.results import Solution

Warm: TypeAlias = Solution | Mapping[str, Sequence[float]]
"""A result whose ``after`` it is, or joint positions by arm, to go on from."""


def check_seed(seed: int | None) -> None:
    """Refuse a seed that is none.

    Raises:
        InputError: it is no whole number below 2⁶³.
    """
    if seed is not None and not (isinstance(seed, Integral) and 0 <= seed < 2**63):
        raise InputError(f"{seed!r} is no whole number from 0 to 2⁶³ − 1", key="seed")


def check_epsilon(epsilon: float | None, least: float = 1e-9) -> None:
    """Refuse an ε that cannot be proved: below the least, which rounding allows.

    Raises:
        InputError: it is no number, or too small.
    """
    if epsilon is not None and not (isinstance(epsilon, Real) and least <= epsilon < np.inf):
        raise InputError(f"{epsilon!r} is no number from {least:g} on", key="prove")


def effort_of(effort: EffortName | Effort) -> Effort:
    """An effort by its name, or one with options of its own.

    Raises:
        InputError: there is none of that name.
    """
    if isinstance(effort, Effort):
        return effort
    if effort not in tuple(EFFORTS):
        raise InputError(f"{effort!r} is not low, normal or high", key="effort")
    return EFFORTS[effort]


def arm_called(cell: Cell, name: str) -> int:
    """The index of an arm.

    Raises:
        InputError: none is called so.
    """
    names = [arm.name for arm in cell.arms]
    if name not in names:
        raise InputError(f"no arm is called {name!r}{nearest(name, names)}", key="arm")
    return names.index(name)


def postures_of(cell: Cell, postures: Mapping[str, ArrayLike]) -> list[Array]:
    """Many postures by name as arrays in the order of the arms, (count, n_i) each.

    Raises:
        InputError: they do not fit the arms.
    """
    if not isinstance(postures, Mapping):
        raise InputError("a mapping from arms to arrays is needed", key="postures")
    arrays = []
    for arm in cell.arms:
        try:
            q = np.asarray(postures.get(arm.name, ()), dtype=float)
        except (TypeError, ValueError):
            q = np.zeros(0)
        if q.ndim != 2 or q.shape[1] != arm.n:
            raise InputError(
                f"an array of shape (count, {arm.n}) is needed, for " + ", ".join(arm.joint_names),
                key=f"postures.{arm.name}",
            )
        arrays.append(q)
    names = [arm.name for arm in cell.arms]
    for name in postures:
        if name not in names:
            raise InputError(f"no arm is called {name!r}{nearest(name, names)}", key="postures")
    if len({len(q) for q in arrays}) > 1:
        raise InputError("the arms have different numbers of postures", key="postures")
    return arrays


def warm_joints(warm: Warm) -> Mapping[str, Sequence[float]]:
    """Joint positions of a warm start, by arm.

    Raises:
        InputError: the result has no posture.
    """
    if not isinstance(warm, Solution):
        return warm
    if warm.after is None:
        raise InputError("has no posture: its after is null", key="warm")
    return warm.after.joints


def warm_placement(cell: Cell, warm: Warm) -> Placed:
    """Everything free and the postures of a warm start; the file's pose where that says none.

    Raises:
        InputError: the result has no posture, or they do not fit the arms.
    """
    cases, freedom, problem = cell.cases, Freedom.of(cell.problem), cell.problem
    if not isinstance(warm, Solution):
        xs = [freedom.nominal] * len(cases)
        joints: list[Mapping[str, Sequence[float]]] = [warm] * len(cases)
    else:
        postures = warm.cases if warm.cases is not None else (warm.after,)
        joints = [posture.joints for posture in postures if posture is not None]
        if len(joints) != len(cases):
            raise InputError("has no posture: its after is null", key="warm")
        names = [case.name for case in problem.cases] or [""]
        xs = [freedom.stated(problem, warm, "after", name) for name in names]
    q = [np.concatenate(cell.given(by_arm)) for by_arm in joints]
    return Placed(tuple(xs), tuple(q), -np.inf)
