"""Tables and figures of results."""

from copose.report.figures.files import (
    check_format,
    draw,
    draw_comparison,
    draw_start,
    figure,
    motion_animation,
    picture,
    saved,
    starts_figure,
)
from copose.report.panels import compare
from copose.report.text.comparison import comparison_table
from copose.report.text.motion import motion_table
from copose.report.text.solution import solution_table
from copose.report.text.start import chains, guesses

__all__ = [
    "chains",
    "check_format",
    "compare",
    "comparison_table",
    "draw",
    "draw_comparison",
    "draw_start",
    "figure",
    "guesses",
    "motion_animation",
    "motion_table",
    "picture",
    "saved",
    "solution_table",
    "starts_figure",
]
