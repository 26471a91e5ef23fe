"""Tables and pictures of what torque limits allow: right numbers, units, words, and one look."""

from __future__ import annotations

import io
import math
import re
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from rich.console import Console

import copose
from cells import closed_postures, planar, two_pandas
from copose.cell.cell import Cell
from copose.problem import parse
from copose.report import compare, picture
from copose.report.charts.exact_sets import SetPicture, draw_set, set_pictures
from copose.report.geometry.hulls import Hull as Solid
from copose.report.geometry.slices import angular_slice, linear_slice
from copose.report.look import LOOK
from copose.report.panels import result_panels
from copose.report.scene.planar import holding_arrows
from copose.report.text import comparison_table, solution_table
from copose.report.text.limits import limit_lines
from copose.report.words import gain_words, objective_name, three, value_words
from copose.results import (
    AccelerationRecord,
    EllipsoidRecord,
    ObjectiveRecord,
    Posture,
    Solution,
    WrenchRecord,
)

UP = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


def limited(space: str, **more: object) -> dict:
    """Two arms with torque limits, in a world with gravity."""
    if space.startswith("spatial"):
        return two_pandas(space) | more
    cell = planar(2, 4, space, world={"gravity": [0.0, -9.81]}, **more)
    for arm in cell["arms"]:
        arm["torque_limits"] = [30.0, 25.0, 20.0, 15.0]
    return cell


def evaluated(cell: dict) -> Solution:
    """Some posture of it that holds the object, with everything stated."""
    ready = Cell.of(parse(cell))
    joints = {
        arm.name: closed_postures(ready, i, 64)[0].tolist() for i, arm in enumerate(ready.arms)
    }
    return copose.evaluate(parse(cell), joints)


@cache
def known(space: str = "spatial", *axes: str, scaling: str = "unit") -> Solution:
    objective = {"kind": "volume"} | ({"axes": list(axes)} if axes else {})
    return evaluated(limited(space, objective=objective, ellipsoid={"torque_scaling": scaling}))


def changed(solution: Solution, **keys: object) -> Solution:
    """The same with other keys of the posture; None takes a key away."""
    posture = solution.after.model_copy(update=keys)
    posture.model_fields_set.difference_update(k for k, value in keys.items() if value is None)
    return solution.model_copy(update={"after": posture})


def compared(solution: Solution, before: Posture | None = None) -> Solution:
    """As `copose solve` has it."""
    return solution.model_copy(update={"before": before or solution.after})


def said(solution: Solution, width: int = 100) -> str:
    console = Console(width=width, file=io.StringIO(), highlight=False)
    console.print(solution_table(solution))
    return console.file.getvalue()


def rows(text: str, start: str) -> list[list[str]]:
    """The cells of every line that starts so."""
    begins = re.compile(rf"{re.escape(start)}\s*│")
    lines = [line for line in text.splitlines() if begins.match(line)]
    return [[cell.strip() for cell in line.split("│")[1:]] for line in lines]


def row(text: str, start: str) -> list[str]:
    """Of the first such line."""
    return rows(text, start)[0]


