"""The hash of a point: of everything that decides its line."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, Self

from copose.studies.study_file import StudyFile
from copose.version import __version__

# Of the lines of a record; one more whenever their keys or their meaning change.
RECORD_FORMAT = 1
# JSON that is the same for equal data; dates and their like as TOML has them.
_canonical = json.JSONEncoder(sort_keys=True, separators=(",", ":"), default=str).encode


class PointHashes:
    """The hashes of a study's points: of what all have in common, of each one's values and seed.

    Attributes:
        common: hash of problem, robot files, command, effort, what is recorded, and version.
    """

    def __init__(self, common: str) -> None:
        """The hashes of points with this in common, see `of`."""
        self.common = common
        self._state = hashlib.blake2b(common.encode(), digest_size=16)

    @classmethod
    def of(cls, study: StudyFile, tables: Mapping[str, Any], robots: str) -> Self:
        """The hashes of a study.

        Args:
            study: as read.
            tables: of the problem, see `PointProblems`.
            robots: a digest of all robot files.
        """
        common = {
            "format": RECORD_FORMAT,
            "copose": __version__,
            "problem": {
                k: table for k, table in tables.items() if k not in ("description", "name")
            },
            "robots": robots,
            "command": study.command,
            "effort": study.effort,
            "record": study.record,
        }
        return cls(hashlib.blake2b(_canonical(common).encode(), digest_size=16).hexdigest())

    def at(self, values: Mapping[str, Any], seed: int) -> bytes:
        """The hash of a point, 16 bytes."""
        state = self._state.copy()
        state.update(_canonical({"values": values, "seed": seed}).encode())
        return state.digest()
