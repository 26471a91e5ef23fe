"""Tables and figures of results."""

from copose.report.picture import check_format, draw, picture
from copose.report.tables import chains, solution_table

__all__ = ["chains", "check_format", "draw", "picture", "solution_table"]
