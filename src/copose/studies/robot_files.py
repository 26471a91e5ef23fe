"""The files of a study's robots, by content: part of every point's hash, and sent to workers."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from copose.collision.links.link_shapes import LINK_FORMATS
from copose.errors import InputError, arm_key, blamed_on
from copose.problem import PlanarArm, Problem, RobotArm, changed, overridden
from copose.robots.files.file_paths import PACKAGE
from copose.robots.files.mjcf_model import mjcf_files
from copose.robots.robot import Robot, RobotsRead, read_robot
from copose.studies.points.hashes import RobotDigests, canonical
from copose.studies.points.problems import PointProblems
from copose.studies.study_file import StudyFile, Vary


@dataclass(frozen=True)
class RobotSources:
    """The files of a robot that decide an answer."""

    # The one that names the others. In place of a .xacro, whose own files and folders need not be
    # anywhere else, its expansion, as a file beside it that there is not.
    file: Path
    # By absolute path, the file's first; None where there is none that could matter.
    contents: Mapping[Path, bytes | None]
    packages: Mapping[str, Path]  # folders of the packages that it names

    @classmethod
    def of(cls, robot: Robot, *, shapes: bool) -> RobotSources:
        """The files of a robot that was read, with those of its links' shapes where they matter."""
        tree, file = robot.tree, robot.tree.file
        if tree.format == "mjcf":
            contents = {path: content_of(path) for path in mjcf_files(file)}
        elif tree.expansion:
            expansion = b"\xef\xbb\xbf" + tree.expansion.encode()
            mark = hashlib.blake2b(expansion, digest_size=8).hexdigest()
            file = file.with_name(f"{file.stem}-{mark}.urdf")
            contents = {file: expansion}
        else:
            contents = {file: content_of(file)}
        meshes: Mapping[str, Path] = {}
        if shapes:
            contents[file.with_suffix(".srdf")] = content_of(tree.file.with_suffix(".srdf"))
            meshes = LINK_FORMATS[tree.format].geometry(robot, True).files
            contents |= {path: content_of(path) for path in meshes.values()}
        return cls(file, contents, dict(filter(None, map(_package, meshes.items()))))


def content_of(file: Path) -> bytes | None:
    """The bytes of a file; None where there is none that can be read."""
    with contextlib.suppress(OSError):
        return file.read_bytes()
    return None


def _package(mesh: tuple[str, Path]) -> tuple[str, Path] | None:
    """The package of ``package://PACKAGE/…`` and its folder; None of other names."""
    name, path = mesh
    for scheme in (PACKAGE, "model://"):
        if name.startswith(scheme):
            package, _, rest = name.removeprefix(scheme).partition("/")
            folder = path
            for _ in Path(rest).parts:
                folder = folder.parent
            return package, folder
    return None


# Keys of ``[[arms]]`` that say which files a robot is read from.
_FILE_KEYS = ("urdf", "mjcf", "packages", "xacro_args")


@dataclass(frozen=True)
class RobotPlace:
    """Where a robot's file is, and the packages that it names."""

    file: Path
    packages: Mapping[str, Path]


@dataclass(frozen=True)
class RobotPlaces:
    """The places of a study's robots and hashes of their files: small, whatever the meshes."""

    # By what the tables of arms say of a robot's files, see `_name`.
    robots: Mapping[str, RobotPlace]
    # Of the files, by absolute path; None where there must be none.
    digests: Mapping[Path, bytes | None]

    @property
    def there(self) -> bool:
        """True where this machine has the same files at the same paths."""
        return all(_digest(content_of(file)) == digest for file, digest in self.digests.items())


@dataclass(frozen=True)
class RobotFiles:
    """Robot files and whatever they name that decides an answer."""

    # By absolute path; None where there is no file, and one would matter.
    contents: Mapping[Path, bytes | None]
    robots: Mapping[str, RobotPlace]  # where each robot is among them, see `RobotPlaces`
    digests: RobotDigests  # of all contents and names, and of those that a point reads

    @classmethod
    def of(cls, problems: PointProblems, study: StudyFile) -> Self:
        """The files of all robots that the points of a study name.

        Raises:
            InputError: a robot cannot be read.
        """
        contents: dict[Path, bytes | None] = {}
        robots: dict[str, RobotPlace] = {}
        parts: dict[str, str] = {}
        read: RobotsRead = {}
        choices = _choices(problems, study)
        for numbers, problem in _robot_problems(problems, choices):
            own: dict[Path, bytes | None] = {}
            for i, arm in enumerate(problem.arms):
                if isinstance(arm, RobotArm):
                    with blamed_on(problems.file):
                        robot = read_robot(arm, problems.file.parent, arm_key(i, arm.name), read)
                    sources = RobotSources.of(robot, shapes=problem.constraints.collision)
                    own |= sources.contents
                    packages = {**robot.packages, **sources.packages}
                    robots[_name(arm)] = RobotPlace(sources.file, packages)
            contents |= own
            parts[numbers] = _digest_of(own)
        varied = [choice for choice in choices if len(choice.rows) > 1]
        told = tuple((choice.keys, choice.numbers) for choice in varied)
        return cls(contents, robots, RobotDigests(_digest_of(contents), told, parts))

    @cached_property
    def places(self) -> RobotPlaces:
        """The same without the contents."""
        digests = {file: _digest(content) for file, content in self.contents.items()}
        return RobotPlaces(self.robots, digests)

    def write(self, root: Path) -> None:
        """Write the files below a folder, each at its path; names that are paths go there, too."""
        written = dict[Path, bytes]()
        for file, content in self.contents.items():
            if content is not None:
                place = below(root, file)
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_bytes(content)
                written[place] = content
        for place, content in written.items():
            if content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
                place.write_bytes(_moved(content, root))


