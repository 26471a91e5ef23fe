"""Jogging of arms along their self-motions, with curves and a map of the objective."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from copose.errors import InputError
from copose.live.session.session import Session
from copose.poses import Array
from copose.posture.landscape.objective_map import Landscape
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve


@dataclass(eq=False)
class ByHand:
    """The self-motions of the arms of a session, and the places of the arms on them."""

    session: Session
    spare: Mapping[str, int]  # degrees of freedom to spare, by arm
    # Self-motions of arms with one to spare, by name; empty until they are asked for.
    curves: dict[str, SelfMotionCurve] = field(default_factory=dict)
    map: Landscape | None = None  # the objective over the first two of them
    positions: dict[str, float] = field(default_factory=dict)  # arc lengths at which these arms are
    _bases: dict[str, Array] = field(default_factory=dict)

    def look(self) -> None:
        """Follow the self-motions from the present posture, and map the objective over them; those
        that are known are not followed anew.

        Raises:
            StoppedError: a hand has moved meanwhile.
        """
        state = self.session.state
        after = state.solution.after
        self._bases = {}
        if after is None or not state.reached:
            self.curves, self.map, self.positions = {}, None, {}
            return
        planner, single = self.session.planner(), [a for a, d in self.spare.items() if d == 1]
        curves: dict[str, SelfMotionCurve] = {}
        known, self.map = self.map, None
        try:
            if len(single) > 1:
                self.map = planner.landscape(
                    after.joints, *single[:2], problem=state.problem, known=known
                )
                curves = {curve.arm: curve for curve in (self.map.first, self.map.second)}
            for arm in single:
                if arm not in curves:
                    curves[arm] = planner.self_motion(
                        after.joints, arm, problem=state.problem, known=self.curves.get(arm)
                    )
        except InputError:
            # A singular posture has none.
            curves, self.map = {}, None
        self.curves = curves
        self.positions = {a: c.present for a, c in curves.items() if c.present is not None}

    def slide(self, arm: str, share: float) -> None:
        """Move an arm with one degree of freedom to spare to a share, 0 to 1, of the part of its
        self-motion that is shown, as far as limits let it.
        """
        curve = self.curves.get(arm)
        if curve is None:
            return
        low, high = curve.window
        s = _allowed(curve, low + share * (high - low))
        if s is None:
            return
        self._put(arm, curve.at(s))
        # The objective along other self-motions depends on this arm.
        self.look()

    def share(self, arm: str) -> float | None:
        """The place of an arm on the part of its curve that is shown, 0 to 1; None without one."""
        curve, s = self.curves.get(arm), self.positions.get(arm)
        if curve is None or s is None:
            return None
        low, high = curve.window
        return float(np.clip((s - low) / (high - low), 0.0, 1.0))

    def jog(self, arm: str, direction: int, amount: float) -> None:
        """Move an arm with more degrees of freedom to spare along one of them, which is the same
        while nothing else is moved, by an amount, rad (or m).
        """
        state = self.session.state
        if state.solution.after is None:
            return
        moved = self.session.planner().null_motion(
            state.solution.after.joints, arm, direction, amount, basis=self._bases.get(arm),
            problem=state.problem,
        )  # fmt: skip
        self._bases[arm] = moved.basis
        self._put(arm, moved.joints)

    def _put(self, arm: str, q: Array) -> None:
        """Move one arm, and no other."""
        after = self.session.state.solution.after
        if after is not None:
            self.session.choose({**after.joints, arm: q.tolist()})


def _allowed(curve: SelfMotionCurve, s: float) -> float | None:
    """The nearest arc length at which limits let the arm be; None where there is none."""
    if curve.piece(s) is not None:
        return s
    # By so little, rad (or m), ends of pieces are avoided.
    inside = 1e-9
    ends = [end for low, high in curve.pieces for end in (low + inside, high - inside)]
    return min(ends, key=lambda end: abs(end - s), default=None)
