"""The problem at each point of a study."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from copose.errors import InputError
from copose.loader import taught
from copose.problem import Problem, overridden, parse, read_override, tables_in
from copose.studies.study_file import StudyFile


class PointProblems:
    """A problem file with other values at each point; grasps are taught once, before them.

    Attributes:
        tables: of the problem file, with what the study sets at all points.
        file: the problem file.
    """

    def __init__(self, tables: Mapping[str, Any], file: Path) -> None:
        """The problems of some tables; see `of`."""
        self.tables, self.file = tables, file

    @classmethod
    def of(cls, study: StudyFile, text: str) -> PointProblems:
        """The problems of a study, of the text of its problem file.

        Raises:
            InputError: the text is no problem, or what the study sets has no place in it.
        """
        file = study.problem_file
        tables = taught(tables_in(text, file), file)
        if study.set:
            parse(tables, file)
            tables = _with_settings(tables, study)
        return cls(tables, file)

    def at(self, values: Mapping[str, Any]) -> Problem:
        """The problem with these values of its keys.

        Raises:
            InputError: it is wrong.
        """
        return parse(overridden(self.tables, values), self.file)


def _with_settings(tables: Mapping[str, Any], study: StudyFile) -> Mapping[str, Any]:
    """Tables with what a study sets at all points.

    Raises:
        InputError: of the study file: a setting has no place, or all together are wrong.
    """
    key = "set"
    try:
        for i, text in enumerate(study.set):
            key = f"set[{i}]"
            name, value = read_override(text)
            tables = overridden(tables, {name: value})
        key = "set"
        parse(tables, study.problem_file)
    except InputError as error:
        told = f"{error.key}: {error.message}" if error.key != "--set" else error.message
        raise InputError(told, key=key, file=study.source) from None
    return tables
