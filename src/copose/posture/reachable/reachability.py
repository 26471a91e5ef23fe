"""What arms that hold an object can come to without letting go, while the object stands still.

Each arm moves on {q : closure(q) = 0, lower ≤ q ≤ upper} by itself, and two postures can be reached
from each other where those of each arm are in one connected component of it. With one degree of
freedom to spare a component is a curve, and what is said of it is definite; with more it is
explored. Joint positions are what they are: only a joint without limits is the same after a turn.
What a start has of ``joint_margin`` it may only leave. Where bodies must keep a clearance, so must
the motion, see `moving_clear`; torque limits are asked of the postures at its ends alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.reachable.coordination import CoordinationGrid, CurveNodes, one_after_another
from copose.posture.setting import Setting
from copose.self_motion.curves.tracing import SPACING, STRIDE, Curve, follow
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import thinned
from copose.self_motion.walks import connected, walk

# Joints that differ by less are the same, rad or m.
_SAME = 1e-6
_SINGULAR = 1e-7
# Postures of an arm by which two are connected where more than one degree of freedom is to spare.
_BETWEEN = 32
# Postures of a component that lead to one that may belong to it.
_NEAREST = 4


@dataclass(frozen=True, eq=False)
class Component:
    """What one arm can come to, as far as is known.

    Attributes:
        postures: within limits and margins, the start first, (count, n).
        start: where the arm is, (n,).
        rails: what it moves on.
        curve: with one degree of freedom to spare.
        complete: whether there is nothing else.
    """

    postures: Array
    start: Array
    rails: ClosureManifold
    curve: Curve | None
    complete: bool

    def holds(self, q: Array) -> bool | None:
        """Whether a closed posture, (n,), belongs to it; None where that cannot be said."""
        rails = self.rails
        if np.abs(rails.wrapped((q - self.start)[None])).max() <= _SAME:
            return True
        if self.curve is not None:
            return True if self.curve.place(q) is not None else _unless(self.complete)
        if self.complete or rails.spare <= 0 or len(self.postures) == 0:
            return _unless(self.complete)
        apart = np.linalg.norm(rails.many(len(self.postures)).wrapped(self.postures - q), axis=1)
        near = self.postures[np.argsort(apart, kind="stable")[:_NEAREST]]
        many = rails.many(len(near))
        to = np.tile(q, (len(near), 1))
        return bool(walk(many, near, to)[0].any() or walk(many, to, near)[0].any()) or None


@dataclass(frozen=True)
class Reached:
    """Whether a posture can be reached from another.

    Attributes:
        whole: whether all arms can, together; None where that cannot be said.
        why: of each arm that cannot, what stops it.
    """

    whole: bool | None
    why: tuple[str, ...] = ()


def rails_of(model: PostureModel, setting: Setting, arms: Sequence[int]) -> ClosureManifold:
    """What arms of one model move on."""
    cell = setting.cell
    return ClosureManifold(
        kernels=model.arms[arms[0]],
        goals=np.array([setting.placement.goals[i] for i in arms]),
        lower=np.array([cell.lower[i] for i in arms]),
        upper=np.array([cell.upper[i] for i in arms]),
        unlimited=np.array([_unlimited(cell, i) for i in arms]),
    )


def component(
    model: PostureModel,
    setting: Setting,
    i: int,
    start: Array,
    sample: Array | None = None,
    spacing: float = SPACING,
) -> Component:
    """What arm i can come to from a closed posture, (n,).

    Args:
        model: what is built.
        setting: where the object is.
        i: the arm.
        start: where it is.
        sample: closed postures, (count, n), of which those that it can come to are told where it
            has more than one degree of freedom to spare.
        spacing: of postures along a curve, at most.
    """
    cell, rails = setting.cell, rails_of(model, setting, [i])
    curve, points = None, start[None]
    fixed, complete = cell.arms[i].fixed, True
    if not fixed and rails.spare == 1:
        curve = follow(rails, start[None], stride=spacing)[0]
        points, complete = np.vstack([points, curve.points]), curve.complete
    elif not fixed and rails.spare > 1:
        others = points[:0] if sample is None else sample
        nodes = np.vstack([points, others])
        points, complete = nodes[connected(rails, nodes)], False
    elif not fixed:
        complete = _isolated(rails, start)
    lower, upper = cell.lower[i], cell.upper[i]
    slack = np.maximum(np.maximum(lower - points, points - upper), 0.0).max(axis=1)
    points = points[slack <= CLOSED]
    # A posture that is the start again is of no use, and what it is closed to is exact.
    apart = np.abs(rails.many(len(points)).wrapped(points - start)).max(axis=1) > _SAME
    points, first = points[apart], points[~apart][:1]
    ends, gaps = project(rails.kernels, points, rails.goals[0], lower, upper, steps=9, closed=1e-13)
    return Component(np.vstack([first, ends[gaps <= CLOSED]]), start, rails, curve, complete)


def reachable(
    model: PostureModel,
    setting: Setting,
    start: Sequence[Array],
    end: Sequence[Array],
    samples: Sequence[Array] | None = None,
) -> Reached:
    """Whether arms that hold the object still can come from a closed posture to another.

    Args:
        model: what is built.
        setting: where the object is.
        start: where the arms are, by arm (n_i,).
        end: where they are to be.
        samples: closed postures of each arm, (count, n_i), that help where it has more than one
            degree of freedom to spare.
    """
    cell, clear = setting.cell, setting.bodies is not None
    K = len(cell.arms)
    known: list[bool | None] = [None] * K
    why = [""] * K
    curves: list[Curve | None] = [None] * K
    trails: list[Sequence[Array] | None] = [None] * K
    groups: dict[object, list[int]] = {}
    for i in range(K):
        rails = rails_of(model, setting, [i])
        same = np.abs(rails.wrapped((end[i] - start[i])[None])).max() <= _SAME
        if same:
            known[i] = True
        elif cell.arms[i].fixed:
            known[i], why[i] = False, "it is fixed"
        elif rails.spare <= 0:
            known[i] = _unless(_isolated(rails, start[i]))
            why[i] = "it has no degree of freedom to spare"
        elif rails.spare > 1:
            known[i], trails[i] = _explored(
                rails, start[i], end[i], None if samples is None else samples[i]
            )
        if rails.spare == 1 and not cell.arms[i].fixed and (clear or not same):
            groups.setdefault(model.arms[i], []).append(i)
    for arms in groups.values():
        rails = rails_of(model, setting, arms)
        targets = np.array([end[i] for i in arms])
        q = np.array([start[i] for i in arms])
        found = follow(rails, q) if clear else follow(rails, q, targets, STRIDE)
        for i, curve in zip(arms, found, strict=True):
            curves[i] = curve
            if known[i] is None:
                met = curve.place(end[i]) is not None if clear else curve.met
                known[i] = True if met else _unless(curve.complete)
                why[i] = _stopped(cell, i, curve)
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
    """Whether arms that can come to a posture by themselves do so side by side."""
    if not model.clear(setting, np.concatenate(start)[None])[0]:
        return None, ()
    arms = []
    for curve, trail, here, there in zip(curves, trails, start, end, strict=True):
        if curve is not None:
            arms.append(CurveNodes.along(curve, here, there))
        elif trail is not None:
            arms.append(CurveNodes.trail(trail))
        else:
            arms.append(CurveNodes.still(here))
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
    rails: ClosureManifold, start: Array, end: Array, sample: Array | None
) -> tuple[bool | None, Sequence[Array] | None]:
    """Whether walks connect two postures of an arm, and one that does so by itself."""
    both = np.vstack([start, end])
    arrived, trail = walk(rails.many(2), both, both[::-1])
    if arrived[0]:
        return True, [x[0] for x in trail]
    if arrived[1]:
        return True, [x[1] for x in trail[::-1]]
    if sample is None or not len(sample):
        return None, None
    nodes = np.vstack([both, thinned(sample, _BETWEEN)])
    return (True if connected(rails, nodes, only=1)[1] else None), None


def _unlimited(cell: Cell, i: int) -> Array:
    names = cell.unlimited(i)
    return np.array([joint.name in names for joint in cell.arms[i].joints], dtype=bool)


def _unless(complete: bool) -> bool | None:
    """What is not found is not there where everything is known."""
    return False if complete else None


def _isolated(rails: ClosureManifold, q: Array) -> bool:
    """Whether no motion is possible at a posture, (n,), of an arm with no freedom to spare."""
    _, J = rails.kernels.residual(q[None], rails.goals)
    size = np.linalg.svd(J[0], compute_uv=False)
    return bool(len(size) == rails.kernels.n and size[-1] > _SINGULAR * size[0])


def _stopped(cell: Cell, i: int, curve: Curve) -> str:
    """What ends a self-motion."""
    names = cell.arms[i].joint_names
    stops = [repr(names[j]) for j in dict.fromkeys(curve.stops)]
    if not stops:
        return "its self-motion comes back to the start before"
    limits = "a limit" if len(stops) == 1 else "limits"
    return f"its self-motion ends at {limits} of {' and '.join(stops)}"
