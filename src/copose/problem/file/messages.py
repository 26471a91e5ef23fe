"""Messages: pydantic's faults as one line in the words of a problem file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from copose.errors import InputError, arm_key, nearest, shown


def explain(
    error: ValidationError,
    model: type[BaseModel],
    source: Path | None,
    data: Mapping[str, Any] | None = None,
) -> InputError:
    """The first fault, with its key and what would be right, and how many more there are.

    Unknown keys come first: a misspelt key is also a missing one. The names of arms are those that
    ``data`` gives them.
    """
    errors = error.errors(include_url=False)
    # An array whose only entry is wrong is also called too short.
    faults = [
        fault
        for fault in errors
        if not (
            fault["type"] == "too_short"
            and any(
                other["loc"][: len(fault["loc"])] == fault["loc"]
                for other in errors
                if other is not fault
            )
        )
    ]
    faults.sort(key=lambda fault: fault["type"] != "extra_forbidden")
    owner, location = _owner(model, tuple(faults[0]["loc"]))
    context = faults[0].get("ctx", {})
    if faults[0]["type"] == "missing" and isinstance(location[-1], int):
        location = location[:-1]
    if faults[0]["type"] == "union_tag_invalid":
        location = (*location, "kind")
    text = _text(faults[0], owner, faults)
    if len(faults) > 1:
        text += f" (and {len(faults) - 1} more)"
    return InputError(
        text, key=_named(str(context.get("key", _key(location))), data or {}), file=source
    )


def _text(fault: ErrorDetails, owner: type[BaseModel] | None, faults: list[ErrorDetails]) -> str:
    kind, value, context = fault["type"], fault["input"], fault.get("ctx", {})
    match kind:
        case "missing" if isinstance(fault["loc"][-1], int):
            place = fault["loc"][:-1]
            last = [f["loc"][-1] for f in faults if f["type"] == kind and f["loc"][:-1] == place][
                -1
            ]
            return f"has {len(value)} entries; {int(last) + 1} are needed"
        case "missing":
            taught = "; a start without it teaches it" if fault["loc"][-1] == "grasp" else ""
            return f"missing{taught}"
        case "extra_forbidden":
            fields = owner.model_fields if owner is not None else {}
            legal = [field.alias or name for name, field in fields.items()]
            return f"unknown key{nearest(str(fault['loc'][-1]), legal)}"
        case "literal_error":
            text = f"{shown(value)} is not allowed; allowed: {context['expected']}"
            words = str(context["expected"]).replace(" or ", ", ").replace("'", "").split(", ")
            hint = nearest(value, words) if isinstance(value, str) and len(words) > 1 else ""
            return text + (hint if "did you mean" in hint else "")
        case "union_tag_invalid":
            tags = str(context["expected_tags"])
            hint = nearest(str(context["tag"]), tags.replace("'", "").split(", "))
            text = f"{shown(context['tag'])} is not allowed here; allowed: {tags}"
            return text + (hint if "did you mean" in hint else "")
        case "union_tag_not_found":
            return "missing kind"
        case "copose_key":
            return fault["msg"]
        case "copose":
            return fault["msg"] if _is_long(value) else f"{shown(value)}: {fault['msg']}"
        case "too_short":
            return (
                f"has {_entries(context['actual_length'])}; at least {context['min_length']} needed"
            )
        case "too_long":
            actual = context["actual_length"]
            counted = "too many entries" if actual is None else _entries(actual)
            return f"has {counted}; at most {context['max_length']} allowed"
        case "greater_than_equal" if 0 < context["ge"] < 1e-6:
            return f"{shown(value)} must be above zero (at least {context['ge']:g})"
        case "greater_than_equal":
            return f"{shown(value)} must be at least {context['ge']:g}"
        case "less_than_equal":
            return f"{shown(value)} must be at most {context['le']:g}"
        case _ if (needed := _needed(kind)) is not None:
            return f"{shown(value)} {needed}"
        case _:
            return f"{shown(value)}: {fault['msg'][:1].lower()}{fault['msg'][1:]}"


def _needed(kind: str) -> str | None:
    """A type that a value must have, by pydantic's name of the fault."""
    types = {
        "bool_type": "must be true or false",
        "dict_type": "must be a table",
        "finite_number": "must be finite",
        "float_type": "must be a number",
        "int_type": "must be a whole number",
        "model_attributes_type": "must be a table",
        "model_type": "must be a table",
        "string_type": "must be a text",
        "tuple_type": "must be an array",
    }
    return types.get(kind)


def _is_long(value: object) -> bool:
    return isinstance(value, Mapping) or (
        isinstance(value, tuple) and any(isinstance(entry, Mapping) for entry in value)
    )


def _key(location: tuple[int | str, ...]) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _named(key: str, data: Mapping[str, Any]) -> str:
    """A key with the name of the arm that it is of, where the arm has one."""
    arm = re.match(r"arms\[(\d+)\]", key)
    arms = data.get("arms")
    if (
        arm is None
        or not isinstance(arms, (list, tuple))
        or not isinstance(table := arms[int(arm[1])], Mapping)
    ):
        return key
    name = table.get("name")
    if not isinstance(name, str) or len(name) > 100:
        return key
    return arm_key(int(arm[1]), name) + key[arm.end() :]


def _owner(
    model: type[BaseModel], location: tuple[int | str, ...]
) -> tuple[type[BaseModel] | None, tuple[int | str, ...]]:
    """The table in which a location ends, and the location without pydantic's union tags."""
    owner: type[BaseModel] | None = model
    annotation: Any = model
    path: list[int | str] = []
    for depth, part in enumerate(location):
        tagged = _tagged(annotation, part)
        if tagged is not None:
            annotation = owner = tagged
            continue
        path.append(part)
        if isinstance(part, int):
            continue
        table = _table(annotation)
        if table is None or part not in table.model_fields:
            owner = table
            annotation = None
            continue
        owner = table
        annotation = table.model_fields[part].annotation
        if depth + 1 == len(location):
            break
    return owner, tuple(path)


def tables_of(annotation: Any) -> list[type[BaseModel]]:
    """The models of the tables that a field may hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [
        table for argument in getattr(annotation, "__args__", ()) for table in tables_of(argument)
    ]


def _table(annotation: Any) -> type[BaseModel] | None:
    tables = tables_of(annotation)
    return tables[0] if tables else None


def _tagged(annotation: Any, part: int | str) -> type[BaseModel] | None:
    """The member of a union by ``kind`` that pydantic names in a location."""
    tables = tables_of(annotation)
    for table in tables if len(tables) > 1 else []:
        kind = table.model_fields.get("kind")
        if kind is not None and part in getattr(kind.annotation, "__args__", ()):
            return table
    return None


def _entries(count: int) -> str:
    return f"{count} {'entry' if count == 1 else 'entries'}"
