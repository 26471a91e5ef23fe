"""Maps and tables of studies show what the table holds.

``python tests/test_study_pictures.py`` writes what tables on the terminal then are.
"""

from __future__ import annotations

import io
import itertools
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from rich.cells import cell_len
from rich.console import Console

from copose.errors import InputError
from copose.report.figures.files import saved
from copose.report.studies import draw_study, study_map, study_picture, study_table
from copose.report.studies.charts.curve import branch_switches
from copose.report.studies.charts.pair_plot import first_order_share
from copose.report.studies.key_axes import row_labels, unit_of
from copose.report.studies.map_content import MapContent, pareto_front
from copose.studies.points.line import PointLine
from copose.studies.points.points import Point
from copose.studies.study import Study, StudyFolder
from copose.studies.table import StudyTable
from reference import PROBLEMS

SNAPSHOTS = Path(__file__).parent / "snapshots"
RADIUS = "after.ellipsoid.radii.0"
X, Y, MASS = "object.position.x", "object.position.y", "object.mass"
BASE, LENGTH = "arms.a2.base.position.x", "arms.a1.base.position.y"
GRID = [(X, "from = 0.2\nto = 0.8\nsteps = 13"), (Y, "from = 0.3\nto = 0.9\nsteps = 11")]
NAMED = ("arms.a2.base.position", "values = [[1.0, 0.0], [1.2, 0.0], [1.0, 0.3]]")
TOGETHER = ("", "values = [[0.7, 0.0], [0.5, 0.2], [0.6, 0.1], [0.3, 0.5]]")
OUTCOMES = [
    ("infeasible", ("a1",)), ("infeasible", ("a1", "a2")), ("failed", ("a2",)),
    ("failed", ("a1", "a2")), ("failed", ()), ("infeasible", ()), ("missing", ()),
]  # fmt: skip


def study(
    folder: Path, varies: list[tuple[str, str]], more: str = "", name: str = "made-up"
) -> Study:
    """A study of a planar cell with these keys; ``more`` are lines of its file."""
    tables = "".join(
        f"[[vary]]\nkey = {key!r}\n{spec}\n" if key else f"[[vary]]\nkeys = {[X, LENGTH]}\n{spec}\n"
        for key, spec in varies
    )
    head, _, rest = more.partition("\n\n")
    file = folder / "study.toml"
    file.write_text(
        f'format = 1\nname = "{name}"\nproblem = "{PROBLEMS / "paper-fig2.toml"}"\n'
        f'record = ["{RADIUS}"]\n{head}\n{tables}\n{rest}\n'
    )
    return Study.read(file)


def smooth(values: dict[str, Any], seed: int) -> float:
    """An objective with one maximum, at x = 0.4, y = 0.6, the lightest mass."""
    numbers = {key: value for key, value in values.items() if isinstance(value, float)}
    x, y = numbers.get(X, 0.4), numbers.get(Y, 0.6)
    return 2 - 9 * (x - 0.4) ** 2 - 4 * (y - 0.6) ** 2 - 0.3 * numbers.get(MASS, 0.0) - 0.01 * seed


def no_joints(values: dict[str, Any]) -> dict[str, list[float]] | None:
    return None


