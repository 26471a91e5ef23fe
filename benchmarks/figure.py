"""The results as one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from peers import PEERS
from summary import LABELS, MAIN, Record, found, local_times, searches, slope

_OWN, _OTHER, _PALE = "#1f5fa8", "#8a8f98", "#9dbfe3"


def draw(results: Record, path: Path) -> None:
    """Four panels: time to the optimum, local solves, problems, cost against arms and effort."""
    with mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(12, 9.5), layout="constrained")
        axes = figure.subplots(2, 2)
        _expected(axes[0, 0], results)
        _local(axes[0, 1], results)
        _problems(axes[1, 0], results)
        _arms(axes[1, 1], results)
        figure.savefig(path, dpi=130)


def _colour(method: str) -> str:
    return {"copose": _OWN, "copose-vm": _PALE}.get(method, _OTHER)


def _empty(axes: Any) -> None:
    axes.text(0.5, 0.5, "not measured", ha="center", va="center", transform=axes.transAxes)
    axes.set_axis_off()


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def _log_seconds(axis: Any, subs: tuple[float, ...] = (1.0,)) -> None:
    """Ticks of a logarithmic axis in units of time."""
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: _time(value)))
    axis.set_minor_formatter(NullFormatter())


def _expected(axes: Any, results: Record) -> None:
    figures = searches(results).get(MAIN, {})
    axes.set_title(f"Time to the best known optimum, {MAIN}", loc="left")
    if not figures:
        _empty(axes)
        return
    for row, (method, f) in enumerate(figures.items()):
        length = f.expected if f.expected is not None else f.spent
        hatch = None if f.expected is not None else "//"
        axes.barh(row, length, color=_colour(method), hatch=hatch, edgecolor="white")
        sign = "" if f.expected is not None else "> "
        axes.text(length * 1.1, row, f"{sign}{_time(length)}   {f.hits}/{f.runs} hits", va="center")
    _bars(axes, list(figures))
    axes.set_xlabel("mean time of a run over its hit rate")


def _bars(axes: Any, methods: list[str]) -> None:
    axes.set_xscale("log")
    axes.set_yticks(range(len(methods)), [LABELS[method] for method in methods])
    axes.invert_yaxis()
    low, high = axes.get_xlim()
    axes.set_xlim(low / 2, high * 12)
    _log_seconds(axes.xaxis)


def _local(axes: Any, results: Record) -> None:
    axes.set_title(f"One local solve, {MAIN}, median", loc="left")
    records = results["local"].get(MAIN, {})
    times = {m: t for m, record in records.items() if (t := local_times(record)) is not None}
    if not times:
        _empty(axes)
        return
    for row, (method, both) in enumerate(times.items()):
        for part, (seconds, alpha) in enumerate(zip(both, (1.0, 0.55), strict=True)):
            place = row + 0.38 * part - 0.19
            axes.barh(place, seconds, height=0.36, color=_colour(method), alpha=alpha)
            axes.text(seconds * 1.1, place, _time(seconds), va="center", fontsize=8)
    _bars(axes, list(times))
    axes.set_xlabel("strong: from a closed start; pale: the object then moved 5 mm")


def _problems(axes: Any, results: Record) -> None:
    axes.set_title("Time to the best known optimum, every problem", loc="left")
    figures = searches(results)
    names = list(figures)
    for row, name in enumerate(names):
        peers = [f.expected for m, f in figures[name].items() if m in PEERS and f.expected]
        for method, marker in (("copose", "o"), ("copose-vm", "s")):
            f = figures[name].get(method)
            if f is None:
                continue
            known = f.expected is not None
            axes.plot(f.expected if known else f.spent, row, marker if known else "x", ms=6,
                      color=_colour(method), zorder=3)  # fmt: skip
        if peers:
            axes.plot(min(peers), row, "D", ms=5, color=_OTHER)
    for label, marker, colour in (
        (LABELS["copose"], "o", _OWN),
        (LABELS["copose-vm"], "s", _PALE),
        ("best peer that met it", "D", _OTHER),
        ("not met, time spent", "x", _OWN),
    ):
        axes.plot([], [], marker, color=colour, label=label)
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), names, fontsize=7.5)
    axes.invert_yaxis()
    axes.grid(axis="both", color="#e6e8eb", lw=0.6)
    _log_seconds(axes.xaxis)
    axes.margins(y=0.04)
    axes.legend(fontsize=7.5, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.06),
                ncols=2)  # fmt: skip


def _arms(axes: Any, results: Record) -> None:
    arms, seconds, steepness = slope(results)
    axes.set_title("Search time against the number of arms", loc="left")
    if not arms:
        _empty(axes)
        return
    told = "" if steepness is None else f", slope {steepness:.2f} over 2 … 8"
    axes.loglog(arms, seconds, "o-", color=_OWN, label=f"Pandas round a plate{told}")
    first = next((s for k, s in zip(arms, seconds, strict=True) if k == 2), None)
    if first is not None:
        reach = [k for k in arms if k >= 2]
        axes.loglog(reach, [first * (k / 2) ** 2.2 for k in reach], "--", color=_OTHER,
                    label="slope 2.2")  # fmt: skip
    axes.set_xticks(arms, [str(k) for k in arms])
    axes.minorticks_off()
    _log_seconds(axes.yaxis, (1.0, 2.0, 5.0))
    axes.set_xlabel("arms of 7 joints")
    axes.set_ylabel("median")
    axes.legend(frameon=False, loc="upper left")
    efforts = results["effort"].get(MAIN, {})
    lines = []
    for key, record in efforts.items():
        f = found(MAIN, record)
        if f is not None:
            lines.append(f"{key.split('@')[1]}: {f.hits}/{f.runs} hits, {_time(f.seconds)}")
    if lines:
        axes.text(0.98, 0.03, f"{MAIN} by effort\n" + "\n".join(lines), ha="right", va="bottom",
                  transform=axes.transAxes, fontsize=8)  # fmt: skip
