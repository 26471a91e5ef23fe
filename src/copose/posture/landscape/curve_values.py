"""Values and constraints along self-motions, with the other arms where they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from copose.errors import InputError, arm_key
from copose.poses import Array, Indices, Mask
from copose.posture.landscape.branches import Branches, held_postures, traced_branches
from copose.posture.model import PostureModel
from copose.posture.search.clear_samples import alone_clear, kept_apart
from copose.posture.setting import Setting
from copose.progress import heed
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve


def self_motions(
    model: PostureModel,
    setting: Setting,
    joints: Sequence[Array],
    arms: Sequence[int],
    seed: int,
    known: Sequence[SelfMotionCurve] = (),
) -> list[SelfMotionCurve]:
    """Self-motions of some arms through a posture, each with the arm's other self-motions.

    Args:
        model: the posture model.
        setting: where the object is.
        joints: the posture, by arm (n_i,).
        arms: their numbers.
        seed: of the random postures from which self-motions are traced.
        known: of an earlier call at this pose of the object: while the arms are on them nothing is
            traced again.

    Raises:
        InputError: an arm does not hold the object, or has not one degree of freedom to spare.
    """
    for i in arms:
        _check_spare(setting, i)
    q = held_postures(model, setting, joints)
    by_name = {curve.arm: curve for curve in known}
    known_branches: dict[int, Branches] = {}
    for i in arms:
        curve = by_name.get(setting.cell.arms[i].name)
        again = None if curve is None else Branches.again(curve, setting, i, q[i])
        if again is not None:
            known_branches[i] = again
    new = [i for i in arms if i not in known_branches]
    known_branches |= zip(new, traced_branches(model, setting, q, new, seed), strict=True)
    return [_valued(model, setting, q, i, known_branches[i]) for i in arms]


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
    model: PostureModel, setting: Setting, q: Sequence[Array], i: int, arm_branches: Branches
) -> SelfMotionCurve:
    """The self-motion that arm i is on, with its values and its others."""
    arm = setting.cell.arms[i]
    value = float(objectives_of(model, setting, [joints[None] for joints in q])[0])
    curves = []
    for k, course in enumerate(arm_branches.courses):
        present = arm_branches.position if k == arm_branches.present else None
        every = np.ones(len(course.track.positions), dtype=bool)
        curve = SelfMotionCurve(
            arm=arm.name, joint_names=tuple(arm.joint_names), branch=k, track=course.track,
            limits=arm_branches.limits, cuts=course.cuts, pieces=course.pieces, present=present,
            value=None if present is None else value, objective=np.zeros(len(every)),
            estimated=slow(model), unit=setting.objective.unit, clear=every, held=every,
        )  # fmt: skip
        curves.append(_along(model, setting, q, i, curve))
    other_curves = tuple(curve for curve in curves if curve.present is None)
    return replace(curves[arm_branches.present], others=other_curves)


def _along(
    model: PostureModel, setting: Setting, q: Sequence[Array], i: int, curve: SelfMotionCurve
) -> SelfMotionCurve:
    """A self-motion of arm i with values, and which of its knots keep clear and hold the object."""
    heed()
    s, inside = curve.positions, curve.inside
    low, high = curve.window
    stacked = np.hstack(_with_others(q, i, curve.points))
    values = np.full(len(s), np.nan)
    if slow(model):
        asked = curve.spaced(low, high, 40)
        exact = objectives_of(model, setting, _with_others(q, i, curve.postures(asked)))
        values = np.interp(s, asked, exact, left=np.nan, right=np.nan)
    else:
        programs = not setting.objective.summable
        rows = (s >= low) & (s <= high) if programs else np.ones(len(s), dtype=bool)
        values[rows] = objectives_of(model, setting, model.split(stacked[rows]))
    clear, held = curve.clear, curve.held
    if setting.bodies is not None and inside.any():
        clear, postures = clear.copy(), [joints[None] for joints in q]
        postures[i] = curve.points[inside]
        chosen = np.zeros((len(postures[i]), len(q)), dtype=np.intp)
        chosen[:, i] = np.arange(len(chosen))
        clear[inside] = kept_clear(setting, postures, chosen)
    if model.feasibility.judged and inside.any():
        held = held.copy()
        held[inside] = model.feasibility.held(setting, stacked[inside])
    return replace(curve, objective=values, clear=clear, held=held)


def slow(model: PostureModel) -> bool:
    """True if the linear programs of a posture are many, or large by limits of contacts."""
    capacity = model.capacity
    return model.objective.costly or (capacity is not None and len(capacity.bounds.matrix) > 0)


def objectives_of(model: PostureModel, setting: Setting, q: Sequence[Array]) -> Array:
    """Objective, or a bound where it is costly, at postures, by arm (count, n_i): (count,).

    NaN where there is none.
    """
    values = model.estimates(setting, np.hstack(q))
    return np.where(np.isfinite(values), values, np.nan)


def kept_clear(setting: Setting, postures: Sequence[Array], chosen: Indices) -> Mask:
    """Mask of combinations of postures by arm, (count_i, n_i), that keep the clearance, (count,).

    They are chosen by the numbers of the arms' postures, (count, K).
    """
    bodies = setting.bodies
    assert bodies is not None
    standing = setting.configurations([None] * len(postures))
    clear = np.full(len(chosen), bool(bodies.clear(standing, bodies.still)[0]))
    for i, q in enumerate(postures):
        clear &= alone_clear(setting, i, q)[chosen[:, i]]
    if clear.any():
        clear[clear] = kept_apart(setting, postures)(chosen[clear])
    return clear


def _with_others(q: Sequence[Array], i: int, points: Array) -> list[Array]:
    """Postures of arm i, (count, n_i), with the other arms where they are, by arm."""
    return [points if j == i else np.tile(joints, (len(points), 1)) for j, joints in enumerate(q)]
