"""The caption of a page: its title, the objective and its gain, and the colours."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass

from copose.report.look import LOOK, arm_colors
from copose.report.words import (
    evidence_words,
    gain_words,
    has_before,
    objective_name,
    round_scale,
    semi_axis_units,
    short,
    value_words,
)
from copose.results import Motion, Posture, Solution
from copose.viewer.nodes.ellipsoids import Slices


@dataclass(frozen=True)
class CaptionLook:
    """Styles of a caption, in CSS."""

    block: str = (
        "position:fixed;left:16px;bottom:{};z-index:5;pointer-events:none;max-width:60vw;"
        "font:13px/1.5 system-ui,sans-serif;color:#222;text-shadow:0 0 3px #fff,0 0 3px #fff"
    )
    still: str = "14px"  # distance from the lower edge of the page
    playing: str = "58px"  # the same of a motion, which has a bar below
    swatch: str = (
        "display:inline-block;width:10px;height:10px;border-radius:5px;margin-right:6px;"
        "background:{}"
    )

    def entry(self, color: str, words: str) -> str:
        """A line of a legend."""
        return f'<div><span style="{self.swatch.format(color)}"></span>{html.escape(words)}</div>'


def caption_html(
    result: Solution | Motion,
    shown: Sequence[Posture],
    slices: Slices,
    look: CaptionLook = CaptionLook(),
) -> str:
    """The caption in a corner of a page: its title, the objective, and a legend of the colours."""
    moves = isinstance(result, Motion)
    title = html.escape(short(result.problem.name, 60))
    lines = [f'<div style="font-weight:600;font-size:15px">{title}</div>']
    words = filter(None, [_value(result, shown), evidence_words(result)])
    lines += [f"<div>{html.escape(line)}</div>" for line in words]
    lines += [look.entry(color, f"arm {name}") for name, color in arm_colors(shown[0]).items()]
    units = dict(zip(("linear", "angular"), semi_axis_units(result), strict=True))
    for kind, scale in slices.scales.items():
        value = round_scale(0.2 / scale)
        size = f"{value * scale:.2g} m drawn = {value:g} {units[kind]}"
        lines.append(look.entry(slices.look.colors[kind], f"{kind} accelerations, {size}"))
    if isinstance(result, Motion) or has_before(result):
        lines.append(look.entry(LOOK.before, "where it begins" if moves else "before"))
    place = look.block.format(look.playing if moves else look.still)
    return f'<div id="copose-caption" style="{place}">{"".join(lines)}</div>'


def _value(result: Solution | Motion, shown: Sequence[Posture]) -> str:
    """The objective's value and its gain."""
    if isinstance(result, Motion):
        seconds = result.time[-1] - result.time[0] if result.time else 0.0
        return f"{objective_name(result)} along the path, {seconds:.3g} s"
    words = value_words(result, shown[0])
    gain = gain_words(result)
    return f"{words}; {gain}" if gain else words
