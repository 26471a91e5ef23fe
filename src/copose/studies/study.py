"""A study: its file, the points that it asks for, the problem at each of them, and its folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Self

from copose.errors import InputError
from copose.problem import read_text, tables_in
from copose.results import write_file
from copose.studies.points.hashes import PointHashes, PointIndex, RobotDigests
from copose.studies.points.points import Points
from copose.studies.points.problems import PointProblems
from copose.studies.robot_files import RobotFiles
from copose.studies.study_file import StudyFile, parse_study


class Study:
    """A study with all that its file names.

    Attributes:
        file: the study file.
        problems: by the values of a point.
        points: by number.
        hashes: of the points.
        texts: the files' texts and what the hashes are made of: of them it can be made anew.
    """

    def __init__(
        self,
        file: StudyFile,
        problems: PointProblems,
        hashes: PointHashes,
        texts: Mapping[str, str],
    ) -> None:
        """A study of these parts; see `read`."""
        self.file, self.problems, self.hashes, self.texts = file, problems, hashes, texts
        self.points = Points(file)

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """The study of a file.

        Raises:
            InputError: the file, the problem file or a robot file is wrong.
        """
        file = Path(path)
        text = read_text(file)
        study = parse_study(tables_in(text, file), file)
        try:
            problem_text = read_text(study.problem_file)
        except InputError as error:
            told = f"{error.file}: {error.message}"
            raise InputError(told, key="problem", file=file) from None
        problems = PointProblems.of(study, problem_text)
        robots = RobotFiles.of(problems, study)
        hashes = PointHashes.of(study, problems.tables, robots.digests)
        texts = {
            "file": str(file.absolute()),
            "study": text,
            "problem": problem_text,
            "common": hashes.common,
            "robots": hashes.robots.text,
        }
        return cls(study, problems, hashes, texts)

    @classmethod
    def of_texts(cls, texts: Mapping[str, str]) -> Self:
        """The study that has these `texts`; its robots may have changed since.

        Raises:
            InputError: the problem cannot be read any more.
            KeyError: a text is missing.
            ValueError: a text is damaged.
        """
        file = Path(texts["file"])
        study = parse_study(tables_in(texts["study"], file), file)
        problems = PointProblems.of(study, texts["problem"])
        robots = RobotDigests.of_text(texts["robots"])
        return cls(study, problems, PointHashes(texts["common"], robots), texts)

    @cached_property
    def index(self) -> PointIndex:
        """The points by their hashes."""
        return PointIndex(self.points, self.hashes)


class StudyFolder:
    """The folder of a study, and its files.

    Attributes:
        path: the folder.
        record: a line of JSON for each point that is done.
        parquet: the same as a table.
        picture: the map.
        about: texts of the study file and the problem file that the record is of.
        crashes: the point that a plain loop is at; there while it runs, and after a crash.
    """

    def __init__(self, path: Path) -> None:
        """The folder at a path; nothing is made there."""
        self.path = path
        self.record, self.parquet = path / "study.jsonl", path / "study.parquet"
        self.picture, self.about = path / "map.png", path / "study.json"
        self.crashes = path / ".study-crashes"

    def remember(self, study: Study) -> None:
        """Write which study the folder is of.

        Raises:
            InputError: it cannot be written.
        """
        write_file(self.about, (json.dumps(study.texts, indent=1) + "\n").encode())

    def study(self) -> Study:
        """The study that the folder is of.

        Raises:
            InputError: there is none, or its robots cannot be read any more.
        """
        if not self.about.is_file():
            raise InputError("is no folder of a study: there is no study.json", file=self.path)
        try:
            texts = json.loads(read_text(self.about))
            return Study.of_texts(texts)
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"is no copose study ({error})", file=self.about) from None
