"""What self-motions are worth with the other arms where they are, and where they are allowed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from copose.errors import InputError, arm_key
from copose.poses import Array, Indices, Mask
from copose.posture.landscape.branches import Branches, branches, held_postures
from copose.posture.model import PostureModel
from copose.posture.search.clear_samples import alone_clear, kept_apart
from copose.posture.setting import Setting
from copose.progress import heed
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve

# Postures along a curve at which slow linear programs are solved.
_FEW = 40


def self_motions(
    model: PostureModel,
    setting: Setting,
    joints: Sequence[Array],
    arms: Sequence[int],
    seed: int,
    known: Sequence[SelfMotionCurve] = (),
) -> list[SelfMotionCurve]:
    """The self-motion of each of some arms through a posture, and its others beside it.

    Args:
        model: what is built.
        setting: where the object is.
        joints: the posture, by arm (n_i,).
        arms: numbers of those asked for.
        seed: of the random postures by which self-motions are met.
        known: of these arms at this pose of the object, from an earlier call: while the arms are on
            them nothing is followed anew.

    Raises:
        InputError: an arm does not hold the object, or has not one degree of freedom to spare.
    """
    for i in arms:
        _check_spare(setting, i)
    q = held_postures(model, setting, joints)
    by_name = {curve.arm: curve for curve in known}
    found: dict[int, Branches] = {}
    for i in arms:
        curve = by_name.get(setting.cell.arms[i].name)
        again = None if curve is None else Branches.again(curve, setting, i, q[i])
        if again is not None:
            found[i] = again
    new = [i for i in arms if i not in found]
    found |= zip(new, branches(model, setting, q, new, seed), strict=True)
    return [_valued(model, setting, q, i, found[i]) for i in arms]


def _check_spare(setting: Setting, i: int) -> None:
    """Refuse an arm whose self-motion is no curve."""
    arm, spare = setting.cell.arms[i], setting.cell.spare(i)
    if spare != 1:
        has = "no degree of freedom" if spare <= 0 else f"{spare} degrees of freedom"
        raise InputError(
            f"arm {arm.name!r} has {has} to spare; a self-motion is a curve with one",
            key=arm_key(i, arm.name),
        )


def _valued(
    model: PostureModel, setting: Setting, q: Sequence[Array], i: int, found: Branches
) -> SelfMotionCurve:
    """The self-motion that arm i is on, with its values and its others."""
    arm = setting.cell.arms[i]
    here = objectives_of(model, setting, [mine[None] for mine in q])
    curves = []
    for k, course in enumerate(found.courses):
        present = found.position if k == found.present else None
        every = np.ones(len(course.track.positions), dtype=bool)
        curve = SelfMotionCurve(
            arm=arm.name, joint_names=tuple(arm.joint_names), branch=k, track=course.track,
            limits=found.limits, cuts=course.cuts, pieces=course.pieces, present=present,
            value=None if present is None else float(here[0]), objective=np.zeros(len(every)),
            estimated=slow(model), unit=setting.objective.unit, clear=every, held=every,
        )  # fmt: skip
        curves.append(_along(model, setting, q, i, curve))
    others = tuple(curve for curve in curves if curve.present is None)
    return replace(curves[found.present], others=others)


def _along(
    model: PostureModel, setting: Setting, q: Sequence[Array], i: int, curve: SelfMotionCurve
) -> SelfMotionCurve:
    """A self-motion of arm i with its values, and where it is allowed."""
    heed()
    s, inside = curve.positions, curve.inside
    low, high = curve.window
    stacked = np.hstack(_beside(q, i, curve.points))
    values = np.full(len(s), np.nan)
    if slow(model):
        asked = curve.spaced(low, high, _FEW)
        exact = objectives_of(model, setting, _beside(q, i, curve.postures(asked)))
        values = np.interp(s, asked, exact, left=np.nan, right=np.nan)
    else:
        programs = not setting.objective.summable
        rows = (s >= low) & (s <= high) if programs else np.ones(len(s), dtype=bool)
        values[rows] = objectives_of(model, setting, model.split(stacked[rows]))
    clear, held = curve.clear, curve.held
    if setting.bodies is not None and inside.any():
        clear, postures = clear.copy(), [mine[None] for mine in q]
        postures[i] = curve.points[inside]
        chosen = np.zeros((len(postures[i]), len(q)), dtype=np.intp)
        chosen[:, i] = np.arange(len(chosen))
        clear[inside] = kept_clear(setting, postures, chosen)
    if model.feasibility.judged and inside.any():
        held = held.copy()
        held[inside] = model.held(setting, stacked[inside])
    return replace(curve, objective=values, clear=clear, held=held)


def slow(model: PostureModel) -> bool:
    """Whether linear programs for a posture are many, or large with contacts that have limits."""
    capacity = model.capacity
    return model.dear or (capacity is not None and len(capacity.bounds.matrix) > 0)


def objectives_of(model: PostureModel, setting: Setting, q: Sequence[Array]) -> Array:
    """The objective at postures, by arm (count, n_i), or a bound of it where it is dear; NaN where
    there is none.
    """
    values = model.estimates(setting, np.hstack(q))
    return np.where(np.isfinite(values), values, np.nan)


def kept_clear(setting: Setting, postures: Sequence[Array], chosen: Indices) -> Mask:
    """Which combinations, (count, K), of postures by arm, (count_i, n_i), keep the clearance."""
    bodies = setting.bodies
    assert bodies is not None
    here = setting.configurations([None] * len(postures))
    clear = np.full(len(chosen), bool(bodies.clear(here, bodies.still)[0]))
    for i, mine in enumerate(postures):
        clear &= alone_clear(setting, i, mine)[chosen[:, i]]
    if clear.any():
        clear[clear] = kept_apart(setting, postures)(chosen[clear])
    return clear


def _beside(q: Sequence[Array], i: int, points: Array) -> list[Array]:
    """Postures of arm i, (count, n_i), with the other arms where they are."""
    return [points if j == i else np.tile(mine, (len(points), 1)) for j, mine in enumerate(q)]