class TestWords:
    """Gains and values of every kind of objective."""

    @pytest.mark.parametrize(
        ("kind", "unit", "before", "after", "words"),
        [
            ("acceleration", "m/s²", 50.0, 75.0, "acceleration ×1.5"),
            ("acceleration", "m/s²", -12.0, 47.0, "acceleration +59 m/s²"),
            ("acceleration", "m/s²", 3.0, -1.0, "acceleration -4 m/s²"),
            ("acceleration", "rad/s²", None, 47.0, ""),
            ("payload", "kg", 2.0, 5.0, "payload ×2.5"),
            ("all-round", "m/s²", 0.0, 12.0, "acceleration all round +12 m/s²"),
            ("velocity-volume", "log", -3.0, -3.0 + math.log(2), "velocity volume ×2"),
            ("force-volume", "log", 1.0, 1.0 + math.log(3), "force volume ×3"),
            ("isotropy", "1", 0.0, 0.25, "shortest / longest +0.25"),
        ],
    )
    def test_gains(self, kind, unit, before, after, words) -> None:
        objective = ObjectiveRecord(kind=kind, unit=unit, before=before, after=after)
        solution = compared(known()).model_copy(update={"objective": objective})
        assert gain_words(solution) == words
        shown = row(said(solution), objective_name(solution))
        assert shown[1] == f"{after:.6f}"
        gain = " ".join(words.split()[-2:] if words.endswith("²") else words.split()[-1:])
        expected = words if unit in ("log", "1") else f"{unit}, {gain}" if words else unit
        assert shown[2] == expected

    @pytest.mark.parametrize("kind", ["velocity", "force"])
    def test_of_two_axes_it_is_an_area(self, kind: str) -> None:
        values = {"before": 0.0, "after": math.log(2)}
        objective = ObjectiveRecord(kind=f"{kind}-volume", unit="log", **values)
        flat = known("planar-linear").model_copy(update={"objective": objective})
        assert gain_words(flat) == f"{kind} area ×2"

    def test_no_value(self) -> None:
        objective = ObjectiveRecord(kind="all-round", unit="m/s²", before=None, after=None)
        solution = known().model_copy(update={"objective": objective})
        assert value_words(solution, solution.after) == "no acceleration all round"
        assert row(said(solution), "acceleration all round")[0] == "–"

    @pytest.mark.parametrize(
        ("objective", "name", "unit"),
        [
            ({"kind": "acceleration", "direction": UP}, "acceleration", "m/s²"),
            ({"kind": "acceleration", "direction": UP[::-1]}, "acceleration", "rad/s²"),
            ({"kind": "payload"}, "payload", "kg"),
            ({"kind": "all-round", "axes": ["x", "y"]}, "acceleration all round", "m/s²"),
            ({"kind": "velocity-volume"}, "velocity log-volume", ""),
            ({"kind": "force-volume"}, "force log-volume", ""),
        ],
    )
    def test_every_kind_is_told(self, objective, name, unit) -> None:
        """Once: what the objective says stands in no second row."""
        solution = evaluated(limited("spatial", objective=objective))
        value = solution.objective.after
        assert row(said(solution), name) == [f"{value:.6f}", unit]
        words = value_words(solution, solution.after)
        assert words == f"{name} {value:.4g} {unit}".rstrip()
        assert said(solution).count("the most that can be held") == (name != "payload")
        assert said(solution).count("residual radius") == {"acceleration all round": 0}.get(name, 2)
        if name == "payload":
            assert picture(solution, "svg").decode().count(words) == 1

    @pytest.mark.parametrize(
        ("value", "words"),
        [
            (None, "–"), (0.0, "0"), (-1e-15, "0"), (34.0, "34.0"), (0.0412345, "0.0412"),
            (171.54, "172"), (1234.5, "1230"), (9.999, "10.0"), (-3.456, "-3.46"), (1e7, "1e+07"),
        ],
    )  # fmt: skip
    def test_three_digits(self, value, words) -> None:
        assert three(value) == words


