"""Studies: many problems asked for in one file, their record and its table."""

from copose.studies.columns import read_study, write_parquet
from copose.studies.study import Study, StudyFolder
from copose.studies.table import StudyTable

__all__ = ["Study", "StudyFolder", "StudyTable", "read_study", "write_parquet"]
