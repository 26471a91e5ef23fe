"""Pictures of results as figures of Matplotlib and as files."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar, overload

from copose.errors import InputError
from copose.problem import SPACES, Problem
from copose.report.look import LOOK
from copose.report.panels import Comparison, Panel, Row, case_rows, result_panels, result_row
from copose.report.words import result_heading, short
from copose.results import Motion, Solution, write_file
from copose.robots import ArmStart

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Style: TypeAlias = Literal["bodies", "sticks"]
"""The look of arms in space: their links' convex hulls, or sticks between their joints."""

_Answer = TypeVar("_Answer", Solution, Motion)
# Settings of Matplotlib are those of the whole process.
_drawing_lock = threading.Lock()


def check_format(path: Path) -> None:
    """Refuse a file name whose ending names no known format.

    Raises:
        InputError: listing the endings that would be right.
    """
    formats = (".png", ".pdf", ".svg")
    if path.suffix.lower() not in formats:
        raise InputError(
            f"{path.suffix or 'no ending'}: a picture ends in {', '.join(formats)}", file=path
        )


def picture(answer: Solution | Motion, kind: str, style: Style = "bodies") -> bytes:
    """A result's picture as a file's content.

    Args:
        answer: a result with at least one posture.
        kind: png, pdf or svg.
        style: look of arms in space.
    """
    return saved(figure(answer, style), kind)


def motion_animation(motion: Motion, style: Style = "bodies") -> bytes:
    """A motion in real time as the content of a .gif file."""
    with drawing():
        from copose.report.figures.motion import motion_film

        return motion_film(_styled(motion, style))


def _styled(answer: _Answer, style: Style) -> _Answer:
    """An answer, without its arms' bodies where they are drawn as sticks."""
    if style == "bodies":
        return answer
    problem = answer.problem.model_copy(update={"links": ()})
    return answer.model_copy(update={"problem": problem})


def figure(answer: Solution | Motion, style: Style = "bodies") -> Figure:
    """A result's picture as a Matplotlib figure that pyplot does not know.

    Raises:
        InputError: the result has no posture to draw.
    """
    if isinstance(answer, Motion):
        if answer.knots is None:
            raise InputError(f"no motion to draw: {answer.reason}")
        with drawing():
            from copose.report.figures.motion import motion_figure

            return motion_figure(_styled(answer, style))
    solution = _styled(answer, style)
    panels, rows = result_panels(solution), case_rows(solution)
    if not panels and not rows:
        raise InputError(f"no posture to draw: {solution.reason}")
    drawn = _figure(panels, rows, result_heading(solution))
    with drawing():
        from copose.report.charts.proof_map import add_proof_map

        add_proof_map(drawn, solution)
    return drawn


def _figure(panels: list[Panel], rows: list[Row], heading: str) -> Figure:
    """A figure of rows where there are some, else of panels."""
    with drawing():
        if rows:
            from copose.report.figures.cases import cases_figure

            return cases_figure(rows, heading)
        if SPACES[panels[0].solution.problem.space].planar:
            from copose.report.figures.planar import planar_figure

            return planar_figure(panels, heading)
        from copose.report.figures.spatial import spatial_figure

        return spatial_figure(panels, heading)


def proof_picture(solution: Solution) -> bytes:
    """The map of a result's proof alone, small, as the content of a .png file."""
    with drawing():
        from matplotlib.figure import Figure

        from copose.report.charts.proof_map import add_proof_map

        drawn = Figure(figsize=(5.0, 0.1))
        add_proof_map(drawn, solution, tall=4.4)
    return saved(drawn, "png")


@contextlib.contextmanager
def drawing() -> Iterator[None]:
    """The settings of all pictures, whatever settings of Matplotlib a user or a script has."""
    # It warns of settings that it does not know, and of folders that it cannot write its font
    # cache to; fonts are found without.
    chatter = logging.getLogger("matplotlib")
    level = chatter.level
    with _drawing_lock, warnings.catch_warnings():
        try:
            chatter.setLevel(logging.ERROR)
            matplotlib = _matplotlib()
            warnings.simplefilter("ignore", matplotlib.MatplotlibDeprecationWarning)
            defaults = {k: matplotlib.rcParamsDefault[k] for k in matplotlib.rcParamsDefault}
            del defaults["backend"]
            # A name in a script that the font lacks is drawn as boxes; there is no more to say.
            warnings.filterwarnings("ignore", message="Glyph .* missing from font")
            with matplotlib.rc_context(defaults | LOOK.settings):
                yield
        finally:
            chatter.setLevel(level)


