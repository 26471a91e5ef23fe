"""Study files that tests are built from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cells import toml
from copose.batch import RunOptions, run_points
from copose.studies import Study, StudyFolder, StudyTable
from reference import PROBLEMS


def study_text(problem: Path = PROBLEMS / "paper-fig2.toml", **tables: Any) -> str:
    """A study over the object's mass, of a planar problem that is measured at its start."""
    study: dict[str, Any] = {
        "format": 1,
        "name": "masses",
        "problem": str(problem),
        "command": "evaluate",
        "vary": [{"key": "object.mass", "from": 0.1, "to": 0.5, "steps": 5}],
    }
    return toml({key: value for key, value in (study | tables).items() if value is not None})


def written(folder: Path, text: str, name: str = "study.toml") -> Path:
    """A study file with a text."""
    (folder / name).write_text(text)
    return folder / name


def run(file: Path, folder: Path, **options: Any) -> StudyTable:
    """The table of a study that is run in a folder."""
    study, place = Study.read(file), StudyFolder(folder)
    run_points(study, place, RunOptions(**options))
    return StudyTable.of(study, place)


def lines(table: StudyTable) -> list[dict[str, Any]]:
    """The lines of a table in the order of the points, but for seconds."""
    every = [table.line(point) for point in range(len(table))]
    return [{k: v for k, v in line.items() if k != "seconds"} for line in every if line]
