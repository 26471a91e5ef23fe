"""Files that the page saves: the problem, the result, the picture, and a page of its own."""

from __future__ import annotations

from pathlib import Path

from copose.errors import InputError
from copose.live.problem_file.saving import save_problem
from copose.live.session.state import State
from copose.results import Solution, to_json, write_file


def result_of(state: State) -> Solution:
    """The result that is shown.

    Raises:
        InputError: the arms do not hold the object where it is.
    """
    solution = state.solution
    if not state.reached:
        raise InputError("the arms do not hold the object where it is; drag it back or undo")
    if state.searched:
        return solution
    note = (
        f"taken from the live page: recorded at {state.origin}"
        if state.origin
        else "taken from the live page as it was: a local optimum or a posture chosen by hand, "
        "which a search may better"
    )
    return solution.model_copy(update={"notes": (*solution.notes, note)})


def file_named(name: str) -> Path:
    """The file of a name that was typed; ``~`` is the home folder.

    Raises:
        InputError: it is no name.
    """
    if not name.strip() or "\0" in name:
        raise InputError("is no name of a file", key=repr(name))
    try:
        return Path(name.strip()).expanduser()
    except RuntimeError as error:
        raise InputError(str(error), key=name) from None


def save(state: State, kind: str, file: Path, *, overwrite: bool = False) -> Path:
    """Write a file of the state that is shown.

    Args:
        state: the state.
        kind: problem, result, picture or page.
        file: its name; a picture is a .png, .pdf or .svg.
        overwrite: whether a problem file that is there is replaced; other files always are.

    Returns:
        The file.

    Raises:
        InputError: there is nothing to save, or the file cannot be written.
    """
    if kind == "problem":
        save_problem(state.problem, file, overwrite=overwrite)
        return file
    solution = result_of(state)
    if kind == "result":
        write_file(file, to_json(solution).encode())
    elif kind == "picture":
        from copose.report import draw

        draw(solution, file)
    else:
        from copose.formats import export

        export(solution, "html", file, problem=state.problem)
    return file