def outcome(point: int) -> tuple[str, tuple[str, ...]]:
    """Four points of five are solved, the others take turns."""
    return ("solved", ()) if point % 5 else OUTCOMES[point // 5 % len(OUTCOMES)]


def solved(point: int) -> tuple[str, tuple[str, ...]]:
    return "solved", ()


def table(
    made: Study,
    objective: Callable[[dict[str, Any], int], float] = smooth,
    ends: Callable[[int], tuple[str, tuple[str, ...]]] = outcome,
    joints: Callable[[dict[str, Any]], dict[str, list[float]] | None] = no_joints,
) -> StudyTable:
    """The table of a record that is written line by line."""
    folder = StudyFolder(made.file.source.parent)
    with folder.record.open("w") as record:
        for point in range(len(made.points)):
            status, missing = ends(point)
            if status == "missing":
                continue
            values, seed = made.points.values(point), made.points.seed(point)
            number = objective(values, seed) if status == "solved" else None
            record.write(
                PointLine(
                    Point(point, values, seed, made.hashes.at(values, seed)),
                    status,
                    None if status == "solved" else "it had to be",
                    objective=number,
                    joints=joints(values) if status == "solved" else None,
                    record={RADIUS: None if number is None else math.exp(-number)},
                    missing=missing,
                    seconds=0.25,
                ).text + "\n"
            )  # fmt: skip
    return StudyTable.of(made, folder)


def words(figure: Figure) -> str:
    """All that is written on a figure."""
    return "\n".join(text.get_text() for text in figure.findobj(Text))


def outlines(figure: Figure) -> dict[str, Any]:
    """The patches of a map's first axes by their entries in the legend, without counts."""
    (ax, *_) = figure.axes
    named = {str(patch.get_label()).rpartition(" (")[0]: patch for patch in ax.patches}
    return {name: patch for name, patch in named.items() if name}


def test_cells_hold_what_the_table_holds(tmp_path: Path) -> None:
    unsorted = (X, "values = [0.7, 0.2, 0.45]")
    made = table(study(tmp_path, [unsorted, GRID[1]]))
    figure = study_map(made)
    image = figure.axes[0].images[0]
    left, right, bottom, top = image.get_extent()
    array = image.get_array()
    edges = np.asarray(getattr(image, "_Ax", np.linspace(left, right, 4)))
    told = 0
    for point in range(len(made)):
        values = made.values(point)
        column = int(np.searchsorted(edges, values[X])) - 1
        row = int((values[Y] - bottom) / (top - bottom) * array.shape[0])
        drawn = array[row, column]
        if made.statuses[point] == "solved":
            assert drawn == smooth(values, 0)
            told += 1
        else:
            assert np.ma.is_masked(drawn) or np.isnan(drawn)
    assert told == sum(status == "solved" for status in made.statuses) > 20


def test_hatches_cover_the_points_of_their_ending_and_no_others(tmp_path: Path) -> None:
    made = table(study(tmp_path, GRID))
    figure = study_map(made)
    expected = {
        "a1 cannot reach": ("infeasible", "a1"), "neither arm can reach": ("infeasible", "a1,a2"),
        "a2 does not reach, as far as was searched": ("failed", "a2"),
        "neither arm reaches, as far as was searched": ("failed", "a1,a2"),
        "failed": ("failed", ""), "other constraints not met": ("infeasible", ""),
    }  # fmt: skip
    patches = outlines(figure)
    assert patches.keys() == expected.keys()
    places = [[made.values(point)[key] for key in (X, Y)] for point in range(len(made))]
    for name, (status, missing) in expected.items():
        inside = [_holds(patches[name], place) for place in places]
        assert inside == [
            made.statuses[i] == status and made.missing[i] == missing for i in range(len(made))
        ]
        count = sum(inside)
        assert f"{name} ({count})" in words(figure)
    looks = {name: patch.get_hatch() for name, patch in patches.items()}
    assert len({*looks.values()}) == 4 + 1 and looks["failed"] != looks["a1 cannot reach"]
    count = sum(status == "missing" for status in made.statuses)
    assert count > 0 and f"not done yet ({count})" in words(figure)


def _holds(patch: Any, place: list[float]) -> bool:
    """Whether one of the rectangles of a patch has a place in it."""
    corners = patch.get_path().vertices.reshape(-1, 5, 2)
    low, high = corners.min(axis=1), corners.max(axis=1)
    return bool(((low < place) & (place < high)).all(axis=1).any())


def test_the_best_point_is_marked_and_told(tmp_path: Path) -> None:
    made = table(study(tmp_path, GRID))
    best = max(
        (p for p in range(len(made)) if made.statuses[p] == "solved"),
        key=lambda p: smooth(made.values(p), 0),
    )
    figure = study_map(made)
    (star,) = [c for c in figure.axes[0].collections if str(c.get_label()).startswith("best")]
    assert star.get_offsets()[0].tolist() == [made.values(best)[X], made.values(best)[Y]]
    told = words(figure).replace("\n", " ")
    x, y = made.values(best)[X], made.values(best)[Y]
    number = f"{smooth(made.values(best), 0):.2f}"
    assert f"best log-volume {number} at {X} {x:.4g} m, {Y} {y:.4g} m" in told
    assert "143 points: 114 solved" in told


def test_of_several_seeds_the_best_is_shown_and_the_spread_told(tmp_path: Path) -> None:
    def seeded(values: dict[str, Any], seed: int) -> float:
        return smooth(values, 0) + (0.5 if seed == round(10 * values[X]) % 3 else 0.0)

    made = table(study(tmp_path, GRID[:1], "seeds = [0, 1, 2]"), seeded, solved)
    content = MapContent.of(made)
    points = [3 * k + round(10 * made.values(3 * k)[X]) % 3 for k in range(13)]
    assert content.places.points.tolist() == points
    assert content.places.values.tolist() == [made.numbers["objective"][p] for p in points]
    assert "the best of 3 seeds, which agree at 0.0" not in words(study_map(made))
    assert "median 0.500, at most 0.500" in words(study_map(made)).replace("\n", " ")


def test_a_seed_that_solves_a_point_counts_and_a_proof_before_a_failure(tmp_path: Path) -> None:
    ends = [("failed", ()), ("solved", ()), ("failed", ()), ("infeasible", ("a1",)),
            ("failed", ("a1",)), ("failed", ()), ("missing", ()), ("failed", ())]  # fmt: skip
    varies = [(X, "from = 0.2\nto = 0.5\nsteps = 4")]
    made = table(study(tmp_path, varies, "seeds = [0, 1]"), ends=ends.__getitem__)
    content = MapContent.of(made)
    endings = [content.places.endings[code] for code in content.places.codes]
    assert [(e.status, e.arms) for e in endings] == [
        ("solved", ()), ("infeasible", ("a1",)), ("failed", ("a1",)), ("failed", ()),
    ]  # fmt: skip


def test_switches_are_where_joints_were_made_to_jump() -> None:
    along = np.linspace(0.0, 1.0, 21)
    left = [[0.4 * math.sin(x), 0.3 * x + (1.2 if x > 0.52 else 0.0)] for x in along]
    # A whole turn leaves every link where it was.
    right = [[0.9 * x, math.tau * (x > 0.3) + 0.1 * x] for x in along]
    joints: list[Any] = [{"left": a, "right": b} for a, b in zip(left, right, strict=True)]
    (switch,) = branch_switches(along, joints)
    assert switch.arms == ("left",) and switch.at == pytest.approx(0.525)
    joints[11] = None
    assert branch_switches(along, joints) == []
    cases = [None if each is None else {"up": each} for each in joints[:11]]
    assert branch_switches(along[:11], cases) == []


def test_steep_but_steady_joints_do_not_switch_and_spacing_counts() -> None:
    along = np.array([0.0, 0.1, 0.2, 0.3, 1.0, 1.1])
    assert branch_switches(along, [{"a": [4 * x]} for x in along]) == []
    jump = [{"a": [4 * x + 2.0 * (x > 0.25)]} for x in along]
    assert [switch.at for switch in branch_switches(along, jump)] == [pytest.approx(0.25)]


def test_a_curve_marks_its_switches_and_is_broken_there(tmp_path: Path) -> None:
    def joints(values: dict[str, Any]) -> dict[str, list[float]]:
        return {"a1": [values[X], 0.0], "a2": [values[X], 2.0 * (values[X] > 0.62)]}

    made = table(study(tmp_path, GRID[:1]), ends=solved, joints=joints)
    ax = study_map(made).axes[0]
    (mark,) = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert mark.get_xdata() == pytest.approx([0.625, 0.625])
    assert [text.get_text() for text in ax.texts] == ["a2"]
    (curve,) = [line for line in ax.lines if line.get_linestyle() == "-"]
    x, y = curve.get_xdata(), curve.get_ydata()
    assert x[np.isnan(y)].tolist() == pytest.approx([0.625])
    known = [(a, b) for a, b in zip(x, y, strict=True) if np.isfinite(b)]
    assert known == [(made.values(p)[X], made.numbers["objective"][p]) for p in range(13)]


def test_keys_that_vary_together_in_numbers_are_a_curve_over_the_first(tmp_path: Path) -> None:
    made = table(study(tmp_path, [TOGETHER]), ends=solved)
    ax = study_map(made).axes[0]
    assert ax.get_xlabel() == f"{X} (and 1 more), m"
    (curve,) = [line for line in ax.lines if line.get_linestyle() == "-"]
    assert curve.get_xdata().tolist() == [0.3, 0.5, 0.6, 0.7]
    assert curve.get_ydata().tolist() == [made.numbers["objective"][p] for p in (3, 1, 2, 0)]


def test_the_pareto_front_is_what_brute_force_finds() -> None:
    rng = np.random.default_rng(4)
    for count in (1, 2, 50, 300):
        # Few different numbers, so that many are equal.
        one, other = rng.integers(0, 9, (2, count)).astype(float)
        one[rng.random(count) < 0.1] = np.nan
        beaten = [
            any(
                one[j] >= one[i] and other[j] >= other[i]
                and (one[j] > one[i] or other[j] > other[i] or j < i)
                for j in range(count) if j != i
            ) or math.isnan(one[i])
            for i in range(count)
        ]  # fmt: skip
        front = pareto_front(one, other)
        assert sorted(front.tolist()) == np.flatnonzero(~np.array(beaten)).tolist()
        assert (np.diff(one[front]) < 0).all() and (np.diff(other[front]) > 0).all()


def test_a_trade_off_draws_the_front_of_what_is_wanted(tmp_path: Path) -> None:
    def twofold(values: dict[str, Any], seed: int) -> float:
        return smooth(values, seed)

    more = f'\n\n[map]\npareto = ["objective", "-{RADIUS}"]'
    made = table(study(tmp_path, GRID, more), twofold)
    figure = study_map(made)
    ax = figure.axes[-1]
    (front,) = [line for line in ax.lines if line.get_drawstyle() == "steps-post"]
    # The radius is exp(−objective): less of it is more of the objective, and one point beats all.
    best = made.best(1)[0]
    assert front.get_xdata().tolist() == [made.numbers["objective"][best]]
    assert front.get_ydata().tolist() == [made.numbers[RADIUS][best]]
    against = table(study(tmp_path, GRID, more.replace("-after", "after")), twofold)
    ax = study_map(against).axes[-1]
    (front,) = [line for line in ax.lines if line.get_drawstyle() == "steps-post"]
    different = {against.numbers["objective"][p] for p in against.best(len(against))}
    assert front.get_xdata().tolist() == sorted(different, reverse=True)
    assert "A: 2.00 and 0.135 at " in words(study_map(against))


def test_importance_is_the_first_order_index() -> None:
    rng = np.random.default_rng(7)
    x = rng.random((4000, 4))
    linear = x[:, 0] + 2 * x[:, 1] + 0 * x[:, 2]
    shares = [first_order_share(x[:, k], linear) for k in range(3)]
    assert shares == pytest.approx([0.2, 0.8, 0.0], abs=0.02)
    # Ishigami's function: S₁ = 0.3139, S₂ = 0.4424, S₃ = 0.
    u = math.pi * (2 * x - 1)
    ishigami = np.sin(u[:, 0]) + 7 * np.sin(u[:, 1]) ** 2 + 0.1 * u[:, 2] ** 4 * np.sin(u[:, 0])
    shares = [first_order_share(u[:, k], ishigami) for k in range(4)]
    assert shares == pytest.approx([0.3139, 0.4424, 0.0, 0.0], abs=0.03)
    named = np.repeat([0.0, 1.0, 2.0], 40)
    assert first_order_share(named, named**2) == pytest.approx(1.0)
    assert first_order_share(named, np.full(120, 0.1)) == 0.0
    assert first_order_share(np.zeros(5), rng.random(5)) == 0.0
    assert first_order_share(np.zeros(0), np.zeros(0)) == 0.0


def test_importance_of_what_does_not_count_is_small_in_few_points() -> None:
    rng = np.random.default_rng(1)
    shares = [first_order_share(rng.random(100), rng.random(100)) for _ in range(200)]
    assert np.mean(shares) < 0.04


SAMPLE = '\n\n[sample]\nmethod = "sobol"\ncount = {}'
RANGES = [(X, "from = 0.2\nto = 0.8"), (Y, "from = 0.3\nto = 0.9"), (MASS, "from = 0.1\nto = 2.0"),
          (BASE, "from = 0.8\nto = 1.2"), (LENGTH, "from = -0.1\nto = 0.1")]  # fmt: skip
THIRD = (MASS, "from = 0.1\nto = 1.5\nsteps = 15")
FEW = [(key, f"{spec}\nsteps = 3") for key, spec in RANGES]
TRADE = f'\n\n[map]\npareto = ["objective", "{RADIUS}"]'
KINDS = {
    "curve": (GRID[:1], ""),
    "names": ([NAMED], ""),
    "many-names": ([(MASS, f'values = [{", ".join(f"{i}.5" for i in range(30))}, "heavy"]')], ""),
    "keys-together": ([TOGETHER], ""),
    "map": (GRID, ""),
    "named-map": ([NAMED, GRID[1]], ""),
    "named-map-upright": ([GRID[1], NAMED], ""),
    "one-row": ([GRID[0], (MASS, "values = [1.0]")], ""),
    "slices": ([*GRID, THIRD], ""),
    "two-slices": ([*GRID, (MASS, "values = [1.0, 2.0]")], ""),
    "grid-of-four": (FEW[:4], ""),
    "sample-of-one": (RANGES[:1], SAMPLE.format(60)),
    "sample-of-two": (RANGES[:2], SAMPLE.format(60)),
    "sample-of-three": (RANGES[:3], SAMPLE.format(60)),
    "sample-of-five": (RANGES, SAMPLE.format(200)),
    "sample-with-names": ([NAMED, *RANGES[:2]], SAMPLE.format(60)),
    "seeds": (GRID, "seeds = [0, 1]"),
    "curve-trade-off": (GRID[:1], TRADE),
    "map-trade-off": (GRID, TRADE),
    "sample-trade-off": (RANGES, SAMPLE.format(60) + TRADE[1:]),
    "recorded": (GRID, f'\n\n[map]\nvalue = "{RADIUS}"\nx = "{Y}"'),
    "kinds": ([("objective.kind", 'values = ["volume", "isotropy"]')], ""),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_picture_is_drawn_and_nothing_overlaps(kind: str, tmp_path: Path) -> None:
    varies, more = KINDS[kind]
    made = table(study(tmp_path, varies, more))
    figure = study_map(made)
    FigureCanvasAgg(figure).draw()
    boxes = _boxes(figure)
    for (name, box), (other_name, other) in itertools.combinations(boxes, 2):
        wide = min(box.x1, other.x1) - max(box.x0, other.x0)
        tall = min(box.y1, other.y1) - max(box.y0, other.y0)
        assert min(wide, tall) < 3.0, (name, other_name)
    for name, box in boxes:
        assert box.x0 > -2 and box.y0 > -2, name
        assert box.x1 < figure.bbox.x1 + 2 and box.y1 < figure.bbox.y1 + 2, name


def _boxes(figure: Figure) -> list[tuple[str, Any]]:
    """Where axes with their labels, words above and the legend below are, pixels."""
    # Stars on the edge of charts may reach out of them.
    for ax in figure.axes:
        for star in [c for c in ax.collections if not c.get_clip_on()]:
            star.remove()
    renderer = figure.canvas.get_renderer()
    shown = [ax for ax in figure.axes if ax.get_visible()]
    artists = [*shown, *figure.texts, *figure.legends]
    return [(str(artist), artist.get_tightbbox(renderer)) for artist in artists]


@pytest.mark.parametrize(
    ("kind", "status"),
    [("curve", "missing"), ("names", "failed"), ("map", "infeasible"), ("two-slices", "failed"),
     ("sample-of-five", "infeasible"), ("sample-of-two", "missing"), ("map-trade-off", "missing"),
     ("grid-of-four", "failed")],
)  # fmt: skip
def test_where_nothing_is_solved_it_says_so(kind: str, status: str, tmp_path: Path) -> None:
    varies, more = KINDS[kind]
    made = table(study(tmp_path, varies, more), ends=lambda point: (status, ()))
    assert study_picture(made).startswith(b"\x89PNG")
    assert "made-up: no point is solved" in words(study_map(made))


def test_slices_share_one_scale_and_the_best_has_a_slice(tmp_path: Path) -> None:
    def best_at(values: dict[str, Any], seed: int) -> float:
        return smooth({**values, MASS: 0.0}, seed) - abs(values[MASS] - 0.3)

    varies = [(key, spec.replace("13", "5").replace("11", "4")) for key, spec in GRID]
    made = table(study(tmp_path, [*varies, THIRD]), best_at)
    figure = study_map(made)
    slices = [ax for ax in figure.axes if ax.get_title()]
    assert len(slices) == 12
    assert {ax.images[0].norm.vmin for ax in slices} == {np.nanmin(made.numbers["objective"])}
    assert {ax.images[0].norm.vmax for ax in slices} == {np.nanmax(made.numbers["objective"])}
    starred = [ax.get_title() for ax in slices
               if any(str(c.get_label()).startswith("best") for c in ax.collections)]  # fmt: skip
    assert starred == ["object.mass = 0.3 kg"]
    assert len(figure.axes) == 13
    for ax in slices:
        mass = float(ax.get_title().split()[2])
        rows = [made.numbers["objective"][p] for p in range(len(made))
                if made.values(p)[MASS] == mass]  # fmt: skip
        drawn = np.ma.filled(ax.images[0].get_array(), np.nan).T.ravel()
        assert np.array_equal(drawn, rows, equal_nan=True)


def test_pairs_of_a_grid_show_the_largest_over_the_other_keys(tmp_path: Path) -> None:
    made = table(study(tmp_path, FEW[:4]))
    (ax,) = [ax for ax in study_map(made).axes if ax.images and ax.get_xlabel() and ax.get_ylabel()]
    one, other = (
        label.replace("\n", "").rpartition(", ")[0] for label in (ax.get_xlabel(), ax.get_ylabel())
    )
    largest: dict[tuple[float, float], float] = {}
    for point in made.best(len(made)):
        pair = made.values(point)[one], made.values(point)[other]
        largest.setdefault(pair, made.numbers["objective"][point])
    drawn = np.ma.filled(ax.images[-1].get_array(), np.nan)
    columns, rows = sorted({a for a, _ in largest}), sorted({b for _, b in largest})
    expected = [[largest.get((a, b), np.nan) for a in columns] for b in rows]
    assert np.array_equal(drawn, expected, equal_nan=True)


def test_values_of_different_kinds_are_not_compared(tmp_path: Path) -> None:
    varies, more = KINDS["kinds"]
    made = table(study(tmp_path, varies, more), ends=solved)
    told = words(study_map(made))
    assert "kinds differ" in told and "best" not in told


@pytest.mark.parametrize(
    ("keys", "rows", "labels"),
    [
        (["k"], [("robots/panda.urdf",), ("robots/ur5.urdf",)], ["panda", "ur5"]),
        (["k"], [("volume",), ("payload",)], ["volume", "payload"]),
        (["k"], [({"kind": "a", "n": 1},), ({"kind": "b", "n": 1},)], ["a", "b"]),
        (["arms.l.base.position", "arms.l.base.rpy"],
         [((0, 0, 1), (0, 0, 0)), ((0, 0.25, 1), (0, 0, 1.5))],
         ["y\xa00, yaw\xa00", "y\xa00.25, yaw\xa01.5"]),
        (["a.urdf", "a.tip"], [("x/p.urdf", "hand"), ("x/q.urdf", "tool")],
         ["p, hand", "q, tool"]),
        (["k"], [("same",), ("same",)], [" (1)", " (2)"]),
        (["k"], [(True,), (False,)], ["True", "False"]),
    ],
)  # fmt: skip
def test_rows_are_named_by_what_differs(
    keys: list[str], rows: list[tuple[Any, ...]], labels: list[str]
) -> None:
    assert list(row_labels(keys, rows)) == labels


@pytest.mark.parametrize(
    ("path", "unit"),
    [("object.position.x", "m"), ("object.rpy.2", "rad"), ("object.mass", "kg"),
     ("object.freedom.yaw", "rad"), ("object.freedom.x", "m"), ("objective.kind", ""),
     ("after.payload", "kg"), ("arms.left.torque_limits.3", "N·m"), ("world.gravity.z", "m/s²")],
)  # fmt: skip
def test_keys_have_units(path: str, unit: str) -> None:
    assert unit_of(path) == unit


def million(made: Study) -> StudyTable:
    """A table of a study without a record."""
    x = made.points.along(0)
    x = (x - x.min()) / (x.max() - x.min())
    statuses = np.where(x > 0.7, "infeasible", "solved")
    objective = np.where(x > 0.7, np.nan, np.sin(5 * x))
    count = len(x)
    return StudyTable(
        study=made,
        statuses=tuple(statuses.tolist()),  # type: ignore[arg-type]
        numbers={"objective": objective, RADIUS: objective**2},
        missing=tuple(np.where(x > 0.7, "a1", "").tolist()),
        seconds=np.full(count, 0.1),
        arms=("a1", "a2"),
        offsets=np.full(count, -1, dtype=np.intp),
        lines=None,
    )


@pytest.mark.parametrize(
    ("varies", "more"),
    [([(X, "from = 0.0\nto = 1.0\nsteps = 1000"), (Y, "from = 0.0\nto = 1.0\nsteps = 1000")], ""),
     (RANGES[:3], '\n\n[sample]\nmethod = "random"\ncount = 1000000')],
)  # fmt: skip
def test_a_million_points_are_drawn_in_seconds_with_few_artists(
    varies: list[tuple[str, str]], more: str, tmp_path: Path
) -> None:
    made = million(study(tmp_path, varies, more))
    begun = time.process_time()
    figure = study_map(made)
    assert len(figure.findobj()) < 3000
    assert saved(figure, "png").startswith(b"\x89PNG")
    assert time.process_time() - begun < 10.0


def test_an_ending_that_is_none_is_refused(tmp_path: Path) -> None:
    made = table(study(tmp_path, GRID[:1]))
    with pytest.raises(InputError, match=r"a picture ends in \.png, \.pdf, \.svg"):
        draw_study(made, tmp_path / "map.jpg")
    for kind, begin in (("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")):
        draw_study(made, tmp_path / f"map.{kind}")
        assert (tmp_path / f"map.{kind}").read_bytes().startswith(begin)


PRINTED = {
    "study": (GRID, "", outcome),
    "study-names": ([NAMED, GRID[1]], "seeds = [0, 1]", outcome),
    "study-many-keys": (RANGES, SAMPLE.format(64), solved),
    "study-nothing": (GRID[:1], "", lambda point: ("failed", ())),
}


def test_a_map_of_one_key_shows_the_best_over_all_others(tmp_path: Path) -> None:
    made = table(study(tmp_path, GRID, f'seeds = [0, 1]\n\n[map]\nx = "{Y}"'))
    content = MapContent.of(made)
    best: dict[float, float] = {}
    for point in range(len(made)):
        number = made.numbers["objective"][point]
        if made.statuses[point] == "solved":
            y = made.values(point)[Y]
            best[y] = max(best.get(y, -math.inf), number)
    assert len(content.axes) == 1
    along = content.along(content.axes[0]).tolist()
    assert dict(zip(along, content.places.values.tolist(), strict=True)) == best


def printed(name: str, folder: Path) -> str:
    """What stands on the terminal."""
    varies, more, ends = PRINTED[name]
    console = Console(width=80, file=io.StringIO(), highlight=False)
    console.print(study_table(table(study(folder, varies, more, name), ends=ends)))
    return "".join(f"{line.rstrip()}\n" for line in console.file.getvalue().splitlines())


@pytest.mark.parametrize("name", PRINTED)
def test_the_table_fits_on_a_screen_and_is_as_before(name: str, tmp_path: Path) -> None:
    text = printed(name, tmp_path)
    assert max(map(cell_len, text.splitlines())) <= 80 and text.count("\n") <= 40
    assert text == (SNAPSHOTS / f"{name}.txt").read_text()


def test_the_table_tells_as_many_of_the_best_as_are_asked_for(tmp_path: Path) -> None:
    made = table(study(tmp_path, GRID))
    console = Console(width=80, file=io.StringIO(), highlight=False)
    console.print(study_table(made, most=12))
    text = console.file.getvalue()
    points = [int(word) for line in text.splitlines() if line.startswith("point ") and "│" in line
              for word in line.replace("│", " ").split()[1:]]  # fmt: skip
    assert points == made.best(12)
    assert " 12th" in text and " 11th" in text


if __name__ == "__main__":
    import tempfile

    for name in PRINTED:
        with tempfile.TemporaryDirectory() as place:
            (SNAPSHOTS / f"{name}.txt").write_text(printed(name, Path(place)))
