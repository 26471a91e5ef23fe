"""Motions that were made by hand: as trajectories, tables, pictures, films, and by the command."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from rich.console import Console

from cells import planar, toml
from copose.commands.command_line import main
from copose.errors import InputError
from copose.formats import joint_trajectory_yaml, trajectory_csv
from copose.report import draw, motion_animation, picture
from copose.report.figures.motion import motion_figure
from copose.report.joint_curves import limit_shares, spread
from copose.report.text import motion_table
from copose.results import (
    EllipsoidRecord,
    Motion,
    read_motion,
    to_json,
)

NOTHING = EllipsoidRecord.of(None).model_dump()
FREE = {"lower": None, "upper": None, "velocity": None, "acceleration": None, "torque": None}
LIMITED = {"lower": -2.0, "upper": 2.0, "velocity": 2.0, "acceleration": 40.0, "torque": 10.0}


def made(
    space: str = "planar",
    arms: int = 2,
    knots: int = 9,
    limits: tuple[dict, dict] = (LIMITED, LIMITED),
    **changes: object,
) -> Motion:
    """Arms of two joints that swing to and fro, the object between them; numbers that are known."""
    flat = space.startswith("planar")
    names = [f"arm {i}" for i in range(arms)]
    joints = {name: ["shoulder", "elbow"] for name in names}
    time = np.linspace(0.0, 1.0, knots)
    bend, speed = 1 - np.cos(np.pi * time), np.pi * np.sin(np.pi * time)
    rows = []
    for k in range(knots):
        tip = [0.1 * bend[k], 0.5] if flat else [0.1 * bend[k], 0.0, 0.5]
        bases = [(i - (arms - 1) / 2, 0.0) if flat else (i - (arms - 1) / 2, 0.2, 0.0)
                 for i in range(arms)]  # fmt: skip
        place = {"position": tip, "angle": 0.0}
        if not flat:
            place = {"position": tip, "quaternion": [1.0, 0.0, 0.0, 0.0]}
        solid = [[*point, 0.0] if flat else list(point) for point in (*bases, tip)]
        drawn = {
            name: {"skeleton": [solid[i], np.add(solid[i], 0.3).tolist(), solid[-1]],
                   "quaternions": [[1.0, 0.0, 0.0, 0.0]] * 3,
                   "grasp": solid[-1], "ellipsoid": NOTHING}
            for i, name in enumerate(names)
        }  # fmt: skip
        rows.append({
            "joints": {name: [bend[k], 1e-5 * (i + 1)] for i, name in enumerate(names)},
            "object": place, "closure_error": dict.fromkeys(names, 1e-12), "ellipsoid": NOTHING,
            "log_volumes": {"pseudoinverse": None, "torque-optimal": None},
            "arms": drawn, "objective": 1.0 + time[k],
            "velocity": {name: [speed[k], 0.0] for name in names},
            "acceleration": {name: [1.0, -2.0] for name in names},
            "torque": None if k == 2 else {name: [k, -1.0] for name in names},
        })  # fmt: skip
    motion = {
        "copose": "0", "status": "solved", "reason": None, "notes": ["gears are ignored"],
        "problem": {
            "name": "made", "space": space, "axes": ["x", "y"], "resolution": "pseudoinverse",
            "torque_scaling": "unit",
            "shape": {"kind": "box", "size": [0.2, 0.2] if flat else [0.2, 0.2, 0.2]},
            "obstacles": [
                {"name": "wall", "position": [0.45, 0.2], "angle": 0.1,
                 "shape": {"kind": "box", "size": [0.1, 0.3]}}
                if flat else
                {"name": "wall", "position": [0.45, 0.2, 0.4], "rpy": [0, 0, 0.1],
                 "shape": {"kind": "box", "size": [0.1, 0.3, 0.3]}}
            ],
        },
        "objective": {"kind": "volume", "unit": "log", "before": 1.0, "after": 1.5},
        "aggregate": "mean", "smoothness": 0.25, "duration": 1.0, "joint_names": joints,
        "limits": dict.fromkeys(names, limits), "time": time.tolist(),
        "knots": rows, "between_knots_error": 3e-5,
        "least_norm": {"objective": [1.0] * knots, "reason": None},
        "search": {
            "seed": 3, "layers": 9, "nodes": dict.fromkeys(names, 12), "combinations": 1234,
            "routes": [
                {"graph": 1.25, "value": 1.5, "status": "Solve_Succeeded"},
                {"graph": 1.125, "value": None, "status": "Infeasible_Problem_Detected"},
            ],
        },
        "timing": {"build_s": 0.1, "search_s": 0.2},
    }  # fmt: skip
    return read(motion | changes)


def read(data: dict) -> Motion:
    return Motion.model_validate_json(json.dumps(data))


def data_of(motion: Motion) -> dict:
    return json.loads(to_json(motion))


def nowhere(**changes: object) -> Motion:
    """What is left where no motion exists."""
    missing = dict.fromkeys(
        ("time", "knots", "duration", "smoothness", "between_knots_error", "least_norm", "search")
    )
    said = {"status": "infeasible", "reason": "arm 'arm 0' cannot reach its grasp at 0.5 s"}
    empty = {"kind": "volume", "unit": "log", "before": None, "after": None}
    return read(data_of(made()) | missing | said | {"objective": empty} | changes)


def failing(knots: int = 9, known: int = 4) -> dict:
    """Least-norm tracking that gets stuck."""
    values = [0.5] * known + [None] * (knots - known)
    objective = {"kind": "volume", "unit": "log", "before": None, "after": 1.0}
    tracking = {"objective": values, "reason": "arm 'arm 1': joint elbow is at its limit"}
    return {"least_norm": tracking, "objective": objective, "aggregate": "worst"}


def printed(motion: Motion) -> str:
    sink = io.StringIO()
    Console(file=sink, width=160, highlight=False).print(motion_table(motion, verbose=True))
    return sink.getvalue()


def words(motion: Motion) -> str:
    """All that a picture says."""
    drawn = picture(motion, "svg").decode()
    return "\n".join(re.findall(r"<text[^>]*>([^<]*)</text>", drawn))


def test_trajectories_are_tables_with_numbers_in_full() -> None:
    motion = made()
    header, *rows = csv.reader(io.StringIO(trajectory_csv(motion)))
    assert header == ["time", "arm 0/shoulder", "arm 0/elbow", "arm 1/shoulder", "arm 1/elbow"]
    assert motion.time is not None and motion.knots is not None
    for row, time, knot in zip(rows, motion.time, motion.knots, strict=True):
        assert list(map(float, row)) == [time, *knot.joints["arm 0"], *knot.joints["arm 1"]]


def test_ros_reads_the_trajectory() -> None:
    motion = made()
    told = yaml.safe_load(joint_trajectory_yaml(motion))
    assert told["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert told["joint_names"] == [f"arm {i}_{joint}" for i in (0, 1)
                                   for joint in ("shoulder", "elbow")]  # fmt: skip
    assert motion.time is not None and motion.knots is not None
    for k, (point, knot) in enumerate(zip(told["points"], motion.knots, strict=True)):
        assert point["positions"] == [x for q in knot.joints.values() for x in q]
        assert point["velocities"] == [x for q in knot.velocity.values() for x in q]
        assert point["accelerations"] == [1.0, -2.0, 1.0, -2.0]
        assert point["effort"] == ([] if k == 2 else [k, -1.0, k, -1.0])
        assert all(isinstance(x, float) for x in point["positions"])
        since = point["time_from_start"]
        assert since["sec"] + since["nanosec"] / 1e9 == pytest.approx(motion.time[k], abs=1e-9)
        assert 0 <= since["nanosec"] < 10**9
    assert told["points"][-1]["time_from_start"] == {"sec": 1, "nanosec": 0}


def test_ros_knows_joints_by_the_urdfs_names_where_they_differ() -> None:
    names = {"arm 0": ["a", 'b"\\: é'], "arm 1": ["c", "#d\U0001f916\x7f"]}
    told = yaml.safe_load(joint_trajectory_yaml(made(joint_names=names)))
    assert told["joint_names"] == [*names["arm 0"], *names["arm 1"]]


@pytest.mark.parametrize("write", [trajectory_csv, joint_trajectory_yaml])
def test_where_nothing_moves_there_is_no_trajectory(write) -> None:
    with pytest.raises(InputError, match="cannot reach its grasp"):
        write(nowhere())


def test_shares_of_limits_are_the_largest_over_the_joints() -> None:
    speed, acceleration, torque = limit_shares(made(knots=9))
    assert speed.largest == (pytest.approx(math.pi / 2), "arm 0/shoulder", 0.5)
    # Between knots the mean speed counts: it is a chord of the cosine.
    assert len(speed.time) == 17 and np.all(np.diff(speed.time) > 0)
    chord = (math.cos(0.5 * math.pi - math.pi / 8) - math.cos(0.5 * math.pi)) / 0.125 / 2.0
    assert speed.values[7] == pytest.approx(chord)
    assert acceleration.largest == (pytest.approx(0.05), "arm 0/elbow", 0.0)
    assert torque.largest == (0.8, "arm 0/shoulder", 1.0) and np.isnan(torque.values[2])
    assert limit_shares(made(limits=(FREE, FREE))) == []


def test_a_joint_that_may_not_move_has_no_share() -> None:
    assert limit_shares(made(limits=(FREE | {"velocity": 0.0}, FREE))) == []


def test_the_table_says_what_a_reader_asks_for() -> None:
    text = printed(made(collision=0.0123, reachable_from_start=False))
    for expected in (
        "made: solved", "mean log-volume", "1.000000", "1.500000", "area ×1.65", "worst log-volume",
        "9 knots", "0.250", "1.0e-12", "3.0e-05", "m, rad, between knots", "157.1",
        "% of arm 0/shoulder's limit at 0.500 s",
        "80.0", "0.0123", "reachable from the start", "9 layers of 12 × 12 postures, 1,234 comb",
        "1.250000 in the graph, 1.500000 as a motion", "seed 3", "the best of 2 routes",
        "1.125000 in the graph, failed, Infeasible_Problem_Detected as a motion",
        "note: gears are ignored",
    ):  # fmt: skip
        assert expected in text, expected


def test_the_table_of_tracking_that_fails_and_of_no_limits() -> None:
    text = printed(made(limits=(FREE, FREE), **failing()))
    assert "fails after 0.375 s" in text and "joint elbow is at its limit" in text
    assert "largest" not in text and "reachable" not in text
    assert "fails at once" in printed(made(**failing(known=0)))


def test_the_table_says_why_planning_gains_nothing() -> None:
    same = {"kind": "volume", "unit": "log", "before": 1.5, "after": 1.5}
    why = "no arm has a joint to spare"
    assert why in printed(made(objective=same)) and why not in printed(made())


def test_the_table_of_no_motion_is_its_reason() -> None:
    text = printed(nowhere())
    assert "made: infeasible: arm 'arm 0' cannot reach its grasp at 0.5 s" in text
    assert "planned" not in text and "built in 0.10 s" in text


@pytest.mark.parametrize("space", ["planar", "planar-linear", "spatial", "spatial-linear"])
@pytest.mark.parametrize("arms", [1, 2, 8])
def test_pictures_name_everything(space: str, arms: int) -> None:
    said = words(made(space, arms))
    for i in range(arms):
        assert f"arm arm {i}" in said and f"joints of arm arm {i}" in said
    for expected in (
        "made: area ×1.65 on average, against least-norm tracking", "time, s",
        "light to dark: at 0, ", "least-norm tracking: mean 1.00", "planned: mean 1.50",
        "share of range", "speed: up to 157.1 %", "torque: up to 80.0 %",
    ):  # fmt: skip
        assert expected in said, expected


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_obstacles_near_the_motion_are_in_the_scene(space: str) -> None:
    scene, *charts = motion_figure(made(space)).axes
    assert [text.get_text() for text in scene.texts] == ["wall"]
    assert all(text.get_text() != "wall" for chart in charts for text in chart.texts)


def test_pictures_of_what_is_missing() -> None:
    some = LIMITED | {"lower": None, "velocity": None, "acceleration": None, "torque": None}
    said = words(made(limits=(some, some), **failing()))
    assert "made: worst log-volume 1.00; least-norm tracking fails after 0.375 s" in said
    assert "least-norm tracking: fails after 0.375 s" in said and "planned: worst 1.00" in said
    assert "rad or m" in said and "share of" not in said
    assert "share of range; dashed: turns" in words(made("spatial", limits=(LIMITED, FREE)))
    assert "least-norm tracking: fails at once" in words(made(**failing(known=0)))
    assert "planned" in words(made(least_norm=None, search=None))


def test_pictures_of_objectives_that_do_not_exist() -> None:
    data = data_of(made())
    for knot in data["knots"]:
        knot["objective"] = None
    data["objective"] = {"kind": "acceleration", "unit": "m/s²", "before": None, "after": None}
    motion = read(data | {"aggregate": "worst", "least_norm": None})
    assert "made: worst acceleration – m/s²" in words(motion)
    assert len(film_frames(motion)) > 1


def test_two_knots_and_still_objects_are_drawn() -> None:
    data = data_of(made("spatial", knots=2))
    for knot in data["knots"]:
        knot["object"] = data["knots"][0]["object"]
    motion = read(data)
    assert picture(motion, "png").startswith(b"\x89PNG")
    assert len(film_frames(motion)) == 2


def test_pictures_are_the_same_every_time(tmp_path: Path) -> None:
    motion = made("spatial")
    for kind in ("png", "pdf", "svg"):
        assert picture(motion, kind) == picture(motion, kind)
    draw(motion, tmp_path / "way.png")
    assert (tmp_path / "way.png").read_bytes() == picture(motion, "png")
    with pytest.raises(InputError, match="no motion to draw: arm 'arm 0'"):
        draw(nowhere(), tmp_path / "none.png")


def film_frames(motion: Motion) -> list[float]:
    """How long each frame of a film is shown, s."""
    with Image.open(io.BytesIO(motion_animation(motion))) as image:
        shown = []
        for k in range(image.n_frames):
            image.seek(k)
            shown.append(image.info["duration"] / 1000)
        return shown


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_films_last_as_long_as_the_motion(space: str) -> None:
    shown = film_frames(made(space, knots=21))
    assert len(shown) == 21 and sum(shown[:-1]) == pytest.approx(1.0, rel=0.05)
    assert shown[-1] > 0.5


def test_films_of_many_knots_leave_some_out() -> None:
    assert len(film_frames(made(knots=120))) == 25


def test_labels_keep_apart_and_in_order() -> None:
    wanted = np.array([0.0, 0.5, 0.5, 0.51, 0.9])
    placed = spread(wanted, 0.1)
    assert np.all(np.diff(placed) > 0.1 - 1e-12)
    assert placed[0] == 0.0 and placed[-1] == pytest.approx(0.9)
    assert placed[1:4].mean() == pytest.approx(wanted[1:4].mean())


@pytest.fixture
def answer(tmp_path: Path, monkeypatch) -> dict:
    """The command in a folder of its own, with a planner that answers what it is told to."""
    told: dict = {"motion": made()}

    def plan(problem, *, seed=None, time_limit=None) -> Motion:
        told.update(problem=problem.name, seed=seed)
        return told["motion"]

    monkeypatch.setitem(sys.modules, "copose.motion", types.SimpleNamespace(plan=plan))
    monkeypatch.chdir(tmp_path)
    Path("p.toml").write_text(toml(planar(name="my cell")))
    return told


def names(folder: str) -> list[str]:
    return sorted(path.name for path in Path(folder).iterdir())


def test_the_command_writes_what_it_is_asked_for(answer: dict, capsys) -> None:
    assert main(["path", "p.toml", "--seed", "7"]) == 0
    assert answer["seed"] == 7 and answer["problem"] == "my cell"
    assert names("my cell") == ["path.png", "result.json", "trajectory.csv"]
    out, err = capsys.readouterr()
    assert "made: solved" in out and "written to my cell" in out and err == ""
    assert read_motion("my cell/result.json") == answer["motion"]
    assert Path("my cell/trajectory.csv").read_text() == trajectory_csv(answer["motion"])

    more = ["--ros", "--animate", "--figure", "more.svg", "--json"]
    assert main(["path", "p.toml", "-o", "out", *more]) == 0
    assert names("out") == [
        "path.gif", "path.png", "result.json", "trajectory.csv", "trajectory.yaml",
    ]  # fmt: skip
    assert Path("more.svg").read_text().startswith("<?xml")
    assert Path("out/path.gif").read_bytes().startswith(b"GIF89a")
    out, err = capsys.readouterr()
    assert out == Path("out/result.json").read_text() == to_json(answer["motion"]) and err == ""

    # What an earlier run was asked for would contradict this one's result.
    assert main(["path", "p.toml", "-o", "out", "--quiet"]) == 0
    assert names("out") == ["path.png", "result.json", "trajectory.csv"]
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(("status", "code"), [("infeasible", 3), ("failed", 4)])
def test_the_command_where_nothing_moves(answer: dict, status: str, code: int, capsys) -> None:
    assert main(["path", "p.toml", "-o", "out", "--ros", "--animate", "--quiet"]) == 0
    answer["motion"] = nowhere(status=status)
    assert main(["path", "p.toml", "-o", "out", "--ros", "--figure", "f.png", "--quiet"]) == code
    assert names("out") == ["result.json"] and not Path("f.png").exists()
    assert json.loads(Path("out/result.json").read_text())["knots"] is None
    out, err = capsys.readouterr()
    assert out == "" and err.startswith(f"copose: {status}: arm 'arm 0' cannot reach")


@pytest.mark.parametrize("blocked", ["result.json", "trajectory.csv", "path.png"])
def test_the_command_looks_at_places_before_it_plans(answer: dict, blocked: str, capsys) -> None:
    Path("out", blocked).mkdir(parents=True)
    assert main(["path", "p.toml", "-o", "out"]) == 2
    assert "problem" not in answer and names("out") == [blocked]
    assert "is a folder" in capsys.readouterr().err
    Path("more/path.gif").mkdir(parents=True)
    assert main(["path", "p.toml", "-o", "more"]) == 0
    assert main(["path", "p.toml", "-o", "more", "--animate"]) == 2
