"""The rooms of the house: their sizes, and names that mean one thing.

Each test prints what is over. The map of the rooms is the manual's topic `code`.
"""

from __future__ import annotations

import ast
import statistics
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import copose
from reference import PROBLEMS

SOURCE = PROBLEMS.parent / "src/copose"
FILES = sorted(SOURCE.rglob("*.py"))


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text())


def name(file: Path) -> str:
    return file.relative_to(SOURCE).as_posix()


def lines(file: Path) -> int:
    return len(file.read_text().splitlines())


def none(faults: Iterable[str]) -> None:
    """Fail with a list of faults, unless there are none."""
    listed = list(faults)
    assert not listed, "\n" + "\n".join(listed)


def top_level(file: Path) -> Iterator[ast.stmt]:
    """The statements of a module, those in its `if`, `try` and `with` too."""
    waiting: list[ast.AST] = [tree(file)]
    while waiting:
        for node in ast.iter_child_nodes(waiting.pop()):
            if isinstance(node, ast.stmt | ast.ExceptHandler):
                if isinstance(node, ast.stmt):
                    yield node
                if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                    waiting.append(node)


def assigned(statement: ast.stmt) -> Iterator[str]:
    """The names that a statement assigns; of a tuple each."""
    targets: list[ast.expr] = []
    if isinstance(statement, ast.Assign):
        targets = statement.targets
    elif isinstance(statement, ast.AnnAssign):
        targets = [statement.target]
    for target in targets:
        for node in ast.walk(target):
            if isinstance(node, ast.Name):
                yield node.id


def constants(file: Path) -> list[str]:
    """Module-level names in capitals, private or not."""
    names = (word for statement in top_level(file) for word in assigned(statement))
    return sorted({word for word in names if word.isupper()})


def classes(file: Path) -> Iterator[ast.ClassDef]:
    return (node for node in top_level(file) if isinstance(node, ast.ClassDef))


def test_no_folder_has_more_than_twelve_files() -> None:
    rooms: dict[Path, list[Path]] = defaultdict(list)
    for file in FILES:
        rooms[file.parent].append(file)
    none(f"{name(room)}: {len(files)} files" for room, files in rooms.items() if len(files) > 12)


def test_no_file_has_more_than_450_lines_and_half_at_most_150() -> None:
    none(f"{name(file)}: {lines(file)} lines" for file in FILES if lines(file) > 450)
    median = statistics.median(map(lines, FILES))
    longest = sorted(FILES, key=lines)[-20:]
    assert median <= 150, [f"{name(file)}: {lines(file)}" for file in longest]


def test_the_house_has_at_most_150_constants() -> None:
    found = {file: constants(file) for file in FILES}
    total = sum(map(len, found.values()))
    most = sorted((file for file in FILES if found[file]), key=lambda file: -len(found[file]))
    listed = "\n".join(f"{len(found[file]):3} {name(file)}: {found[file]}" for file in most)
    assert total <= 150, f"{total} names\n{listed}"


def test_no_two_public_classes_share_a_name() -> None:
    homes: dict[str, list[str]] = defaultdict(list)
    for file in FILES:
        for node in classes(file):
            if not node.name.startswith("_"):
                homes[node.name].append(name(file))
    none(f"{word}: {', '.join(files)}" for word, files in homes.items() if len(files) > 1)


def functions(file: Path) -> set[str]:
    return {
        node.name
        for node in top_level(file)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }


def test_no_module_is_named_like_a_public_function() -> None:
    """Neither of the package, nor of its room: imports would depend on what was imported before."""
    public = {*copose.__all__}
    in_room: dict[Path, dict[str, str]] = defaultdict(dict)
    for file in FILES:
        in_room[file.parent] |= dict.fromkeys(functions(file), name(file))
    modules = [file.parent if file.stem == "__init__" else file for file in FILES]
    none(
        f"{name(module)}: a function of {home} has its name"
        for module in modules
        if module != SOURCE
        and (home := in_room[module.parent].get(module.stem, "copose" * (module.stem in public)))
    )


def kinds() -> set[str]:
    """The classes of objectives and constraints: as a file asks for them, and as they are built."""
    rooms = SOURCE / "objectives", SOURCE / "constraints"
    files = [SOURCE / "problem/objectives.py", *(f for room in rooms for f in room.rglob("*.py"))]
    parents = {node.name: bases(node) for file in files for node in classes(file)}
    known = {word for word in parents if "Objective" in word or "Constraint" in word}
    while more := {word for word in parents if known & {*parents[word]}} - known:
        known |= more
    assert len(known) > 12, known
    return known


def bases(node: ast.ClassDef) -> list[str]:
    return [each.id for base in node.bases for each in ast.walk(base) if isinstance(each, ast.Name)]


def asked_types(node: ast.AST) -> list[str]:
    """The classes that an expression compares the type of a value with."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) == 2:
        types = [node.args[1]] if node.func.id in ("isinstance", "issubclass") else []
    elif isinstance(node, ast.MatchClass):
        types = [node.cls]
    else:
        types = []
    return [each.id for part in types for each in ast.walk(part) if isinstance(each, ast.Name)]


def test_nobody_asks_for_the_kind_of_an_objective_or_constraint() -> None:
    known = kinds()
    none(
        f"{name(file)}:{node.lineno}: {' | '.join(types)}"
        for file in FILES
        for node in ast.walk(tree(file))
        if {*(types := asked_types(node))} & known
    )
