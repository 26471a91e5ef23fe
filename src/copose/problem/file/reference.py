"""Every key of a problem file as a page of Markdown, made from the schema."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any


def made_reference(schema: Mapping[str, Any]) -> str:
    """The page, of a schema as `made_schema` makes it."""
    head = """# Problem files: every key

A problem file is TOML: tables such as `[object]`, one `[[arms]]` for each arm, and keys in them.
Each table has a section below. It says where the table stands (`object.shape` is the key `shape` of
`[object]`) and lists its keys: what the value is, what it is if the key is left out (– for
nothing), and what it means. Lengths are in m, angles in rad, masses in kg. Tables "in the plane" go
with arms by `links`.

[getting-started](getting-started.md) builds a file step by step; `copose schema` prints all of this
for editors.
"""
    definitions = schema["$defs"]
    places: dict[str, list[str]] = {
        entry["$ref"].rpartition("/")[2]: [""] for entry in schema["anyOf"]
    }
    order = list(places)
    for name in order:
        for key, given in definitions[name]["properties"].items():
            for other in _named(given):
                keys = [f"{place}.{key}".lstrip(".") for place in places[name]]
                places[other] = list(dict.fromkeys([*places.get(other, []), *keys]))
                order += [other] if other not in order else []
    sections = (_section(definitions[name], places[name]) for name in order)
    # Problems in space and in the plane have the same keys.
    return "\n".join([head, *dict.fromkeys(sections)])


def _named(node: Any) -> Iterator[str]:
    """The definitions that a node refers to, in order, each once."""
    if isinstance(node, Mapping):
        if "$ref" in node:
            yield node["$ref"].rpartition("/")[2]
        for each in node.values():
            yield from dict.fromkeys(_named(each))
    elif isinstance(node, list):
        for each in node:
            yield from dict.fromkeys(_named(each))


def _section(definition: Mapping[str, Any], places: list[str]) -> str:
    """Section of a table that stands at some places, of the whole file at none."""
    title, properties = definition["description"].rstrip("."), dict(definition["properties"])
    if "kind" in properties:
        title = f"`kind = {_toml(properties.pop('kind')['const'])}`: {title}"
    if places == [""]:
        title = "The whole file"
    lines = [f"## {title}\n"]
    if any(places) and f"[{places[0]}]" not in title:
        lines.append(f"Stands in `{'`, `'.join(places)}`.\n")
    lines += ["| key | value | left out | meaning |", "| --- | --- | --- | --- |"]
    required = definition.get("required", ())
    for key, given in properties.items():
        default = "required" if key in required else "–"
        if given.get("default") not in (None, [], "") and not isinstance(given["default"], dict):
            default = f"`{_toml(given['default'])}`"
        meaning = given["description"].replace("|", chr(92) + "|")
        lines.append(f"| `{key}` | {_value(given)} | {default} | {meaning} |")
    return "\n".join([*lines, ""])


def _value(given: Mapping[str, Any], plural: bool = False) -> str:
    """Values that a key may have, in words."""
    ending = "s" * plural
    if "const" in given:
        return f"`{_toml(given['const'])}`"
    if "enum" in given:
        return ", ".join(f"`{_toml(each)}`" for each in given["enum"])
    for choice in ("anyOf", "oneOf"):
        if choice in given:
            return " or ".join(dict.fromkeys(_value(each, plural) for each in given[choice]))
    if given.get("type") == "array":
        least, most = given.get("minItems"), given.get("maxItems")
        count = f"{least} " if least is not None and least == most else ""
        inner = _value(given["items"], plural=True)
        return f"{'arrays of ' * plural}{count}{inner}" if count else f"array{ending} of {inner}"
    if given.get("type") == "boolean":
        return "true or false"
    words = {"number": "number", "integer": "whole number", "string": "text"}
    return words.get(given.get("type", ""), "table") + ending


def _toml(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
