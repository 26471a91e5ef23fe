"""The map of a proof: the objective over the self-motions of both arms."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from copose.report.look import LOOK
from copose.report.words import objective_name, objective_unit, short, three
from copose.results import ProofMap, Solution

_EXPLANATION = (
    "Each axis runs along what joint limits leave of an arm's self-motions. Solid lines separate "
    "self-motions, numbered at the top and on the right; dotted lines separate parts of one."
)


def add_proof_map(figure: Figure, solution: Solution, tall: float = 5.2) -> None:
    """Make a figure higher by so many inches, and draw there the map of a proof, if there is one:
    the answer in it, outlined what was bounded last; and words, where there is room beside it.
    """
    proof = None if solution.search is None else solution.search.proof
    if proof is None or proof.map is None:
        return
    wide, above = figure.get_size_inches()
    whole = above + tall
    figure.set_size_inches(wide, whole)
    for ax in figure.axes:
        x, y, width, height = ax.get_position(original=True).bounds
        ax.set_position((x, (tall + y * above) / whole, width, height * above / whole))
    for text in figure.texts:
        text.set_y((tall + text.get_position()[1] * above) / whole)
    for legend in figure.legends:
        legend.set_bbox_to_anchor((0.0, tall / whole, 1.0, above / whole))
    side, low = tall - 1.6, 0.6
    ax = figure.add_axes((0.8 / wide, low / whole, side / wide, side / whole))
    bar = figure.add_axes(((1.5 + side) / wide, low / whole, 0.15 / wide, side / whole))
    _draw(ax, bar, proof.map, solution)
    room = wide - side - 2.9
    if room < 2:
        return
    x, y = (2.8 + side) / wide, (low + side) / whole
    words = [
        textwrap.fill(line, int(13 * room)) for line in (f"Proof: {proof.statement}.", _EXPLANATION)
    ]
    figure.text(x, y, "\n\n".join(words), va="top", fontsize=9.5)
    ax.legend(loc="lower left", bbox_to_anchor=(x, low / whole), frameon=False,
              bbox_transform=figure.transFigure, borderaxespad=0.0)  # fmt: skip


def _draw(ax: Any, bar: Any, proof_map: ProofMap, solution: Solution) -> None:
    """The map and its bar of colours."""
    both = proof_map.x, proof_map.y
    edges = [np.linspace(0.0, axis.length, len(axis.self_motions) + 1) for axis in both]
    values = np.array(proof_map.values, dtype=float)
    # Near singularities all falls: the lowest colour is that of a part.
    mesh = ax.pcolormesh(*edges, values, vmin=np.nanquantile(values, 0.04), rasterized=True)
    title = f"{objective_name(solution)} {objective_unit(solution)}".strip()
    ax.figure.colorbar(mesh, cax=bar, extend="min")
    ax.set_title(f"{title} over the self-motions of both arms")
    for name, axis, edge in zip("xy", both, edges, strict=True):
        numbers, line = np.array(axis.self_motions), ax.axvline if name == "x" else ax.axhline
        for k in np.union1d(axis.cuts, np.flatnonzero(np.diff(numbers)) + 1).astype(int):
            other = numbers[k] != numbers[k - 1]
            line(edge[k], color="white", linewidth=2 if other else 1, ls="-" if other else ":")
        ax.set(**{f"{name}label": f"{short(axis.arm)}: arc length, rad"})
        opposite = ax.secondary_xaxis("top") if name == "x" else ax.secondary_yaxis("right")
        places = [edge[:-1][numbers == k].mean() + edge[1] / 2 for k in np.unique(numbers)]
        opposite.set(**{f"{name}ticks": places, f"{name}ticklabels": np.unique(numbers)})
        opposite.tick_params(length=0)
    best = [edge[axis.answer] + edge[1] / 2 for axis, edge in zip(both, edges, strict=True)]
    value = three(solution.objective.after)
    ax.plot(*best, "*", markersize=15, color="white", markeredgecolor=LOOK.ink,
            linestyle="none", label=f"answer, {value}")  # fmt: skip
    for k, (i, j) in enumerate(proof_map.last):
        ax.add_patch(Rectangle(
            (edges[0][i], edges[1][j]), edges[0][1], edges[1][1], fill=False, zorder=5,
            edgecolor=LOOK.over, label=None if k else "bounded last",
        ))  # fmt: skip