class TestTables:
    """What a terminal shows of a posture."""

    def test_single_numbers(self) -> None:
        solution = known()
        text, after = said(solution), solution.after
        assert row(text, "payload") == [
            three(after.payload), "kg, the most that can be held",
        ]  # fmt: skip
        for kind, unit in (("linear", "m/s²"), ("angular", "rad/s²")):
            radius = three(after.exact_sets[kind].residual_radius)
            expected = [radius, f"{unit}, all round from rest"]
            assert row(text, f"residual radius, {kind}") == expected
        largest = 100 * max(map(max, after.static_torque.values()))
        assert f"largest holding torque: {largest:.1f} % of its limit, " in text

    def test_before_and_after(self) -> None:
        before = known().after.model_copy(update={"payload": 3.0, "static_torque": None})
        text = said(compared(known(), before))
        assert row(text, "payload")[:2] == ["3.00", three(known().after.payload)]
        assert "largest holding torque" in text and "; before" not in text
        assert re.search("┃ +before ┃ +after ┃", text)
        assert "contact wrenches after" in text
        later = known().after.model_copy(
            update={"static_torque": {"left": (0.5,), "right": (0.6,)}}
        )
        assert "; before 60.0 %" in " ".join(said(compared(known(), later)).split())

    def test_lines_are_not_broken(self) -> None:
        """At 100 columns they are those of a wider screen."""
        results = (known(), compared(known()), known("planar"), known("spatial-linear"))
        for solution in results:
            narrow, wide = (
                [line for line in said(solution, width).splitlines() if "│" in line]
                for width in (100, 300)
            )
            assert narrow == wide

    def test_nothing_is_said_that_is_not_known(self) -> None:
        text = said(evaluated(planar(2, 4, "planar")))
        for words in ("payload", "residual", "largest", "hold", "contact wrenches"):
            assert words not in text.split("note:")[0]
        assert "closed-chain velocity" in text
        keys = ("payload", "static_torque", "residual_radius", "accelerations", "wrenches",
                "joint_accelerations", "exact_sets", "companions")  # fmt: skip
        bare = said(changed(known(), **dict.fromkeys(keys)))
        assert bare.count("━") < said(known()).count("━") and "external force" not in bare
        bare = bare.split("note:")[0]
        assert "payload" not in bare and "hold" not in bare

    def test_shares(self) -> None:
        shares = {"left": (0.034, 0.52, *(0.1,) * 5), "right": (0.52 * (1 - 1e-9), *(0.0,) * 6)}
        text = said(changed(known(), static_torque=shares))
        cells = [cells[-1] for i in range(1, 8) for cells in rows(text, f"  {i}")]
        assert cells[::2] == ["3.4", "*52.0", *["10.0"] * 5]
        assert cells[1::2] == ["*52.0", *["0.0"] * 6]
        assert "52.0 % of its limit, left panda_joint2; right panda_joint1" in text

    def test_shares_above_the_limit(self) -> None:
        shares = {"left": (1.2, 1.05, *(1.0,) * 5), "right": (0.5,) * 7}
        solution = changed(known(), static_torque=shares)
        assert rows(said(solution), "  1")[0][-1] == "*120.0"
        colored = Console(
            width=100, file=io.StringIO(), force_terminal=True, color_system="standard"
        )
        colored.print(solution_table(solution))
        assert colored.file.getvalue().count("\x1b[1;31m") == 2

    @pytest.mark.parametrize(
        ("kind", "more"),
        [
            ("payload", {}), ("acceleration", {"direction": UP}), ("all-round", {"axes": ["x"]}),
            ("acceleration", {"directions": [UP, [-x for x in UP]]}),
        ],
    )  # fmt: skip
    def test_the_torques_that_decide_are_at_their_limits(self, kind: str, more: dict) -> None:
        """By Pinocchio's inverse dynamics they are what the extreme takes: test_torque_limits."""
        solution = evaluated(limited("spatial", objective={"kind": kind, **more}))
        (line,) = [x for x in limit_lines(solution, solution.after) if x[0] == "at torque limits:"]
        decisive = {
            name: max(map(max, shares.values()))
            for name, shares in solution.after.torque_shares.items()
        }
        assert "none" not in line[1] and all(
            x == pytest.approx(1, abs=1e-6) for x in decisive.values()
        )

    def test_joints_at_limits_are_told(self) -> None:
        lower = known().limits["left"][1].lower
        joints = {arm: list(q) for arm, q in known().after.joints.items()}
        joints["left"][1] = lower + 1e-5
        text = said(changed(known(), joints=joints))
        assert re.search(r"at joint limits: +left panda_joint2 \(lower\)\s*$", text, re.M)
        assert rows(text, "  2")[0][1] == f"*{lower:.4f}"
        assert re.search(r"at joint limits: +none\s*$", said(known()), re.M)

    def test_accelerations(self) -> None:
        def along(value: float | None, *u: float) -> AccelerationRecord:
            return AccelerationRecord(direction=u, value=value)

        half = math.sqrt(0.5)
        records = (
            along(1234.5, 0, 0, 1, 0, 0, 0), along(4.0, half, -half, 0, 0, 0, 0),
            along(7.0, half, 0, 0, 0, 0, -half), along(2.5, 0, 0, 1, 0, 0, 0),
            along(None, 0, 0, -1, 0, 0, 0), along(33.333, 0, 0, 0, 0, 0, 1),
            along(-5.0, 0, 0, 0, 0, 0, -1),
        )  # fmt: skip
        text = said(changed(known(), accelerations=records))
        assert row(text, "+z / −z") == ["2.50 /     –", "m/s²"]
        assert row(text, "0.71 x − 0.71 y") == ["4.00", "m/s²"]
        assert row(text, "0.71 x − 0.71 yaw") == ["7.00", "m/s², rad/s²"]
        assert row(text, "+yaw / −yaw") == ["33.3 / -5.00", "rad/s²"]
        later = changed(known(), accelerations=(along(None, 0, 0, 1, 0, 0, 0),))
        text = said(compared(later, changed(known(), accelerations=records[:1]).after))
        assert row(text, "+z") == ["1230", "–", "m/s²"]

    def test_joint_accelerations(self) -> None:
        """The largest of each extreme, opposite directions in one row."""
        solution = known()
        text, told = said(solution), solution.after.joint_accelerations
        largest = {
            name: three(max(abs(x) for part in by_arm.values() for x in part))
            for name, by_arm in told.items()
        }
        pair = f"{largest['acceleration +z']} / {largest['acceleration −z']}"
        shown = [re.sub(" +", " ", cell) for (cell, *_) in rows(text, "+z / −z")]
        assert pair in shown
        for kind in ("linear", "angular"):
            if f"residual radius, {kind}" in largest:
                value = largest[f"residual radius, {kind}"]
                assert row(text, f"all round, {kind}") == [value]
        keys = {"accelerations": None, "joint_accelerations": None}
        assert "joint accelerations" not in said(changed(known(), **keys)).split("note:")[0]

    def test_contact_wrenches(self) -> None:
        solution = known()
        text, after = said(solution), solution.after
        for name in ("hold", "payload"):
            for cell, arm in zip(rows(text, name)[-1], ("left", "right"), strict=True):
                record = after.wrenches[name][arm]
                parts = (record.wrench[:3], record.wrench[3:], record.internal[:3])
                sizes = [three(float(np.linalg.norm(part))) for part in parts]
                assert re.split(r"\s*/\s*", cell) == sizes
        assert "acceleration +x" not in text
        assert f"of {len(after.wrenches) - 2} more: in result.json" in text
        flat = said(known("planar-linear"))
        assert "in result.json" not in flat and "moment /" not in flat
        force = known("planar-linear").after.wrenches["acceleration −y"]["a1"].wrench
        assert row(flat, "acceleration −y")[0].startswith(three(math.hypot(*force)))

    def test_the_objectives_extremes_are_spelt_out(self) -> None:
        wrench = WrenchRecord(wrench=(3.0, 4.0, 0, 0, 0, 2.0), internal=(0,) * 6)
        both = {"left": wrench, "right": wrench}
        records = [AccelerationRecord(direction=u, value=1.0) for u in (UP, [-x for x in UP])]
        sizes = [["5.00", "2.00", "0"]] * 2
        wrenches = {"acceleration 1": both, "acceleration 2": both, "hold": both}
        many = {f"acceleration +{c}": both for c in "xyz"} | known().after.wrenches
        for extremes, count in ((wrenches, 0), (wrenches | many, len(many) - 3)):
            solution = changed(known(), accelerations=records, wrenches=extremes)
            text = said(solution)
            for name in ("acceleration +z", "acceleration −z"):
                assert [re.split(r" / +", cell) for cell in row(text, name)] == sizes
            assert ("more: in result.json" in text) == (count > 0)

    def test_many_arms_stand_in_several_tables(self) -> None:
        text = said(evaluated(tables_of_many()))
        assert text.count("contact wrenches") == 2 and text.count("┃ N / N") == 0
        assert [len(cells) for cells in rows(text, "hold")] == [2, 2]

    @pytest.mark.parametrize(
        ("scaling", "torque"), [("unit", "per N·m of torque"), ("limits", "at the torque limits")]
    )
    def test_companions(self, scaling: str, torque: str) -> None:
        solution = known("spatial", scaling=scaling)
        text, axes = said(solution), solution.problem.axes
        for name, record in solution.after.companions.items():
            if name == "internal force":
                assert row(text, name)[0].split() == list(map(three, record.radii))
                continue
            parts = (linear_slice(record, axes), angular_slice(record, axes))
            radii = [list(map(three, part.ellipsoid.radii)) for part in parts]
            assert [cell.split() for cell in row(text, name)] == radii
        for head in ("velocities per unit joint speed", f"forces {torque}"):
            assert head in text
        for unit in ("m/s", "rad/s", "N", "N·m"):
            assert re.search(rf"semi-axes, {unit}(?= |$)", text, re.M)

    def test_a_comparison_has_both(self) -> None:
        other = known("spatial", "x", "y")
        console = Console(width=100, file=io.StringIO())
        console.print(comparison_table(compare(known(), other)))
        text = console.file.getvalue()
        values = [f"{three(each.after.payload)} kg" for each in (known(), other)]
        assert row(text, "payload") == values
        assert row(text, "residual radius, angular")[1] == "–"


