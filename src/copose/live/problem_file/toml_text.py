"""The text of a TOML file with other values; its comments, order and formatting stay.

A text is compared with the tables that it is to have: values that are equal stay byte for byte.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, MutableMapping
from typing import TYPE_CHECKING, Any, TypeAlias

from copose.errors import InputError

if TYPE_CHECKING:
    from tomlkit.container import Container
    from tomlkit.items import Item, Table

    # Where a key is new: what is printed of the table, the key and its value.
    _Added: TypeAlias = tuple[Container, str, Item]


def text_with(text: str, tables: Mapping[str, Any]) -> str:
    """A TOML text with other values.

    Values that are equal stay as they are written. New keys stand behind the last one of their
    table, new tables at the end; below the top level they are written in line.

    Args:
        text: the old text.
        tables: all values of the new text, of the types that a TOML reader makes.

    Raises:
        InputError: tomlkit is not installed.
    """
    tomlkit = _tomlkit()
    if _same(tomllib.loads(text), tables):
        return text
    # A last line without an end would run into what is added.
    document = tomlkit.parse(text if text.endswith("\n") else text + "\n")
    added: list[_Added] = []
    _merge(document, tables, added)
    for entry in added:
        _put(entry)
    new: str = tomlkit.dumps(document)
    return new if _holds(new, tables) else text_of(tables)


def text_of(tables: Mapping[str, Any]) -> str:
    """Tables as TOML text: keys, then a table each, arrays of tables with a header each.

    Raises:
        InputError: tomlkit is not installed.
    """
    tomlkit = _tomlkit()
    document = tomlkit.document()
    for key in sorted(tables, key=lambda key: _is_section(tables[key])):
        document.append(key, _section(tables[key]))
    text: str = tomlkit.dumps(document)
    return text


def _tomlkit() -> Any:
    """The package tomlkit.

    Raises:
        InputError: it is not installed.
    """
    try:
        import tomlkit
    except ImportError:
        line = "tomlkit is missing, which saving needs: pip install 'copose[live]'"
        raise InputError(line) from None
    return tomlkit


def _same(one: Any, other: Any) -> bool:
    """True where two values mean the same in TOML, where 1 is 1.0 but no truth value."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_same, one, other))
    return isinstance(one, bool) == isinstance(other, bool) and bool(one == other)


def _holds(text: str, tables: Mapping[str, Any]) -> bool:
    """True where a text has the values of tables: tomlkit can go wrong with odd files."""
    try:
        return _same(tomllib.loads(text), tables)
    except ValueError:
        return False


def _merge(node: MutableMapping[str, Any], tables: Mapping[str, Any], added: list[_Added]) -> None:
    """Make a table of the document hold the values of tables; new keys are only listed."""
    from tomlkit import TOMLDocument
    from tomlkit.container import OutOfOrderTableProxy
    from tomlkit.items import Table

    for key in [key for key in node if key not in tables]:
        del node[key]
    for key, value in tables.items():
        if key in node:
            if isinstance(node[key], OutOfOrderTableProxy) and isinstance(value, Mapping):
                # Made anew for each: it forgets what it was made of with the first that goes.
                for gone in [gone for gone in node[key] if gone not in value]:
                    del node[key][gone]
            if not _same(node[key], value) and not _merge_value(node[key], value, added):
                node[key] = _inline(value)
        elif isinstance(node, TOMLDocument) and _is_section(value):
            node[key] = _section(value)
        elif isinstance(value, Mapping) and (below := _headed(node)):
            node[key] = _behind(below[-1], value)
        elif isinstance(node, (TOMLDocument, Table)):
            added.append((node.value if isinstance(node, Table) else node, key, _inline(value)))
        else:
            node[key] = _inline(value)


def _merge_value(old: Any, value: Any, added: list[_Added]) -> bool:
    """Make a table or an array hold another's values; False where it cannot."""
    from tomlkit.items import AoT, InlineTable

    if isinstance(old, MutableMapping) and isinstance(value, Mapping):
        if isinstance(old, InlineTable) and old.keys() != value.keys():
            return False
        _merge(old, value, added)
        return True
    if not (isinstance(old, list) and isinstance(value, list) and old and value):
        return False
    if isinstance(old, AoT) and not _is_section(value):
        return False
    _merge_array(old, value, added)
    return True


