"""The words of a page: what is shown, in which colours, and how far it is better."""

from __future__ import annotations

import html
from collections.abc import Sequence

from copose.report import style
from copose.results import Motion, Posture, Solution
from copose.viewer.slices import COLORS, Slices

_STYLE = (
    "position:fixed;left:16px;bottom:{};z-index:5;pointer-events:none;max-width:60vw;"
    "font:13px/1.5 system-ui,sans-serif;color:#222;text-shadow:0 0 3px #fff,0 0 3px #fff"
)
# How far above a page's lower edge words stand: what plays has a bar there.
_STILL = "14px"
_PLAYING = "58px"
_SWATCH = (
    "display:inline-block;width:10px;height:10px;border-radius:5px;margin-right:6px;background:{}"
)


def caption(result: Solution | Motion, shown: Sequence[Posture], slices: Slices) -> str:
    """Words for a corner of a page: its title, the objective, and what the colours mean.

    Args:
        result: what is shown.
        shown: its postures.
        slices: the ellipsoids as they are drawn.
    """
    lines = [f'<div style="font-weight:600;font-size:15px">{_title(result)}</div>']
    words = _value(result, shown)
    if words:
        lines.append(f"<div>{html.escape(words)}</div>")
    lines += [_entry(color, f"arm {name}") for name, color in style.arm_colors(shown[0]).items()]
    units = dict(zip(("linear", "angular"), style.units(result), strict=True))
    for kind, scale in slices.scales.items():
        value = style.round_scale(0.2 / scale)
        size = f"{value * scale:.2g} m drawn = {value:g} {units[kind]}"
        lines.append(_entry(COLORS[kind], f"{kind} accelerations, {size}"))
    ghost = "where it begins" if isinstance(result, Motion) else "before"
    if isinstance(result, Motion) or style.compared(result):
        lines.append(_entry(style.BEFORE, ghost))
    place = _STYLE.format(_PLAYING if isinstance(result, Motion) else _STILL)
    return f'<div id="copose-caption" style="{place}">{"".join(lines)}</div>'


def _title(result: Solution | Motion) -> str:
    return html.escape(style.short(result.problem.name, 60))


def _value(result: Solution | Motion, shown: Sequence[Posture]) -> str:
    """The objective, and what was gained."""
    if isinstance(result, Motion):
        seconds = result.time[-1] - result.time[0] if result.time else 0.0
        return f"{style.objective_name(result)} along the path, {seconds:.3g} s"
    words = style.value_words(result, shown[0])
    gain = style.gain_words(result)
    return f"{words}; {gain}" if gain else words


def _entry(color: str, words: str) -> str:
    return f'<div><span style="{_SWATCH.format(color)}"></span>{html.escape(words)}</div>'
