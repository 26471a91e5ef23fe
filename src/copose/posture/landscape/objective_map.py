"""Map of the objective over the self-motions of two arms.

With the object held still an ellipsoid depends on sums over the arms, so a map over two
self-motions takes the terms of each posture of either, and one batch of sums. Objectives that need
linear programs get a coarser grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.poses import Array, Mask
from copose.posture.landscape.branches import held_postures
from copose.posture.landscape.curve_values import kept_clear, objectives_of, self_motions, slow
from copose.posture.model import PostureModel
from copose.posture.setting import Setting
from copose.progress import heed
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve


@dataclass(frozen=True)
class GridOptions:
    """Postures of each arm in a map."""

    fine: int = 120
    coarse: int = 24  # where linear programs decide
    coarsest: int = 16  # where these are many or large


@dataclass(frozen=True, eq=False)
class Landscape:
    """The objective over the self-motions of two arms, the other arms where they are.

    Attributes:
        first: self-motion of the arm whose postures are rows.
        second: of the arm whose postures are columns.
        rows: arc lengths along the first, rad (or m), within its `window`, (P,).
        columns: along the second, (Q,).
        values: the objective, (P, Q); NaN where there is none, and beyond limits where linear
            programs decide.
        allowed: entries within limits that keep the clearance, and that torques hold where they
            have to, (P, Q).
        estimated: whether values are bounds and not exact.
        unit: of the objective.
        present: arc lengths at the arms' posture and its value; None on other self-motions.
        others: maps of the other pairs of self-motions, where they were asked for.
    """

    first: SelfMotionCurve
    second: SelfMotionCurve
    rows: Array
    columns: Array
    values: Array
    allowed: Mask
    estimated: bool
    unit: str
    present: tuple[float, float, float] | None
    others: tuple[Landscape, ...] = ()

    @property
    def best(self) -> tuple[float, float, float] | None:
        """Arc lengths along both and the value of the best allowed entry; None if there is none.

        It is the present posture where that is no worse.
        """
        if not self.allowed.any():
            return None
        values = np.where(self.allowed, self.values, -np.inf)
        a, b = np.unravel_index(int(values.argmax()), values.shape)
        if self.present is not None and self.present[2] >= values[a, b]:
            return self.present
        return float(self.rows[a]), float(self.columns[b]), float(self.values[a, b])


def landscape(
    model: PostureModel,
    setting: Setting,
    joints: Sequence[Array],
    arms: tuple[int, int],
    seed: int,
    every: bool,
    known: Sequence[SelfMotionCurve] = (),
    options: GridOptions = GridOptions(),
) -> Landscape:
    """The map over the self-motions of two arms through a posture, by arm (n_i,).

    With ``every`` the other pairs of self-motions are mapped too; ``known`` is as for
    `self_motions`.

    Raises:
        InputError: as for `self_motions`.
    """
    first, second = self_motions(model, setting, joints, arms, seed, known)
    q = held_postures(model, setting, joints)
    pairs = [
        (one, other)
        for one in (first, *(first.others if every else ()))
        for other in (second, *(second.others if every else ()))
    ]
    maps = [_mapped(model, setting, q, arms, *pair, options) for pair in pairs]
    return replace(maps[0], others=tuple(maps[1:]))


def _mapped(
    model: PostureModel,
    setting: Setting,
    q: Sequence[Array],
    arms: tuple[int, int],
    first: SelfMotionCurve,
    second: SelfMotionCurve,
    options: GridOptions,
) -> Landscape:
    """The map over a pair of self-motions."""
    heed()
    programs = model.capacity is not None
    count = options.coarse if programs else options.fine
    if slow(model):
        count = options.coarsest
    s = [curve.spaced(*curve.window, count) for curve in (first, second)]
    points = [curve.postures(x) for curve, x in zip((first, second), s, strict=True)]
    every = _combined(q, arms, points)
    allowed = first.within(s[0])[:, None] & second.within(s[1])
    if setting.objective.summable:
        values = _summed(model, setting, q, arms, points)
    else:
        values, rows = np.full(count**2, np.nan), allowed.ravel()
        values[rows] = objectives_of(model, setting, [joints[rows] for joints in every])
    values = values.reshape(count, count)
    allowed &= np.isfinite(values)
    if setting.bodies is not None and allowed.any():
        postures = [joints[None] for joints in q]
        postures[arms[0]], postures[arms[1]] = points
        chosen = np.zeros((int(allowed.sum()), len(q)), dtype=np.intp)
        chosen[:, list(arms)] = np.argwhere(allowed)
        allowed[allowed] = kept_clear(setting, postures, chosen)
    if model.feasibility.judged and allowed.any():
        rows = allowed.ravel()
        allowed[allowed] = model.feasibility.held(setting, np.hstack(every)[rows])
    present = None
    if first.present is not None and second.present is not None and first.value is not None:
        present = first.present, second.present, first.value
    return Landscape(
        first=first, second=second, rows=s[0], columns=s[1], values=values, allowed=allowed,
        estimated=model.objective.costly, unit=setting.objective.unit, present=present,
    )  # fmt: skip


def _summed(
    model: PostureModel,
    setting: Setting,
    q: Sequence[Array],
    arms: tuple[int, int],
    points: Sequence[Array],
) -> Array:
    """Objectives of all pairs of postures of two arms, (P, n) and (Q, n), by sums: (P·Q,)."""
    ties = setting.placement.ties
    first, second = (
        model.arms[i].terms(postures, ties[i]) for i, postures in zip(arms, points, strict=True)
    )
    rest = [
        model.arms[i].terms(joints[None], ties[i]) for i, joints in enumerate(q) if i not in arms
    ]
    sums = first[:, None] + (second + sum(rest))[None]
    values = setting.objective.values_of_sums(setting, sums.reshape(-1, sums.shape[2]))
    return np.where(np.isfinite(values), values, np.nan)


def _combined(q: Sequence[Array], arms: tuple[int, int], points: Sequence[Array]) -> list[Array]:
    """All pairs of postures of two arms, by arm (P·Q, n_i), with the others where they are."""
    count, many = map(len, points)
    every = [np.tile(joints, (count * many, 1)) for joints in q]
    every[arms[0]] = np.repeat(points[0], many, axis=0)
    every[arms[1]] = np.tile(points[1], (count, 1))
    return every
