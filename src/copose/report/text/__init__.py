"""Results as tables on a terminal."""

from copose.report.text.comparison import comparison_table
from copose.report.text.motion import motion_table
from copose.report.text.solution import solution_table
from copose.report.text.start import chains, guesses

__all__ = ["chains", "comparison_table", "guesses", "motion_table", "solution_table"]
