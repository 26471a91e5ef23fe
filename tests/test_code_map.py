"""The map of the code and the help for contributors are true: what they name is there."""

from __future__ import annotations

import importlib
import inspect
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from copose.manual import page
from reference import PROBLEMS

ROOT = PROBLEMS.parent
SOURCE = ROOT / "src/copose"
PAGES = {"code": page("code"), "CONTRIBUTING": (ROOT / ".github/CONTRIBUTING.md").read_text()}
ROOMS = {file.parent.relative_to(SOURCE).as_posix() for file in SOURCE.rglob("__init__.py")} - {"."}


def spans(text: str) -> list[str]:
    """The inline code of a page."""
    prose = re.sub(r"^```.*?^```$|^ {4}[^\n]*$", "", text, flags=re.M | re.S)
    return re.findall(r"`([^`\n]+)`", prose)


def section(heading: str) -> str:
    found = re.search(rf"^#+ {heading}\n(.*?)(?=^#|\Z)", PAGES["code"], re.M | re.S)
    assert found is not None, heading
    return found[1]


def rows(text: str) -> list[list[str]]:
    """The cells of the rows of a table, without its head."""
    lines = re.findall(r"^\|(.*)\|$", text, re.M)
    cells = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)] for line in lines]
    return [row for row in cells[1:] if not row[0].startswith("---")]


def table_rooms(text: str) -> list[str]:
    return [row[0].strip("`").rstrip("/") for row in rows(text)]


def is_there(file: Path, name: str) -> bool:
    """Whether a module has a name, or a class of it a field or an attribute."""
    module = ".".join(("copose", *file.relative_to(SOURCE).with_suffix("").parts))
    thing: object = importlib.import_module(module)
    for part in name.split("."):
        if hasattr(thing, part):
            thing = getattr(thing, part)
            continue
        return inspect.isclass(thing) and any(
            part in inspect.get_annotations(base) or f"self.{part}" in inspect.getsource(base)
            for base in thing.__mro__
            if base.__module__.startswith("copose")
        )
    return True


def missing(text: str) -> Iterator[str]:
    """What a page names that is not there."""
    for span in spans(text):
        if re.fullmatch(r"([a-z_]+/)+", span):
            if span.rstrip("/") not in ROOMS:
                yield span
        elif named := re.fullmatch(r"(\.?[\w/]+\.(?:py|md|toml))(?:: ([\w.]+))?", span):
            files = [folder / named[1] for folder in (SOURCE, ROOT) if (folder / named[1]).exists()]
            if not files or (named[2] and not is_there(files[0], named[2])):
                yield span


@pytest.mark.parametrize("name", PAGES)
def test_what_a_page_names_is_there(name: str) -> None:
    assert sum("/" in span for span in spans(PAGES[name])) > 10
    assert [*missing(PAGES[name])] == []


def test_every_room_is_on_the_map() -> None:
    drawn = table_rooms(section("The rooms"))
    assert sorted(drawn) == sorted(ROOMS)
    assert all(0 < len(row[1]) <= 110 for row in rows(section("The rooms")))


def layers_of(room: str) -> list[str]:
    """The layers of the rooms in a room, the topmost first."""
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    container = ".".join(("copose", *Path(room).parts))
    contracts = tool["importlinter"]["contracts"]
    return next(each["layers"] for each in contracts if each.get("containers") == [container])


@pytest.mark.parametrize("room", sorted({Path(room).parent.as_posix() for room in ROOMS}))
def test_rooms_stand_in_the_order_in_which_they_import(room: str) -> None:
    height = {
        name: i
        for i, layer in enumerate(reversed(layers_of(room)))
        for name in re.split(r" [|:] ", layer)
    }
    paths = [Path(each) for each in table_rooms(section("The rooms"))]
    drawn = [path.name for path in paths if path.parent.as_posix() == room]
    heights = [height[each] for each in drawn]
    assert heights == sorted(heights), [*zip(drawn, heights, strict=True)]


def test_sub_rooms_stand_below_their_room() -> None:
    drawn = table_rooms(section("The rooms"))
    large = [room.partition("/")[0] for room in drawn]
    assert [room for room in drawn if "/" not in room] == [*dict.fromkeys(large)]
    assert large == sorted(large, key=[*dict.fromkeys(large)].index)


def test_the_notation_is_that_of_the_code() -> None:
    table = rows(section("Notation"))
    assert len(table) > 15
    for symbol, words, _, _, where in table:
        text = (SOURCE / where.strip("`").partition(":")[0]).read_text()
        for word in re.findall("`(.*?)`", words):
            assert re.search(rf"\b{word}\b", text), (symbol, word, where)


@pytest.mark.parametrize("name", ["The problem", "Joint positions q", "The seed", "A torque limit"])
def test_a_parameter_goes_through_at_most_eight_rooms_none_twice(name: str) -> None:
    way = table_rooms(section(name))
    assert 4 <= len(way) <= 8 and len({*way}) == len(way)
    for room, row in zip(way, rows(section(name)), strict=True):
        assert Path(row[1].strip("`").partition(":")[0]).parent.as_posix() == room


def test_recipes_have_at_most_four_steps() -> None:
    recipes = re.findall(r"^### An? .*?\n\n(.*?)(?=^#|\Z)", PAGES["CONTRIBUTING"], re.M | re.S)
    assert len(recipes) == 5
    assert all(0 < len(re.findall(r"^\d\. ", recipe, re.M)) <= 4 for recipe in recipes)


def test_contributing_sets_up_in_two_lines() -> None:
    first = re.search(r"^```sh\n(.*?)^```$", PAGES["CONTRIBUTING"], re.M | re.S)
    assert first is not None and len(first[1].splitlines()) == 2
