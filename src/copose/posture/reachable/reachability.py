"""Reachability of one posture from another without letting go of the object.

The object stands still. Two postures can be reached from each other where those of each arm are in
one connected component of its closed postures, see `components`. Where bodies must keep a
clearance, so must the motion, see `coordination`; torque limits are asked of the postures at its
ends alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.reachable.components import isolated, known_if, manifold_of, same_posture
from copose.posture.reachable.coordination import CoordinationGrid, CurveNodes, one_after_another
from copose.posture.setting import Setting
from copose.self_motion.curves.curve import Curve, TracingOptions
from copose.self_motion.curves.tracing import connections, follow
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.sampling import thinned
from copose.self_motion.walks import connected, walk


@dataclass(frozen=True)
class Reached:
    """The verdict whether a posture can be reached from another.

    Attributes:
        whole: whether all arms can, together; None where that cannot be said.
        why: what stops each arm that cannot.
    """

    whole: bool | None
    why: tuple[str, ...] = ()


def reachable(
    model: PostureModel,
    setting: Setting,
    start: Sequence[Array],
    end: Sequence[Array],
    samples: Sequence[Array] | None = None,
) -> Reached:
    """The verdict whether arms that hold the object still can move from one posture to another.

    Args:
        model: the posture model.
        setting: where the object is.
        start: closed posture, by arm (n_i,).
        end: closed posture to be reached, alike.
        samples: closed postures of each arm, (count, n_i), by which walks may go where it has
            several degrees of freedom to spare.
    """
    cell, clear = setting.cell, setting.bodies is not None
    K = len(cell.arms)
    known: list[bool | None] = [None] * K
    why = [""] * K
    curves: list[Curve | None] = [None] * K
    trails: list[Sequence[Array] | None] = [None] * K
    groups: dict[object, list[int]] = {}
    for i in range(K):
        manifold = manifold_of(model, setting, [i])
        same = same_posture(manifold, end[i], start[i])
        if same:
            known[i] = True
        elif cell.arms[i].fixed:
            known[i], why[i] = False, "it is fixed"
        elif manifold.spare <= 0:
            known[i] = known_if(isolated(manifold, start[i]))
            why[i] = "it has no degree of freedom to spare"
        elif manifold.spare > 1:
            known[i], trails[i] = _explored(
                manifold, start[i], end[i], None if samples is None else samples[i]
            )
        if manifold.spare == 1 and not cell.arms[i].fixed and (clear or not same):
            groups.setdefault(model.arms[i], []).append(i)
    for arms in groups.values():
        manifold = manifold_of(model, setting, arms)
        q, others = (np.array([both[i] for i in arms]) for both in (start, end))
        if clear:
            for i, curve in zip(arms, follow(manifold, q), strict=True):
                curves[i] = curve
                if known[i] is None:
                    met = curve.place(end[i]) is not None
                    known[i] = True if met else known_if(curve.complete)
                    why[i] = _stopped(cell, i, curve.stops)
            continue
        # Where no curve is kept steps may be longer.
        options = TracingOptions(longest=0.6, first=0.7, growth=2.0, very_straight=0.95)
        connected = connections(manifold, q, others, options)
        for i, (known[i], stops) in zip(arms, connected, strict=True):
            why[i] = _stopped(cell, i, stops)
    if False in known:
        stopped = [f"arm {cell.arms[i].name!r}: {why[i]}" for i in range(K) if known[i] is False]
        return Reached(False, tuple(stopped))
    if None in known or not clear:
        return Reached(None if None in known else True)
    return Reached(*_kept_clear(model, setting, start, end, curves, trails))


def _kept_clear(
    model: PostureModel,
    setting: Setting,
    start: Sequence[Array],
    end: Sequence[Array],
    curves: Sequence[Curve | None],
    trails: Sequence[Sequence[Array] | None],
) -> tuple[bool | None, tuple[str, ...]]:
    """The verdict for arms that can each reach a posture: whether together they keep clear."""
    if not model.feasibility.clear(setting, np.concatenate(start)[None])[0]:
        return None, ()
    arms = []
    for curve, trail, q, q_end in zip(curves, trails, start, end, strict=True):
        if curve is not None:
            arms.append(CurveNodes.along(curve, q, q_end))
        elif trail is not None:
            arms.append(CurveNodes.trail(trail))
        else:
            arms.append(CurveNodes.still(q))
    if any(nodes.end is None for nodes in arms):
        return None, ()
    if one_after_another(model, setting, arms):
        return True, ()
    moving = [nodes for nodes in arms if len(nodes.q) > 1]
    if len(moving) > 2 or any(trail is not None for trail in trails):
        return None, ()
    grid = CoordinationGrid(setting, arms)
    if grid.reached[grid.index([nodes.end or 0 for nodes in arms])]:
        return True, ()
    # An arm on a surface that need not move might make way.
    whole = all(
        arm.fixed or kernels.n <= kernels.m or (curve is not None and curve.complete)
        for arm, kernels, curve in zip(setting.cell.arms, model.arms, curves, strict=True)
    )
    return (False, ("bodies are in the way",)) if whole else (None, ())


def _explored(
    manifold: ClosureManifold, start: Array, end: Array, sample: Array | None
) -> tuple[bool | None, Sequence[Array] | None]:
    """Result of walks between two postures of an arm, (n,): whether one connects them, and it.

    They may go by a sample of closed postures, (count, n).
    """
    both = np.vstack([start, end])
    arrived, trail = walk(manifold.many(2), both, both[::-1])
    if arrived[0]:
        return True, [x[0] for x in trail]
    if arrived[1]:
        return True, [x[1] for x in trail[::-1]]
    if sample is None or not len(sample):
        return None, None
    between = 32  # postures of the sample by which the two may be connected
    nodes = np.vstack([both, thinned(sample, between)])
    return (True if connected(manifold, nodes, only=1)[1] else None), None


def _stopped(cell: Cell, i: int, joints: Iterable[int]) -> str:
    """The reason why a self-motion of arm i that limits of joints stop ends, in words."""
    names = cell.arms[i].joint_names
    stops = [repr(names[j]) for j in dict.fromkeys(joints)]
    if not stops:
        return "its self-motion comes back to the start before"
    limits = "a limit" if len(stops) == 1 else "limits"
    return f"its self-motion ends at {limits} of {' and '.join(stops)}"