def _merge_array(old: list[Any], value: list[Any], added: list[_Added]) -> None:
    """Change the entries between those that stay at the beginning and at the end."""
    from tomlkit.items import AoT

    shorter = min(len(old), len(value))
    begin = next((k for k in range(shorter) if not _same(old[k], value[k])), shorter)
    end = next(
        (k for k in range(shorter - begin) if not _same(old[-1 - k], value[-1 - k])),
        shorter - begin,
    )
    stop_old, stop = len(old) - end, len(value) - end
    both = range(begin, min(stop_old, stop))
    for k in both:
        if not _merge_value(old[k], value[k], added):
            old[k] = _inline(value[k])
    for k in reversed(range(both.stop, stop_old)):
        del old[k]
    for k in range(both.stop, stop):
        new = _behind(old[k - 1] if k else None, value[k]) if isinstance(old, AoT) else None
        old.insert(k, _inline(value[k]) if new is None else new)


def _headed(node: object) -> list[Table]:
    """The tables with headers below a table that has none of its own."""
    from tomlkit.items import AoT, Table

    tables: list[Table] = []
    if isinstance(node, Table) and node.is_super_table():
        for key, item in node.value.body:
            if isinstance(item, AoT):
                tables += item.body
            elif isinstance(item, Table) and key is not None and not key.is_dotted():
                tables.append(item)
    return tables


def _put(added: _Added) -> None:
    """Write a new key behind the last one of its table, before blank lines and comments.

    These belong to the lines that follow, most often to the next table. Only the printed lines are
    put in order: the document cannot be searched after that.
    """
    import tomlkit
    from tomlkit.items import AoT, Table

    container, key, item = added
    body, at = container.body, 0
    for k, (name, old) in enumerate(body):
        # A dotted key is held as a table.
        if name is not None and (name.is_dotted() or not isinstance(old, (Table, AoT))):
            at = k + 1
    item.trivia.trail = "\n"
    body.insert(at, (tomlkit.key(key), item))


def _behind(before: Table | None, value: Mapping[str, Any]) -> Table:
    """A new table with a header, which takes over the lines that follow the table before it."""
    import tomlkit

    table, tail = _table(value), []
    if before is not None:
        body = before.value.body
        while body and isinstance(body[-1][1], tomlkit.items.Table):
            body = body[-1][1].value.body
        while body and body[-1][0] is None:
            tail.append(body.pop())
        body.append((None, tomlkit.nl()))
    table.value.body.extend(reversed(tail) if tail else [(None, tomlkit.nl())])
    return table


def _is_section(value: object) -> bool:
    """True where a value at the top has a header."""
    tables = value if isinstance(value, list) else [value]
    return bool(tables) and all(isinstance(table, Mapping) for table in tables)


def _section(value: Any) -> Item:
    """A value at the top as a table or an array of tables with headers, where it is one."""
    import tomlkit

    if not _is_section(value):
        return _inline(value)
    if isinstance(value, Mapping):
        return _table(value)
    tables = tomlkit.aot()
    for entry in value:
        tables.append(_table(entry))
    return tables


def _table(value: Mapping[str, Any]) -> Table:
    """A table with a header."""
    import tomlkit

    table = tomlkit.table()
    for key, entry in value.items():
        table.append(key, _inline(entry))
    return table


def _inline(value: Any) -> Item:
    """A value in one line; of several tables each in a line of its own."""
    import tomlkit
    from tomlkit.items import Array

    item = tomlkit.value(_written(value))
    if isinstance(item, Array):
        item.multiline(len(value) > 1 and _is_section(value))
    return item


def _written(value: Any) -> str:
    """A value as text."""
    import tomlkit

    if isinstance(value, Mapping):
        pairs = [f"{tomlkit.key(key).as_string()} = {_written(x)}" for key, x in value.items()]
        return "{ " + ", ".join(pairs) + " }" if pairs else "{}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_written, value)) + "]"
    return str(tomlkit.item(value).as_string())