def _matplotlib() -> Any:
    """Matplotlib, which cannot be loaded where MPLBACKEND names a backend that is not installed.

    Notebooks set it for all that they start. Figures that save themselves need none.
    """
    if "matplotlib" in sys.modules:
        return sys.modules["matplotlib"]
    backend = os.environ.pop("MPLBACKEND", "")
    try:
        import matplotlib
    finally:
        if backend:
            os.environ["MPLBACKEND"] = backend
    if backend:
        with contextlib.suppress(ValueError):
            matplotlib.rcParams["backend"] = backend
    return matplotlib


def saved(figure: Figure, kind: str) -> bytes:
    """A figure as the content of a png, pdf or svg file."""
    # The date that these formats carry would make the same result look different every time.
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    sink = io.BytesIO()
    with drawing():
        figure.savefig(sink, format=kind, dpi=120, facecolor="white", metadata=metadata)
    return sink.getvalue()


@overload
def draw(solution: Solution | Motion, path: None = None, style: Style = "bodies") -> Figure: ...
@overload
def draw(solution: Solution | Motion, path: str | Path, style: Style = "bodies") -> None: ...
def draw(
    solution: Solution | Motion, path: str | Path | None = None, style: Style = "bodies"
) -> Figure | None:
    """Draw a result's postures, or a motion.

    Args:
        solution: the result.
        path: name of a .png, .pdf or .svg file.
        style: look of arms in space: their links' convex hulls, or sticks between their joints.

    Returns:
        Without a path a Matplotlib figure, which pyplot does not know and a notebook shows.

    Raises:
        InputError: the file cannot be written, or the result has no posture to draw.
    """
    if path is None:
        drawn = figure(solution, style)
        # Notebooks that never load pyplot would print no more than the figure's size.
        drawn._repr_png_ = partial(saved, drawn, "png")  # type: ignore[attr-defined]
        return drawn
    write_picture(path, lambda: figure(solution, style))
    return None


def write_picture(path: str | Path, draw_it: Callable[[], Figure]) -> None:
    """Write a figure, which is drawn once its file's name is known to be right.

    Raises:
        InputError: the file cannot be written.
    """
    file = Path(path)
    check_format(file)
    write_file(file, saved(draw_it(), file.suffix.lower()[1:]))


def starts_figure(problem: Problem, starts: Sequence[ArmStart], style: Style = "bodies") -> Figure:
    """Arms at their starts, with the frames of object, tips and grasps."""
    with drawing():
        from copose.report.figures.start import start_figure

        return start_figure(problem, starts, bodies=style == "bodies")


def draw_start(
    problem: Problem, starts: Sequence[ArmStart], path: str | Path, style: Style = "bodies"
) -> None:
    """Draw arms at their starts, with the frames of object, tips and grasps, into a .png, .pdf or
    .svg file.

    Raises:
        InputError: the file cannot be written.
    """
    write_picture(path, lambda: starts_figure(problem, starts, style))


def draw_comparison(comparison: Comparison, path: str | Path, style: Style = "bodies") -> None:
    """Draw two results' postures side by side, each with the other's ellipsoid as an outline.

    Raises:
        InputError: the file cannot be written.
    """
    names = dict.fromkeys(solution.problem.name for solution in comparison.solutions)
    heading = " and ".join(short(name, 40) for name in names)
    overlaid = comparison.same_unit and not comparison.cases
    if not comparison.same_unit:
        heading += " (torques scaled differently: each at its own scale"
        heading += ")" if comparison.cases else ", not overlaid)"
    rows: list[Row] = []
    panels: list[Panel] = []
    both = zip(comparison.names, comparison.solutions, comparison.postures, strict=True)
    for name, told, posture in both:
        solution = _styled(told, style)
        if comparison.cases:
            rows.append(result_row(name, solution))
        elif posture is not None:
            panels.append(Panel(name, posture, solution))
    if overlaid:
        one, other = panels
        panels = [replace(one, other=other), replace(other, other=one)]
    write_picture(path, lambda: _figure(panels, rows, heading))
