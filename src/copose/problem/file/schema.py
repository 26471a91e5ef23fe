"""JSON Schema of problem files, for editors, and every key as a page of Markdown."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import AliasChoices, BaseModel
from pydantic.json_schema import models_json_schema

from copose.problem.file.messages import tables_of
from copose.problem.spaces import SPACES
from copose.problem.spec import PlanarProblem, SpatialProblem


def made_schema() -> str:
    """Text of the file `copose.problem.SCHEMA`."""
    kinds = (SpatialProblem, PlanarProblem)
    _, whole = models_json_schema([(kind, "validation") for kind in kinds])
    definitions = {name: _plain(each) for name, each in whole["$defs"].items()}
    for model in _models(*kinds):
        if model.__name__ in definitions:
            _describe(definitions[model.__name__], model)
    for name in ("RobotArm", "PlanarArm"):
        # A start teaches a grasp that is left out, and they together the object's position.
        definitions[name]["required"].remove("grasp")
        definitions[name]["anyOf"] = [{"required": ["grasp"]}, {"required": ["start"]}]
    definitions["RobotArm"]["oneOf"] = [{"required": ["urdf"]}, {"required": ["mjcf"]}]
    for name in ("SpatialObject", "PlanarObject"):
        definitions[name]["required"].remove("position")
    for kind in kinds:
        planar = kind is PlanarProblem
        spaces = [name for name, space in SPACES.items() if space.planar == planar]
        definitions[kind.__name__]["allOf"] = [
            {"properties": {"task": {"properties": {"space": {"enum": spaces}}}}}
        ]
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "copose problem file",
        "anyOf": [{"$ref": f"#/$defs/{kind.__name__}"} for kind in kinds],
        "$defs": definitions,
    }
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def described(model: type[BaseModel]) -> dict[str, str]:
    """Texts of a model's fields by name, from its docstring and those of its bases."""
    texts: dict[str, str] = {}
    for parent in reversed(model.__mro__):
        _, _, section = inspect.cleandoc(parent.__dict__.get("__doc__") or "").partition(
            "\nAttributes:\n"
        )
        name = ""
        for line in section.splitlines():
            if line.startswith("    ") and line[4:5].strip():
                name, _, text = line.strip().partition(": ")
                texts[name] = text
            elif name and line.strip():
                texts[name] += f" {line.strip()}"
    return texts


def _models(*models: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """The models and all that they are made of."""
    seen = list(models)
    for model in seen:
        yield model
        for field in model.model_fields.values():
            seen += [table for table in tables_of(field.annotation) if table not in seen]


def _describe(definition: dict[str, Any], model: type[BaseModel]) -> None:
    told = inspect.cleandoc(model.__doc__ or "").partition("\n")[0]
    definition["description"] = told.replace("``", "`")
    texts = described(model)
    properties: dict[str, Any] = {}
    for name, field in model.model_fields.items():
        names = [name]
        if isinstance(field.validation_alias, AliasChoices):
            names = [str(choice) for choice in field.validation_alias.choices]
        given = definition["properties"][names[0]]
        if field.default_factory is not None:
            given["default"] = field.get_default(call_default_factory=True)
        given["description"] = texts[name][0].upper() + texts[name][1:]
        properties |= dict.fromkeys(names, given)
    definition["properties"] = properties


def _plain(node: Any) -> Any:
    """Without null, which TOML does not have, and titles; arrays of like entries by one of them."""
    if isinstance(node, list):
        return [_plain(each) for each in node]
    if not isinstance(node, Mapping):
        return node
    plain = {
        key: _plain(each)
        for key, each in node.items()
        if each is not None and not (key == "title" and isinstance(each, str))
    }
    kinds = plain.get("anyOf")
    if kinds and {"type": "null"} in kinds:
        kinds.remove({"type": "null"})
        if len(kinds) == 1:
            del plain["anyOf"]
            plain |= kinds[0]
    entries = plain.get("prefixItems")
    if entries and all(entry == entries[0] for entry in entries):
        del plain["prefixItems"]
        plain["items"] = entries[0]
    # The member whose kind it is follows from the rest.
    plain.pop("discriminator", None)
    return plain


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
