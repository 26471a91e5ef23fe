"""Maps and tables of studies."""

from copose.report.studies.files import draw_study, study_map, study_picture
from copose.report.studies.table import study_table

__all__ = ["draw_study", "study_map", "study_picture", "study_table"]
