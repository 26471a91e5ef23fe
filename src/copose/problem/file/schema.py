"""JSON Schema of problem files, for editors: from the models and what their docstrings say."""

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
