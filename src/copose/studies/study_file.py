"""Study files as frozen, validated data: which problems, and what of their results is recorded."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Field, PrivateAttr, ValidationError, model_validator

from copose.errors import InputError
from copose.problem import is_study
from copose.problem.fields import FolderName, Number, Spec, Text, as_tuples, fault, whole
from copose.problem.file.messages import explain

# Points of a study: the index of so many takes about 2 GB.
MOST_POINTS = 20_000_000

Key: TypeAlias = Annotated[str, Field(min_length=1, max_length=300)]
Whole: TypeAlias = Annotated[int, BeforeValidator(whole)]
CommandName: TypeAlias = Literal["solve", "evaluate", "path"]
EffortName: TypeAlias = Literal["low", "normal", "high"]


class Vary(Spec):
    """``[[vary]]``: values that a key, or several keys together, take one after the other.

    Attributes:
        key: dotted path of a key, as ``--set`` takes it.
        keys: in place of ``key``, several that change together.
        lower: ``from``, the least of a range.
        upper: ``to``, the largest.
        steps: number of values of the range, both ends included; not with ``[sample]``.
        values: in place of a range; with ``keys`` a row for each combination.
    """

    key: Key | None = None
    keys: Annotated[tuple[Key, ...], Field(min_length=1, max_length=100)] | None = None
    lower: Number | None = Field(None, alias="from")
    upper: Number | None = Field(None, alias="to")
    steps: Annotated[Whole, Field(ge=1, le=10_000_000)] | None = None
    values: Annotated[tuple[Any, ...], Field(min_length=1)] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The keys that change."""
        return self.keys if self.keys is not None else (self.key or "",)


class SampleSpec(Spec):
    """``[sample]``: points of the ranges and lists of ``[[vary]]`` in place of a grid.

    Attributes:
        method: how they are spread.
        count: number of points.
        seed: seed of their places.
    """

    method: Literal["sobol", "latin-hypercube", "random"]
    count: Annotated[Whole, Field(ge=1, le=10_000_000)]
    seed: Annotated[Whole, Field(ge=0, le=2**63 - 1)] = 0


class MapSpec(Spec):
    """``[map]``: what the picture shows.

    Attributes:
        x: key along the horizontal axis; left out, the first that varies.
        y: key along the vertical axis; left out beside ``x``, a curve of the best over all other
            keys; without both the second key that varies, if there is one.
        value: ``objective`` or a recorded number.
        pareto: two of these of which as much as possible is wanted, as little with ``-`` in front.
    """

    x: Key | None = None
    y: Key | None = None
    value: Key = "objective"
    pareto: tuple[Key, Key] | None = None