class PlacedProblems(PointProblems):
    """The problems of a study with their robots' files where a worker has them."""

    def __init__(self, problems: PointProblems, places: RobotPlaces, root: Path | None) -> None:
        """The problems of a study on a worker, where the robots' files stand below a root, or
        without one in place.
        """
        super().__init__(problems.tables, problems.file)
        self._problems, self._robots, self._root = problems, places.robots, root

    def at(self, values: Mapping[str, Any]) -> Problem:
        """See `PointProblems.at`."""
        problem = self._problems.at(values)
        return changed(problem, {"arms": tuple(map(self._placed, problem.arms))})

    def _placed(self, arm: RobotArm | PlanarArm) -> RobotArm | PlanarArm:
        place = self._robots.get(_name(arm)) if isinstance(arm, RobotArm) else None
        if not isinstance(arm, RobotArm) or place is None:
            return arm
        packages = {name: str(below(self._root, path)) for name, path in place.packages.items()}
        update = {arm.kind: str(below(self._root, place.file)), "packages": packages}
        return arm.model_copy(update={**update, "xacro_args": {}})


def below(root: Path | None, path: Path) -> Path:
    """Where an absolute path is below a folder; without one, the path itself."""
    return path if root is None else root / path.relative_to(path.anchor)


def _name(arm: RobotArm) -> str:
    """What an arm says of its robot's files."""
    return json.dumps([getattr(arm, key) for key in _FILE_KEYS], sort_keys=True)


def _digest(content: bytes | None) -> bytes | None:
    return None if content is None else hashlib.blake2b(content, digest_size=16).digest()


def _moved(content: bytes, root: Path) -> bytes:
    """XML whose attributes name files and folders below a root where they name absolute paths."""

    def moved(match: re.Match[bytes]) -> bytes:
        quote, scheme, path = match.groups()
        place = below(root, Path(path.decode(errors="replace")))
        return b"".join((quote, scheme, bytes(place), quote)) if place.exists() else match[0]

    return re.sub(rb"([\"'])(file://)?(/[^\"'<>]+)\1", moved, content)


@dataclass(frozen=True)
class _Choice:
    """The different robot files that a ``[[vary]]`` table names."""

    keys: tuple[str, ...]  # of the table
    rows: tuple[Mapping[str, Any], ...]  # one for each choice
    numbers: Mapping[str, int]  # of the choice, by a row of values, JSON


def _choices(problems: PointProblems, study: StudyFile) -> tuple[_Choice, ...]:
    """What each ``[[vary]]`` table of a study does to robot files."""
    first = {key: value for vary in study.vary for key, value in _rows(vary)[0].items()}
    choices = []
    for vary in study.vary:
        different: dict[str, Mapping[str, Any]] = {}
        numbers: dict[str, int] = {}
        for row in _rows(vary):
            with contextlib.suppress(InputError):
                said = _said(overridden(problems.tables, {**first, **row}))
                different.setdefault(said, row)
                numbers[canonical(list(row.values()))] = list(different).index(said)
        rows = tuple(different.values()) or (_rows(vary)[0],)
        choices.append(_Choice(vary.names, rows, numbers))
    return tuple(choices)


def _robot_problems(
    problems: PointProblems, choices: Sequence[_Choice]
) -> Iterator[tuple[str, Problem]]:
    """Problems that between them name all robot files, by the numbers of their choices."""
    for rows in itertools.product(*(enumerate(choice.rows) for choice in choices)):
        numbers = [i for (i, _), choice in zip(rows, choices, strict=True) if len(choice.rows) > 1]
        # What is wrong with a problem its points say.
        with contextlib.suppress(InputError):
            values = {key: value for _, row in rows for key, value in row.items()}
            yield ",".join(map(str, numbers)), problems.at(values)


def _digest_of(contents: Mapping[Path, bytes | None]) -> str:
    """A hash of contents and names of files, whatever the folders."""
    state = hashlib.blake2b(digest_size=16)
    for file, content in contents.items():
        if content is not None:
            state.update(f"{file.name}\0{len(content)}\0".encode())
            state.update(content)
    return state.hexdigest()


def _rows(vary: Vary) -> list[dict[str, Any]]:
    """The values of a ``[[vary]]`` table; of a range, which names no file, its ends."""
    if vary.values is None:
        return [{vary.names[0]: vary.lower}, {vary.names[0]: vary.upper}]
    rows = vary.values if vary.keys is not None else tuple((value,) for value in vary.values)
    return [dict(zip(vary.names, row, strict=True)) for row in rows]


def _said(tables: Mapping[str, Any]) -> str:
    """What the tables of a problem say of robot files, and whether shapes matter."""
    arms = [{key: arm.get(key) for key in _FILE_KEYS} for arm in tables["arms"]]
    collision = tables.get("constraints", {}).get("collision")
    return json.dumps([arms, collision], sort_keys=True, default=str)
