"""The panel's part for moving arms by hand along their self-motions."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from functools import partial
from typing import Any, Protocol

from copose.live.panels.controls import Controls, put, put_content, see
from copose.live.plots.landscape_figure import curve_svg
from copose.live.plots.landscape_map import map_svg
from copose.live.session.jog import ByHand


class HandActs(Protocol):
    """The actions of this part; each returns at once."""

    def slide(self, arm: str, share: float) -> None:
        """Move an arm along its self-motion."""

    def jog(self, arm: str, direction: int, amount: float) -> None:
        """Move an arm along one of several directions."""


class HandPanel:
    """Sliders, curves and the map."""

    def __init__(
        self, controls: Controls, spare: Mapping[str, int], acts: HandActs, *, farthest: float = 1.5
    ) -> None:
        """Build the controls; ``farthest`` are ends of sliders that move an arm, rad (or m)."""
        self._controls, self._acts = controls, acts
        gui = controls.gui
        gui.add_markdown(_introduction(any(d > 0 for d in spare.values())))
        self._sliders: dict[str, Any] = {}
        self._curves: dict[str, Any] = {}
        # Hands jog on threads of their own.
        self._jogging = threading.Lock()
        self._jogs: dict[tuple[str, int], Any] = {}
        self._at: dict[tuple[str, int], float] = {}
        for arm, d in spare.items():
            if d == 1:
                slider = gui.add_slider(arm, 0.0, 1.0, 0.001, 0.5, disabled=True)
                controls.when(slider, partial(acts.slide, arm))
                self._sliders[arm], self._curves[arm] = slider, gui.add_html("")
            for k in range(d if d > 1 else 0):
                jog = gui.add_slider(f"{arm}, {k + 1}", -farthest, farthest, 0.01, 0.0)
                controls.when(jog, partial(self._jogged, arm, k))
                self._jogs[arm, k], self._at[arm, k] = jog, 0.0
        self._map = gui.add_html("", visible=len(self._sliders) > 1)

    def show(self, hand: ByHand) -> None:
        """Show where the arms are on their self-motions."""
        with self._controls.setting():
            for arm, slider in self._sliders.items():
                share, curve = hand.share(arm), hand.curves.get(arm)
                if slider.disabled != (share is None):
                    slider.disabled = share is None
                if share is not None:
                    put(slider, round(share, 3))
                drawn = "" if curve is None else curve_svg(curve, present=hand.positions.get(arm))
                put_content(self._curves[arm], drawn)
            see(self._map, hand.map is not None)
            if hand.map is not None:
                first, second = hand.map.first.arm, hand.map.second.arm
                present = hand.positions[first], hand.positions[second]
                value = hand.session.state.value
                put_content(self._map, map_svg(hand.map, present=present, value=value))

    def rest(self) -> None:
        """Put jogs back to the middle: they count from the present posture then."""
        with self._controls.setting(), self._jogging:
            for key, jog in self._jogs.items():
                self._at[key] = 0.0
                put(jog, 0.0)

    def _jogged(self, arm: str, direction: int, _: object) -> None:
        """Move an arm by the change of one of its jogs."""
        with self._jogging:
            # The newest value, whichever thread comes first.
            value = float(self._jogs[arm, direction].value)
            amount, self._at[arm, direction] = value - self._at[arm, direction], value
        self._acts.jog(arm, direction, amount)


def _introduction(spare: bool) -> str:
    """The words above the sliders, in Markdown."""
    if not spare:
        return "No arm has a joint to spare: with the object held still nothing moves."
    return (
        "With the object held still an arm with a joint to spare moves along its *self-motion*. "
        "The curve is the objective along it; the map that of two arms together."
    )
