"""Every key of a problem file as a page of Markdown, made from the schema."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

_HEAD = """# Problem files

A problem file is TOML. Every key that it may have stands here, table by table, with what it is
where it is left out; `copose schema` prints the same for editors. Lengths are in m, angles in rad,
masses in kg.
"""


def made_reference(schema: Mapping[str, Any]) -> str:
    """The page, of a schema as `made_schema` makes it."""
    definitions = schema["$defs"]
    first = [entry["$ref"].rpartition("/")[2] for entry in schema["anyOf"]]
    order = list(first)
    for name in order:
        order += [other for other in _named(definitions[name]) if other not in order]
    return "\n".join([_HEAD, *(line for name in order for line in _table(definitions[name]))])


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


def _table(definition: Mapping[str, Any]) -> Iterator[str]:
    yield f"## {definition['description'].rstrip('.')}\n"
    yield "| key | left out | meaning |"
    yield "| --- | --- | --- |"
    required = definition.get("required", ())
    for key, given in definition["properties"].items():
        if "const" in given:
            key = f"{key} = {_toml(given['const'])}"
        default = "required" if key.partition(" ")[0] in required else "–"
        if given.get("default") not in (None, [], "") and not isinstance(given["default"], dict):
            default = f"`{_toml(given['default'])}`"
        meaning = given["description"]
        if "enum" in given:
            meaning += " One of " + ", ".join(f"`{_toml(each)}`" for each in given["enum"]) + "."
        yield f"| `{key}` | {default} | {meaning.replace('|', chr(92) + '|')} |"
    yield ""


def _toml(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
