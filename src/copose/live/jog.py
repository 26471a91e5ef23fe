"""Arms moved by hand along their self-motions: sliders, curves of the objective, and its map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from copose.errors import InputError
from copose.live.session import Session
from copose.poses import Array
from copose.posture.landscape.objective_map import Landscape
from copose.self_motion.curves.self_motion_curve import SelfMotionCurve

# Decimal places to which the ends of what is allowed are kept from, rad (or m).
_INSIDE = 1e-9


@dataclass(eq=False)
class ByHand:
    """The self-motions of the arms of a session where it stands, and where a hand has moved them.

    Attributes:
        session: whose arms are moved.
        spare: degrees of freedom to spare, by arm.
        curves: of arms with one to spare, by name; empty until they are asked for.
        map: of the first two of them.
        positions: arc lengths at which these arms are.
    """

    session: Session
    spare: Mapping[str, int]
    curves: dict[str, SelfMotionCurve] = field(default_factory=dict)
    map: Landscape | None = None
    positions: dict[str, float] = field(default_factory=dict)
    _bases: dict[str, Array] = field(default_factory=dict)

    def look(self) -> None:
        """Follow the self-motions from where the arms are, and map the objective over them; what is
        known of them is not followed anew.

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
                curves = {each.arm: each for each in (self.map.first, self.map.second)}
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
        """Move an arm along its self-motion, as far as limits let it.

        Args:
            arm: with one degree of freedom to spare.
            share: of what is shown of the curve, 0 to 1.
        """
        curve = self.curves.get(arm)
        if curve is None:
            return
        low, high = curve.window
        s = _allowed(curve, low + share * (high - low))
        if s is None:
            return
        self._put(arm, curve.at(s))
        # What one arm's posture is worth depends on where the others are.
        self.look()

    def share(self, arm: str) -> float | None:
        """The place of an arm on what is shown of its curve, 0 to 1; None where it is on none."""
        curve, s = self.curves.get(arm), self.positions.get(arm)
        if curve is None or s is None:
            return None
        low, high = curve.window
        return float(np.clip((s - low) / (high - low), 0.0, 1.0))

    def jog(self, arm: str, direction: int, amount: float) -> None:
        """Move an arm with more degrees of freedom to spare along one of them.

        Args:
            arm: its name.
            direction: from 0, which keeps its meaning while the hand moves nothing else.
            amount: rad (or m).
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
        after = self.session.state.solution.after
        if after is not None:
            self.session.choose({**after.joints, arm: q.tolist()})


def _allowed(curve: SelfMotionCurve, s: float) -> float | None:
    """The nearest arc length at which limits let the arm be; None where there is none."""
    if curve.piece(s) is not None:
        return s
    ends = [end for low, high in curve.pieces for end in (low + _INSIDE, high - _INSIDE)]
    return min(ends, key=lambda end: abs(end - s), default=None)
