"""The schema says what the models say, and shipped problems are as it wants them."""

from __future__ import annotations

import copy
import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import pytest

import copose
from cells import FILES, planar, tables, two_pandas
from copose.commands.command_line import main
from copose.errors import InputError
from copose.manual import page
from copose.problem import SCHEMA
from copose.problem.file.schema import made_reference, made_schema

VALIDATOR = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text()))


def test_the_file_in_the_package_is_what_the_models_make() -> None:
    assert SCHEMA.read_text() == made_schema(), "write made_schema() to it"
    reference = made_reference(json.loads(SCHEMA.read_text()))
    assert page("problem-files") == reference, "write made_reference(…) to it"
    jsonschema.Draft202012Validator.check_schema(VALIDATOR.schema)


def test_the_command_prints_it(capsys: pytest.CaptureFixture) -> None:
    assert main(["schema"]) == 0
    assert capsys.readouterr().out == SCHEMA.read_text()


def test_every_key_is_described() -> None:
    for name, table in VALIDATOR.schema["$defs"].items():
        for key, about in table["properties"].items():
            assert len(about["description"]) > 5, (name, key)
            # A key may be left out: its default stands there, or what leaving it out means.
            needed = key in table.get("required", []) or "const" in about
            told = "default" in about or "left out" in about["description"]
            assert needed or told or ORIGINS.get((name, key)), (name, key)


# What is one of two keys, or of some objectives and spaces alone.
ORIGINS = dict.fromkeys(
    [(name, "quaternion") for name in VALIDATOR.schema["$defs"]]
    + [("AccelerationObjective", key) for key in ("direction", "directions")]
    + [("PayloadObjective", "direction")],
    True,
)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_shipped_problems_are_valid_and_name_it(file: Path) -> None:
    text = file.read_text()
    first = text.splitlines()[0]
    assert first.startswith("#:schema ")
    assert (file.parent / first.removeprefix("#:schema ")).resolve().name == SCHEMA.name
    assert (file.parent / first.removeprefix("#:schema ")).exists()
    VALIDATOR.validate(tomllib.loads(text))


def keys(node: object, path: tuple = ()) -> Iterator[tuple]:
    """Paths to all keys that a problem file has by the format, not by its own choice."""
    if isinstance(node, dict):
        for key, value in node.items():
            if path[-1:] not in (("locked",), ("packages",)):
                yield (*path, key)
            yield from keys(value, (*path, key))
    elif isinstance(node, list):
        for i, value in enumerate(node):
            yield from keys(value, (*path, i))


@pytest.mark.parametrize("file", FILES[::4], ids=lambda file: file.stem)
def test_a_misspelt_key_gives_the_nearest(file: Path) -> None:
    whole = tables(file.stem)
    for path in keys(whole):
        # Which space, and which of several kinds, is then not known.
        if path == ("task", "space") or path[-1] == "kind":
            continue
        cell = copy.deepcopy(whole)
        node: object = cell
        for part in path[:-1]:
            node = node[part]  # type: ignore[index]
        node[path[-1] + path[-1][-1]] = node.pop(path[-1])  # type: ignore[index, attr-defined]
        assert not VALIDATOR.is_valid(cell), path
        with pytest.raises(InputError) as caught:
            copose.parse(cell)
        assert f"unknown key; did you mean {path[-1]!r}?" in caught.value.message, path


TURN = [1, 0, 0, 0]
ARM = {"name": "a", "urdf": "a.urdf", "tip": "t"}


@pytest.mark.parametrize(
    ("change", "valid"),
    [
        ({"object": {"mass": 1, "inertia": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}, True),
        ({"object": {"mass": 1, "position": [0, 0, 0], "quaternion": TURN}}, True),
        ({"object": {"mass": 1, "position": [0, 0]}}, False),
        ({"object": {"mass": 1, "angle": 1.0}}, False),
        ({"object": {"mass": "1"}}, False),
        ({"task": {"space": "planar"}}, False),
        ({"objective": {"axes": ["x"]}}, True),
        ({"objective": {"kind": "acceleration", "directions": [[1, 0, 0]]}}, True),
        ({"objective": {"kind": "volume", "directions": []}}, False),
        ({"path": {"waypoints": [{}, {"quaternion": TURN}], "duration": "shortest"}}, True),
        ({"path": {"waypoints": [{}, {}], "duration": "fast"}}, False),
        ({"arms": [ARM]}, False),
        ({"arms": [ARM | {"start": [1]}]}, True),
        ({"arms": [ARM | {"start": [1], "torque_limits": [float("inf")]}]}, True),
    ],
)  # fmt: skip
def test_what_is_valid(change: dict, valid: bool) -> None:
    assert VALIDATOR.is_valid(two_pandas() | change) == valid


def test_the_plane_has_tables_of_its_own() -> None:
    cell = planar()
    VALIDATOR.validate(cell)
    cell["task"]["space"] = "spatial"
    assert not VALIDATOR.is_valid(cell)
