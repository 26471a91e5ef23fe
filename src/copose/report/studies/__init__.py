"""Maps and tables of studies; maps load Matplotlib once they are drawn."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from copose.report.figures.files import drawing, saved, write_picture
from copose.report.studies.table import study_table
from copose.studies.table import StudyTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_study", "study_map", "study_picture", "study_table"]


def study_map(table: StudyTable) -> Figure:
    """The map of a study as a Matplotlib figure that pyplot does not know."""
    with drawing():
        from copose.report.studies.figure import study_figure

        return study_figure(table)


def study_picture(
    table: StudyTable,
    format: Literal["png", "pdf", "svg"] = "png",  # noqa: A002 - the word for it
) -> bytes:
    """The map of a study as the content of a file."""
    return saved(study_map(table), format)


def draw_study(table: StudyTable, file: Path) -> None:
    """Draw the map of a study into a .png, .pdf or .svg file.

    Raises:
        InputError: the file cannot be written.
    """
    write_picture(file, lambda: study_map(table))
