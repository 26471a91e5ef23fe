"""Tables and figures of results."""

from copose.report.comparing import Comparison, compare, comparison_table
from copose.report.picture import check_format, draw, draw_comparison, picture
from copose.report.tables import chains, solution_table

__all__ = [
    "Comparison",
    "chains",
    "check_format",
    "compare",
    "comparison_table",
    "draw",
    "draw_comparison",
    "picture",
    "solution_table",
]