def tables_of_many() -> dict:
    cell = planar(4, 4, "planar-linear", world={"gravity": [0.0, -9.81]})
    for arm in cell["arms"]:
        arm["torque_limits"] = [30.0] * 4
    return cell


@cache
def drawn(*case: str) -> bytes:
    return picture(known(*case), "png")


def size(png: bytes) -> tuple[int, ...]:
    return imread(io.BytesIO(png)).shape


def with_sets(solution: Solution, **keys: object) -> Solution:
    """With every exact set changed alike."""
    records = solution.after.exact_sets.items()
    sets = {name: each.model_copy(update=keys) for name, each in records}
    return changed(solution, exact_sets=sets)


PICTURES = [
    ("spatial",), ("spatial-linear",), ("planar",), ("planar-linear",),
    ("spatial", "y", "x"), ("spatial", "z", "yaw", "pitch"), ("planar", "angle"),
]  # fmt: skip


class TestPictures:
    """Warnings are errors; the same result is the same picture."""

    @pytest.mark.parametrize("case", PICTURES, ids="-".join)
    def test_exact_sets_are_drawn(self, case: tuple[str, ...]) -> None:
        solution = known(*case)
        name, record = next(iter(solution.after.exact_sets.items()))
        # Those that the limits of the axes depend on stay.
        corners = np.array(record.vertices)
        kept = np.unique([corners.argmin(axis=0), corners.argmax(axis=0)])
        fewer = (corners[kept] if len(record.axes) > 1 else 1.1 * corners).tolist()
        others = solution.after.exact_sets | {name: record.model_copy(update={"vertices": fewer})}
        assert picture(changed(solution, exact_sets=others), "png") != drawn(*case)

    @pytest.mark.parametrize("space", ["spatial", "planar"])
    def test_pictures_are_the_same_every_time_and_larger_than_others(self, space: str) -> None:
        solution = known(space)
        assert picture(solution, "png") == drawn(space)
        bare = size(picture(changed(solution, exact_sets=None, static_torque=None), "png"))
        assert all(np.array(size(drawn(space)))[:2] > bare[:2])

    def test_what_is_drawn_is_named(self) -> None:
        solution = known("planar-linear")
        (record,) = solution.after.exact_sets.values()
        text = picture(solution, "svg").decode()
        for words in (
            f"ball of radius {three(record.residual_radius)} around rest",
            "exact set of linear accelerations, m/s²", "x, m/s²", "centre: zero torque",
            "joint torque that holds the object, % of its limit", "contact forces holding it",
        ):  # fmt: skip
            assert words in text
        assert "others zero" not in text
        for share in solution.after.static_torque["a1"]:
            assert f">{100 * share:.1f}<" in text

    def test_shares_over_the_limit_are_red(self) -> None:
        solution = known("planar-linear")
        shares = {"a1": (0.5, 1.3, 0.1, 0.1), "a2": (0.2,) * 4}
        drawn = picture(changed(solution, static_torque=shares), "svg").decode()
        (style_of,) = re.findall(r'<text style="([^"]*)"[^>]*>130\.0<', drawn)
        (plain,) = re.findall(r'<text style="([^"]*)"[^>]*>50\.0<', drawn)
        assert LOOK.over.lower() in style_of and LOOK.over.lower() not in plain

    @pytest.mark.parametrize("space", ["spatial", "planar"])
    def test_sets_that_are_empty_flat_or_without_rest(self, space: str) -> None:
        solution = known(space)
        nothing = {"vertices": (), "ellipsoid": EllipsoidRecord.of(None), "residual_radius": 0.0}
        empty = picture(with_sets(solution, **nothing), "svg").decode()
        assert empty.count("others zero; none is within the torque limits") == 2
        assert "x, m/s²" in picture(solution, "svg").decode() and "x, m/s²" not in empty
        outside = picture(with_sets(solution, residual_radius=0.0), "svg").decode()
        assert outside.count("rest is outside") == 2 and "ball around rest" not in outside
        if space == "spatial":
            flat = [(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
            assert picture(with_sets(solution, vertices=flat), "png") != drawn(space)

    def test_a_miss_shows_nothing_of_limits(self) -> None:
        cell = limited("planar")
        for arm in cell["arms"]:
            arm["start"] = [0.1, 0.2, 0.3, 0.4]
        missed = copose.evaluate(parse(cell))
        assert missed.nearest_miss.exact_sets and missed.nearest_miss.static_torque
        keys = {"exact_sets": None, "static_torque": None}
        bare = {"nearest_miss": missed.nearest_miss.model_copy(update=keys)}
        assert picture(missed, "png") == picture(missed.model_copy(update=bare), "png")

    @pytest.mark.parametrize("space", ["spatial", "planar"])
    def test_before_and_after_have_shares_where_asked(self, space: str) -> None:
        solution = known(space)
        both = compared(solution)
        text = picture(both, "svg").decode()
        assert "joint torque that holds" in text and "exact set" not in text
        nothing = {"static_torque": None}
        plain = compared(changed(solution, **nothing), solution.after.model_copy(update=nothing))
        assert "joint torque that holds" not in picture(plain, "svg").decode()
        assert size(picture(both, "png"))[0] > size(picture(plain, "png"))[0]


class TestParts:
    """Arrows, balls and coordinates are where they should be."""

    @pytest.mark.parametrize("space", ["spatial", "planar-linear"])
    def test_arrows_push_at_the_grasps(self, space: str) -> None:
        posture = known(space).after
        arrows, words = holding_arrows(posture, 2.0)
        d = len(posture.object.position)
        forces = [np.array(each.wrench[:d]) for each in posture.wrenches["hold"].values()]
        largest = max(map(np.linalg.norm, forces))
        for (tail, head), force, arm in zip(arrows, forces, posture.arms.values(), strict=True):
            assert np.allclose(head, arm.grasp[:d])
            assert np.allclose(head - tail, 0.32 * force / largest)
        assert words.endswith(f"up to {three(largest)} N")
        assert holding_arrows(posture.model_copy(update={"wrenches": None}), 2.0) == ([], "")

    @pytest.mark.parametrize("space", ["spatial-linear", "planar-linear"])
    def test_ball_rest_and_centre(self, space: str) -> None:
        (shown,) = set_pictures(result_panels(known(space)))
        figure = Figure()
        draw_set(figure, figure.add_gridspec(1, 1)[0, 0], shown, columns=2)
        (ax,) = figure.axes
        lines = {
            line.get_label(): np.array(line.get_data_3d() if shown.solid else line.get_data()).T
            for line in ax.lines
        }
        radius = shown.record.residual_radius
        assert np.allclose(np.linalg.norm(lines["largest ball around rest"], axis=1), radius)
        assert np.allclose(lines["rest"], 0)
        assert np.allclose(lines["centre: zero torque"], shown.record.ellipsoid.center)

    def test_axes_in_another_order(self) -> None:
        """Are drawn along those of the scene."""
        record = known().after.exact_sets["linear"]
        order = [2, 0, 1]
        moved = record.model_copy(
            update={
                "axes": tuple("xyz"[i] for i in order),
                "vertices": np.array(record.vertices)[:, order].tolist(),
                "ellipsoid": EllipsoidRecord.of(record.ellipsoid.value.sliced(order)),
            }
        )
        one, other = (SetPicture("linear", each, others=True) for each in (record, moved))
        assert one.names == other.names == ["x", "y", "z"]
        assert np.array_equal(one.corners, other.corners)
        assert np.allclose(one.ellipsoid.gram, other.ellipsoid.gram)
        assert np.allclose(one.ellipsoid.center, other.ellipsoid.center)


class TestSolids:
    """Faces of a hull, not its triangles."""

    cube = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T * [1.0, 2.0, 1e-6]

    def test_a_box(self) -> None:
        solid = Solid.of(np.vstack([self.cube, self.cube.mean(axis=0)]))
        assert len(solid.faces) == 6 and all(len(face) == 4 for face in solid.faces)
        assert len(solid.edges) == 12
        middle = self.cube.mean(axis=0)
        for face, normal in zip(solid.faces, solid.normals, strict=True):
            assert np.ptp(face @ normal) < 1e-12 and (face[0] - middle) @ normal > 0
            around = np.roll(face, -1, axis=0) - face
            assert np.all(np.cross(around, np.roll(around, -1, axis=0)) @ normal > 0)
        for edge, sides in zip(solid.edges, solid.sides, strict=True):
            assert np.abs((edge[1] - edge[0]) @ solid.normals[sides].T).max() < 1e-12
        assert len(solid.outline(np.eye(3)[:2])) == 4

    def test_flat_ones_are_none(self) -> None:
        assert Solid.of(self.cube * [1, 1, 0]) is None and Solid.of(self.cube[:3]) is None
