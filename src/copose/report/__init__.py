"""Figures of results; their tables are in `text`, which loads Rich."""

from copose.report.figures.files import (
    check_format,
    draw,
    draw_comparison,
    draw_start,
    motion_animation,
    picture,
)
from copose.report.panels import compare

__all__ = [
    "check_format",
    "compare",
    "draw",
    "draw_comparison",
    "draw_start",
    "motion_animation",
    "picture",
]
