"""The folder of a study: its record, and which study it is of."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from copose.errors import InputError
from copose.problem import read_text
from copose.results import write_file
from copose.studies.study import Study


@dataclass(frozen=True)
class StudyFolder:
    """The folder of a study."""

    path: Path

    @property
    def record(self) -> Path:
        """A line of JSON for each point that is done."""
        return self.path / "study.jsonl"

    @property
    def parquet(self) -> Path:
        """The same as a table."""
        return self.path / "study.parquet"

    @property
    def picture(self) -> Path:
        """The map."""
        return self.path / "map.png"

    @property
    def about(self) -> Path:
        """Texts of the study file and the problem file that the record is of."""
        return self.path / "study.json"

    @property
    def crashes(self) -> Path:
        """The point that a plain loop is at; there while it runs, and after a crash."""
        return self.path / ".study-crashes"

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