class StudyFile(Spec):
    """A study file, as `parse_study` reads it.

    Attributes:
        format: version of the file format, 1.
        name: name of the study, and of the folder for its results.
        description: a text for the reader.
        problem: the problem file, relative to this one.
        set: ``KEY=VALUE`` in place of the problem file's, the same at all points.
        command: what is done with each problem.
        effort: how much is searched.
        seeds: of the search; every point is done with each.
        record: numbers of a result to record beside the objective, by dotted path.
        vary: keys that vary.
        sample: points of their ranges in place of a grid.
        map: what the picture shows.
    """

    format: Annotated[Literal[1], BeforeValidator(whole)]
    name: FolderName
    description: Text = ""
    problem: Annotated[str, Field(min_length=1, max_length=4000)]
    set: tuple[str, ...] = ()
    command: CommandName = "solve"
    effort: EffortName = "normal"
    seeds: Annotated[
        tuple[Annotated[Whole, Field(ge=0, le=2**63 - 1)], ...], Field(min_length=1)
    ] = (0,)
    record: Annotated[tuple[Key, ...], Field(max_length=100)] = ()
    vary: Annotated[tuple[Vary, ...], Field(min_length=1, max_length=100)]
    sample: SampleSpec | None = None
    map: MapSpec = MapSpec()

    _source: Path = PrivateAttr(Path("study.toml"))

    @property
    def source(self) -> Path:
        """The file that the study was read from."""
        return self._source

    @property
    def keys(self) -> tuple[str, ...]:
        """All keys that vary."""
        return tuple(name for vary in self.vary for name in vary.names)

    @property
    def comparable(self) -> bool:
        """True where the objective is of the same kind at all points."""
        return not any(key in ("objective", "objective.kind") for key in self.keys)

    @property
    def problem_file(self) -> Path:
        """The problem file."""
        return Path(os.path.normpath(self._source.parent / Path(self.problem).expanduser()))

    @model_validator(mode="after")
    def _each_vary_is_whole(self) -> StudyFile:
        for i, vary in enumerate(self.vary):
            _check_vary(vary, f"vary[{i}]", sampled=self.sample is not None)
        return self

    @model_validator(mode="after")
    def _nothing_stands_twice(self) -> StudyFile:
        for key, entries in (("seeds", self.seeds), ("record", self.record), ("vary", self.keys)):
            for entry in entries:
                if entries.count(entry) > 1:
                    raise fault(key, f"{entry!r} stands twice; once is enough")
        return self

    @model_validator(mode="after")
    def _keys_are_apart(self) -> StudyFile:
        """Refuse keys of which one is a part of another: only one of them would count."""
        settings = [text.partition("=")[0].strip() for text in self.set]
        named = [*self.keys, *settings]
        for i, one in enumerate(named):
            if one == "search.seed" and i < len(self.keys):
                raise fault("vary", "'search.seed' does not vary so; seeds says which are used")
            for other in named[: min(i, len(self.keys))]:
                parts = _parts(one), _parts(other)
                shared = min(map(len, parts))
                if parts[0][:shared] == parts[1][:shared]:
                    text = f"{one!r} and {other!r} set the same; leave one out"
                    raise fault("vary" if i < len(self.keys) else "set", text)
        return self

    @model_validator(mode="after")
    def _points_are_not_too_many(self) -> StudyFile:
        sizes = [vary.steps or len(vary.values or ()) for vary in self.vary]
        places = math.prod(sizes) if self.sample is None else self.sample.count
        count = places * len(self.seeds)
        if count > MOST_POINTS:
            raise fault("vary", f"asks for {count:.3g} points; at most {MOST_POINTS:,} are done")
        return self

    @model_validator(mode="after")
    def _seeds_matter(self) -> StudyFile:
        if self.command == "evaluate" and len(self.seeds) > 1:
            raise fault("seeds", "evaluate uses none; leave them out")
        return self

    @model_validator(mode="after")
    def _map_shows_what_there_is(self) -> StudyFile:
        for key in ("x", "y"):
            name = getattr(self.map, key)
            if name is not None and name not in self.keys:
                raise fault(f"map.{key}", f"{name!r} does not vary; {_listed(self.keys)}")
        values = ("objective", *self.record)
        shown = {"value": (self.map.value,), "pareto": self.map.pareto or ()}
        for key, names in shown.items():
            for name in names:
                if name.removeprefix("-" if key == "pareto" else "") not in values:
                    raise fault(f"map.{key}", f"{name!r} is not recorded; {_listed(values)}")
        return self


def _parts(key: str) -> list[str]:
    """The parts of a dotted path, components of vectors by number."""
    parts = re.findall(r"""[^."']+|"[^"]*"|'[^']*'""", key)
    return [{"x": "0", "y": "1", "z": "2"}.get(part, part.strip("\"' ")) for part in parts]


def _check_vary(vary: Vary, key: str, *, sampled: bool) -> None:
    """Refuse a table whose keys or values are not said in exactly one way."""
    if (vary.key is None) == (vary.keys is None):
        raise fault(key, "either key or keys is needed")
    ranged = vary.lower is not None or vary.upper is not None
    if ranged == (vary.values is not None):
        raise fault(key, "either values, or from and to, are needed")
    if ranged and vary.keys is not None:
        raise fault(f"{key}.keys", "several keys need rows as values, not a range")
    if not ranged:
        if vary.steps is not None:
            raise fault(f"{key}.steps", "has no meaning with values; leave it out")
        _check_values(vary, key)
        return
    if vary.lower is None or vary.upper is None:
        missing = "from" if vary.lower is None else "to"
        raise fault(f"{key}.{missing}", "missing; a range has from and to")
    if not vary.lower < vary.upper:
        raise fault(f"{key}.to", f"{vary.upper:g} is not above from, {vary.lower:g}")
    if sampled and vary.steps is not None:
        raise fault(f"{key}.steps", "has no meaning with [sample]; its count says how many")
    if not sampled and (vary.steps is None or vary.steps < 2):
        raise fault(f"{key}.steps", "a grid needs at least 2 of them")


def _check_values(vary: Vary, key: str) -> None:
    values = vary.values or ()
    for i, row in enumerate(values):
        if vary.keys is None:
            continue
        if not isinstance(row, tuple) or len(row) != len(vary.keys):
            raise fault(
                f"{key}.values[{i}]", f"must be a row of {len(vary.keys)}, one for each key"
            )


def _listed(names: tuple[str, ...]) -> str:
    return f"one of {', '.join(map(repr, names[:8]))}"


def parse_study(data: Mapping[str, Any], source: Path) -> StudyFile:
    """A study from the tables of its file.

    Raises:
        InputError: it breaks a rule of the format.
    """
    if not is_study(data):
        raise InputError("is no study file: it has no [[vary]]", file=source)
    try:
        study = StudyFile.model_validate(as_tuples(data))
    except ValidationError as error:
        raise explain(error, StudyFile, source) from None
    study._source = source
    return study
