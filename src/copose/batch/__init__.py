"""Studies at work: many problems in a plain loop, or on a cluster."""

from copose.batch.run import RunOptions, RunOutcome, run_points, run_study
from copose.batch.validation import check_study, estimate

__all__ = ["RunOptions", "RunOutcome", "check_study", "estimate", "run_points", "run_study"]
