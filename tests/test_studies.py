"""Studies: points, hashes, the record that survives, and tables, each against another way there."""

from __future__ import annotations

import itertools
import json
import math
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import qmc

import copose
from cells import tables, toml
from copose.batch.plain_loop import CrashLog, loop_lines
from copose.batch.point_solver import PointSolver, Recipe, points_of
from copose.commands.command_line import main
from copose.errors import InputError
from copose.progress import StoppedError, watched
from copose.robots.files.file_paths import resolve
from copose.studies import Study, StudyFolder, StudyTable
from copose.studies.points.points import Point, Points
from copose.studies.record import StudyRecord, lines_of
from copose.studies.study_file import parse_study
from reference import PROBLEMS
from study_files import lines, run, study_text, written

RANGE = {"key": "object.mass", "from": 0.1, "to": 0.5}
LIST = {"key": "objective.kind", "values": ["volume", "isotropy"]}
ROWS = {"keys": ["object.position.x", "seed.x"], "values": [[0.1, 1], [0.2, 2], [0.3, 3]]}


def points(**extra: object) -> Points:
    data = {"format": 1, "name": "s", "problem": "p.toml", **extra}
    return Points(parse_study(data, Path("s.toml")))


def test_a_grid_is_the_product_of_all_values_and_seeds() -> None:
    grid = points(vary=[{**RANGE, "steps": 5}, LIST, ROWS], seeds=[3, 4])
    masses = [0.1, 0.2, 0.3, 0.4, 0.5]
    product = itertools.product(masses, LIST["values"], ROWS["values"], [3, 4])
    assert len(grid) == 5 * 2 * 3 * 2
    for point, (mass, kind, row, seed) in enumerate(product):
        assert grid.values(point) == {
            "object.mass": mass,
            "objective.kind": kind,
            "object.position.x": row[0],
            "seed.x": row[1],
        }
        assert grid.seed(point) == seed


@pytest.mark.parametrize("method", ["sobol", "latin-hypercube", "random"])
def test_a_sample_fills_ranges_and_lists(method: str) -> None:
    sample = {"method": method, "count": 100, "seed": 7}
    drawn = points(vary=[RANGE, LIST, ROWS], sample=sample)
    values = [drawn.values(i) for i in range(len(drawn))]
    masses = np.array([value["object.mass"] for value in values])
    assert len(values) == 100 and masses.min() >= 0.1 and masses.max() <= 0.5
    assert {value["objective.kind"] for value in values} == {"volume", "isotropy"}
    rows = {(value["object.position.x"], value["seed.x"]) for value in values}
    assert rows == {(0.1, 1), (0.2, 2), (0.3, 3)}
    if method == "latin-hypercube":
        strata = np.floor((masses - 0.1) / 0.4 * 100 + 1e-9).astype(int)
        assert sorted(strata.tolist()) == list(range(100))
    if method == "sobol":
        unit = qmc.Sobol(3, seed=np.random.default_rng(7)).random_base2(7)[:100]
        assert masses == pytest.approx(0.1 + 0.4 * unit[:, 0], abs=1e-12)


@given(st.integers(2, 400), st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
@settings(max_examples=50, deadline=None)
def test_a_range_has_both_ends(steps: int, lower: float, width: float) -> None:
    grid = points(vary=[{"key": "object.mass", "from": lower, "to": lower + width, "steps": steps}])
    values = [grid.values(i)["object.mass"] for i in range(len(grid))]
    assert len(values) == steps
    assert values == pytest.approx(np.linspace(lower, lower + width, steps), abs=1e-8)
    assert values == sorted(values)


def hashes(folder: Path, text: str) -> list[str]:
    study = Study.read(written(folder, text))
    return [point.point_hash.hex() for point in points_of(study, range(len(study.points)))]


def test_the_hash_is_of_what_decides_a_point(tmp_path: Path) -> None:
    base = hashes(tmp_path, study_text())
    assert len(set(base)) == 5
    wider = {**RANGE, "to": 0.9, "steps": 9}
    assert hashes(tmp_path, study_text(vary=[wider], name="other"))[:5] == base
    for change in (
        {"effort": "low"},
        {"command": "solve"},
        {"record": ["after.ellipsoid.log_volume"]},
        {"seeds": [1]},
        {"set": ["object.shape.radius=0.16"]},
        {"vary": [{**RANGE, "from": 0.11, "to": 0.51, "steps": 5}]},
    ):
        assert not set(hashes(tmp_path, study_text(**change))) & set(base), change


def test_the_hash_is_of_the_robots_contents(tmp_path: Path) -> None:
    cell = tables("two-panda-box")
    panda = resolve(cell["arms"][0]["urdf"], tmp_path, {}).read_text()
    problem = tmp_path / "p.toml"
    for arm in cell["arms"]:
        arm["urdf"] = "panda.urdf"
    problem.write_text(toml(cell))
    (tmp_path / "panda.urdf").write_text(panda)
    before = hashes(tmp_path, study_text(problem, command="solve"))
    assert hashes(tmp_path, study_text(problem, command="solve")) == before
    (tmp_path / "panda.urdf").write_text(panda.replace("87", "86", 1))
    assert not set(hashes(tmp_path, study_text(problem, command="solve"))) & set(before)


def test_a_line_is_what_solving_its_problem_gives(tmp_path: Path) -> None:
    vary = [
        {"key": "object.position.x", "values": [0.45, 0.5, 1.6]},
        {"key": "arms.a2.base.position.y", "values": [0.0, 0.1]},
    ]
    record = ["after.ellipsoid.radii.0", "search.starts", "objective.before"]
    text = study_text(command="solve", effort="low", vary=vary, record=record, seeds=[0, 5])
    table = run(written(tmp_path, text), tmp_path / "out")
    assert len(table) == 12 and set(table.statuses) == {"solved", "infeasible"}
    for point in range(len(table)):
        line, values = table.line(point), table.values(point)
        assert line is not None and line["values"] == values
        problem = copose.load(PROBLEMS / "paper-fig2.toml", set=values)
        solution = copose.solve(problem, effort="low", seed=line["seed"])
        assert line["status"] == solution.status
        if solution.after is None:
            assert line["objective"] is None and line["joints"] is None
            assert line["record"]["after.ellipsoid.radii.0"] is None
            assert line["missing"] == ["a1"] or "a1" in line["missing"]
            continue
        assert line["objective"] == pytest.approx(solution.objective.after, abs=1e-9)
        assert line["record"]["objective.before"] == pytest.approx(
            solution.objective.before, abs=1e-9
        )
        measured = copose.evaluate(problem, line["joints"])
        assert measured.objective.after == pytest.approx(line["objective"], abs=1e-12)
        assert measured.after is not None and measured.after.ellipsoid.radii is not None
        radius = line["record"]["after.ellipsoid.radii.0"]
        assert radius == pytest.approx(measured.after.ellipsoid.radii[0], rel=1e-12)


def test_a_line_depends_on_its_point_alone(tmp_path: Path) -> None:
    vary = [
        {"key": "object.position.x", "values": [0.45, 0.5, 0.55, 1.6]},
        {"key": "object.mass", "values": [0.05, 2.0]},
    ]
    text = study_text(command="solve", effort="low", vary=vary)
    study = Study.read(written(tmp_path, text))
    every = list(points_of(study, range(len(study.points))))

    def texts(order: list[int]) -> dict[int, str]:
        solver = PointSolver(Recipe.of(study))
        found = {i: json.loads(solver.line(every[i]).text) for i in order}
        return {i: json.dumps({**line, "seconds": 0}) for i, line in found.items()}

    forward = texts(list(range(8)))
    assert texts([5, 1, 7, 0, 3, 2, 6, 4]) == forward
    assert texts([3]) == {3: forward[3]}


def test_what_is_missing_is_done_and_nothing_twice(tmp_path: Path) -> None:
    file, out = written(tmp_path, study_text()), tmp_path / "out"
    whole = lines(run(file, out))
    record = out / "study.jsonl"
    kept = record.read_bytes().splitlines(keepends=True)
    # Without the second line, with a torn last one, and with a line of another program.
    record.write_bytes(b"".join([kept[0], kept[2], b"hello\n", kept[3], kept[4][:40]]))
    assert lines(run(file, out)) == whole
    again = record.read_bytes().splitlines(keepends=True)
    assert len(again) == 6 and again[:4] == [kept[0], kept[2], b"hello\n", kept[3]]
    assert lines(run(file, out)) == whole and len(record.read_bytes().splitlines()) == 6
    wider = written(tmp_path, study_text(vary=[{**RANGE, "to": 0.6, "steps": 6}]), "wider.toml")
    assert len(run(wider, out)) == 6 and len(record.read_bytes().splitlines()) == 7
    # Lines of the wider study stay, and are not of this one.
    assert lines(run(file, out)) == whole


def test_points_with_equal_values_are_one(tmp_path: Path) -> None:
    vary = [{"key": "object.mass", "values": [0.1, 0.2, 0.1]}]
    table = run(written(tmp_path, study_text(vary=vary)), tmp_path / "out")
    assert len(table) == 3 and len((tmp_path / "out/study.jsonl").read_text().splitlines()) == 2
    assert table.numbers["objective"][0] == table.numbers["objective"][2]


def test_a_record_has_one_writer(tmp_path: Path) -> None:
    with StudyRecord(tmp_path / "r.jsonl"), pytest.raises(InputError, match="another process"):
        StudyRecord(tmp_path / "r.jsonl")
    with StudyRecord(tmp_path / "r.jsonl"):
        pass


def test_a_full_disk_leaves_whole_lines(tmp_path: Path) -> None:
    """A limit on the size of files is to a writer what a full disk is."""
    file = tmp_path / "r.jsonl"
    line = '{"point": 0, "hash": "' + "0" * 32 + '"}'
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        with StudyRecord(file) as record:
            record.append(line)
            resource.setrlimit(resource.RLIMIT_FSIZE, (len(line) + 20, before[1]))
            with pytest.raises(InputError, match="cannot be written"):
                record.append(line)
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
            assert file.read_text() == line + "\n"
            record.append(line)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert file.read_text() == f"{line}\n{line}\n"
    assert [offset for _, offset in lines_of(file)] == [0, len(line) + 1]


def test_a_point_over_its_limit_says_so_and_is_done_again_when_asked(tmp_path: Path) -> None:
    text = study_text(command="solve", vary=[{"key": "object.mass", "values": [0.1, 0.2]}])
    file, out = written(tmp_path, text), tmp_path / "out"
    late = run(file, out, point_limit=1e-6)
    assert late.statuses == ("failed", "failed")
    assert "limit of 1e-06 s" in lines(late)[0]["reason"]
    assert run(file, out).statuses == ("failed", "failed")
    assert run(file, out, retry=True).statuses == ("solved", "solved")


def test_the_limit_is_of_a_point_whatever_is_around(tmp_path: Path) -> None:
    file = written(tmp_path, study_text(command="solve", effort="low"))
    with watched(began=time.perf_counter() - 1000):
        assert set(run(file, tmp_path / "solved", point_limit=60.0).statuses) == {"solved"}
    measured = run(written(tmp_path, study_text()), tmp_path / "out", point_limit=1e-9)
    assert set(measured.statuses) == {"failed"}
    assert {line["reason"] for line in lines(measured)} == {
        "stopped by the limit of 1e-09 s a point"
    }
    with pytest.raises(StoppedError), watched(limit=1e-9):
        list(loop_lines(*parts(file, tmp_path / "crashes")))


def parts(file: Path, crashes: Path) -> tuple[Recipe, list[Point], CrashLog]:
    study = Study.read(file)
    return Recipe.of(study), list(points_of(study, range(3))), CrashLog(crashes)


def test_only_a_process_that_dies_counts_as_a_crash(tmp_path: Path) -> None:
    _, (point, *_), log = parts(written(tmp_path, study_text()), tmp_path / "crashes")
    with pytest.raises(StoppedError), log, log.solving(point):
        raise StoppedError("interrupted")
    assert not (tmp_path / "crashes").exists()
    log, entered = CrashLog(tmp_path / "crashes"), []
    for times in (1, 2):
        # Never left again, as by a process that dies.
        entered.append(log.solving(point))
        entered[-1].__enter__()
        log = CrashLog(tmp_path / "crashes")
        assert log.times(point) == times


def test_a_folder_shows_what_it_was_made_with(tmp_path: Path, monkeypatch, capsys) -> None:
    file, out = written(tmp_path, study_text()), tmp_path / "out"
    run(file, out)
    monkeypatch.setattr("copose.studies.points.hashes.__version__", "9.9.9")
    assert main(["study", str(out)]) == 0
    assert "5 points: 5 solved" in capsys.readouterr().out
    assert set(StudyTable.of(Study.read(file), StudyFolder(out)).statuses) == {"missing"}
    for option in (["--workers", "2"], ["--retry"], ["--point-limit", "1"], ["-o", "q"]):
        assert main(["study", str(out), *option]) == 2
        assert "a folder is only shown" in capsys.readouterr().err


def test_wrong_input_leaves_a_folder_as_it_was(tmp_path: Path, capsys) -> None:
    file, out = written(tmp_path, study_text()), tmp_path / "out"
    wrong = ["study", str(file), "-o", str(out), "--scheduler", "nonsense"]
    assert main(wrong) == 2 and not out.exists()
    assert main(["study", str(file), "-o", str(out), "--quiet"]) == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    written(tmp_path, study_text(vary=[{**RANGE, "steps": 9}]))
    assert main(wrong) == 2
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert capsys.readouterr().err.count("\n") == 2


def test_a_second_command_leaves_the_first_ones_record(tmp_path: Path, capsys) -> None:
    file, out = written(tmp_path, study_text()), tmp_path / "out"
    with StudyRecord(out / "study.jsonl"):
        assert main(["study", str(file), "-o", str(out)]) == 2
        assert [path.name for path in out.iterdir()] == ["study.jsonl"]
    assert "another process is writing" in capsys.readouterr().err


def test_a_folder_is_of_the_study_that_wrote_last(tmp_path: Path, monkeypatch) -> None:
    """Where a run fails, too, once it has written a line."""
    run(written(tmp_path, study_text()), tmp_path / "out")
    wider = written(tmp_path, study_text(vary=[{**RANGE, "to": 0.9, "steps": 9}]))
    append, left = StudyRecord.append, [2]

    def until_full(record: StudyRecord, line: str) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise InputError("cannot be written: No space left on device")
        append(record, line)

    monkeypatch.setattr(StudyRecord, "append", until_full)
    with pytest.raises(InputError, match="No space left"):
        run(wider, tmp_path / "out")
    folder = StudyFolder(tmp_path / "out")
    assert StudyTable.of(folder.study(), folder).statuses == ("solved",) * 7 + ("missing",) * 2


@pytest.mark.parametrize(
    "change",
    [('"missing": []', '"missing": 3'), ('"record"', '"recrod"'), ('{"point"', '{{"point"')],
)
def test_a_damaged_line_is_named(tmp_path: Path, change: tuple[str, str], capsys) -> None:
    file, out = written(tmp_path, study_text()), tmp_path / "out"
    run(file, out)
    record = (out / "study.jsonl").read_text().splitlines(keepends=True)
    (out / "study.jsonl").write_text("".join([record[0], record[1].replace(*change), *record[2:]]))
    assert main(["study", str(out)]) == 2
    assert "study.jsonl: line 2 is damaged" in capsys.readouterr().err


COMMAND = [sys.executable, "-m", "copose", "study"]
# Of which the process dies, as of a fault in a library.
FATAL = """
import os, sys
from copose.posture import Planner
evaluate = Planner.evaluate
def fatal(self, joints, *, problem, **options):
    if problem.object.mass == 0.2:
        os._exit(11)
    return evaluate(self, joints, problem=problem, **options)
Planner.evaluate = fatal
from copose.commands.command_line import main
sys.exit(main(["study", *sys.argv[1:]]))
"""


def test_a_point_that_its_process_dies_of_twice_is_a_line(tmp_path: Path) -> None:
    file, out = written(tmp_path, study_text()), tmp_path / "out"
    command = [sys.executable, "-c", FATAL, str(file), "-o", str(out), "--quiet"]
    codes = [subprocess.run(command, timeout=120).returncode for _ in range(3)]
    assert codes == [11, 11, 0]
    study = Study.read(file)
    table = StudyTable.of(study, StudyFolder(out))
    assert table.statuses == ("solved", "failed", "solved", "solved", "solved")
    line = table.line(1)
    assert line is not None and line["reason"] == "its process died twice"
    assert sorted(path.name for path in out.iterdir()) == [
        "map.png", "study.json", "study.jsonl", "study.parquet",
    ]  # fmt: skip
    assert run(file, out).statuses[1] == "failed"
    assert run(file, out, retry=True).statuses == ("solved",) * 5


@pytest.mark.parametrize("kills", [2, pytest.param(20, marks=pytest.mark.long)])
def test_killed_at_random_times_nothing_is_lost_or_done_twice(tmp_path: Path, kills: int) -> None:
    vary = [{"key": "object.mass", "from": 0.1, "to": 2.0, "steps": 50 * kills}]
    file = written(tmp_path, study_text(command="solve", effort="low", vary=vary))
    rng = random.Random(kills)
    for _ in range(kills):
        process = subprocess.Popen([*COMMAND, str(file), "-o", str(tmp_path / "out"), "--quiet"])
        time.sleep(rng.uniform(0.5, 2.5))
        process.kill()
        process.wait()
    table = run(file, tmp_path / "out")
    record = (tmp_path / "out/study.jsonl").read_text().splitlines()
    points_done = [json.loads(line)["point"] for line in record]
    assert sorted(points_done) == list(range(50 * kills))
    assert set(table.statuses) == {"solved"}
    if kills == 2:
        assert lines(table) == lines(run(file, tmp_path / "whole"))


def test_an_interrupted_study_says_how_to_go_on(tmp_path: Path) -> None:
    vary = [{"key": "object.mass", "from": 0.1, "to": 2.0, "steps": 2000}]
    file = written(tmp_path, study_text(command="solve", vary=vary))
    out = tmp_path / "out"
    process = subprocess.Popen([*COMMAND, str(file), "-o", str(out)], stderr=subprocess.PIPE)
    while not (out / "study.jsonl").exists() or not (out / "study.jsonl").stat().st_size:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    done = len((out / "study.jsonl").read_text().splitlines())
    assert error.decode() == (
        f"copose: interrupted: {done} of 2000 points are in {out}/study.jsonl; the same command "
        "goes on\n"
    )
    assert len(pandas.read_parquet(out / "study.parquet").dropna(subset="seconds")) == done


def test_tables_say_what_the_lines_say(tmp_path: Path) -> None:
    vary = [
        {"key": "object.position.x", "values": [0.45, 0.5, 1.6]},
        {"key": "objective.kind", "values": ["volume", "isotropy"]},
    ]
    record = ["after.ellipsoid.radii.0"]
    text = study_text(command="solve", effort="low", vary=vary, record=record, seeds=[0, 1])
    file, out = written(tmp_path, text), tmp_path / "out"
    assert copose.run_study(file, out) == out
    frame, dataset = copose.read_study(out), copose.read_study(out, "xarray")
    written_frame = pandas.read_parquet(out / "study.parquet").set_index("point")
    assert list(frame.columns) == list(written_frame.columns)
    table = StudyTable.of(Study.read(file), StudyFolder(out))
    for point in range(len(table)):
        line = table.line(point)
        assert line is not None
        for row in (frame.loc[point], written_frame.loc[point]):
            for key, value in line["values"].items():
                assert row[key] == value
            assert row["status"] == line["status"] and row["hash"] == line["hash"]
            if line["objective"] is None:
                assert np.isnan(row["objective"]) and row["joints.a1"] is None
                continue
            assert row["objective"] == line["objective"]
            assert list(row["joints.a1"]) == line["joints"]["a1"]
        x, kind = line["values"]["object.position.x"], line["values"]["objective.kind"]
        cell = dataset.sel({"object.position.x": x, "objective.kind": kind, "seed": line["seed"]})
        assert str(cell["status"].item()) == line["status"]
        number = cell["after.ellipsoid.radii.0"].item()
        assert (None if np.isnan(number) else number) == line["record"][record[0]]


def test_objectives_of_several_kinds_have_no_best(tmp_path: Path) -> None:
    assert run(written(tmp_path, study_text(vary=[LIST])), tmp_path / "out").best(1) == []


def test_workers_are_a_scheduler_or_processes(tmp_path: Path, capsys) -> None:
    file = str(written(tmp_path, study_text()))
    both = ["--workers", "2", "--scheduler", "tcp://127.0.0.1:9"]
    assert main(["study", file, "-o", str(tmp_path / "out"), *both]) == 2
    assert "--workers: and --scheduler exclude each other" in capsys.readouterr().err


def test_the_best_are_different_places(tmp_path: Path) -> None:
    vary = [{"key": "object.position.x", "values": [0.45, 0.5, 0.55]}]
    text = study_text(command="solve", effort="low", vary=vary, seeds=[0, 1])
    table = run(written(tmp_path, text), tmp_path / "out")
    best = {}
    for point in range(6):
        x = table.values(point)["object.position.x"]
        best[x] = max(best.get(x, -math.inf), table.numbers["objective"][point])
    shown = [table.numbers["objective"][point] for point in table.best(9)]
    assert shown == sorted(best.values(), reverse=True)


def test_the_best_points_come_as_problem_files(tmp_path: Path, capsys) -> None:
    vary = [{"key": "object.position.x", "values": [0.45, 0.5, 0.55]}]
    file = written(tmp_path, study_text(command="solve", effort="low", vary=vary, seeds=[2]))
    out = tmp_path / "out"
    assert main(["study", str(file), "-o", str(out), "--best", "2", "--quiet"]) == 0
    objective = copose.read_study(out)["objective"].sort_values(ascending=False)
    assert len(list(out.glob("best-*.toml"))) == 2
    for place, value in enumerate(objective[:2], start=1):
        problem = copose.load(out / f"best-{place}.toml")
        solution = copose.solve(problem, effort="low")
        assert solution.objective.after == pytest.approx(value, abs=1e-9)
        assert solution.search is not None and solution.search.seed == 2
    assert main(["study", str(out), "--best", "1"]) == 0
    assert "best-1.toml" in capsys.readouterr().out
    assert [path.name for path in out.glob("best-*.toml")] == ["best-1.toml"]


def test_infinite_values_are_texts_in_lines(tmp_path: Path) -> None:
    limits = [[[-3.0, 3.0]] * 3, [[-math.inf, math.inf]] * 3]
    vary = [{"key": "arms.a1.position_limits", "values": limits}]
    table = run(written(tmp_path, study_text(vary=vary)), tmp_path / "out")
    assert table.statuses == ("solved", "solved")
    assert lines(table)[1]["values"] == {"arms.a1.position_limits": [["-inf", "inf"]] * 3}


WRONG = {
    "unknown key": ({"vary": [{"key": "object.mas", "values": [1.0]}]}, "vary[0].values[0]"),
    "unknown arm": ({"vary": [{"key": "arms.a3.base.angle", "values": [1.0]}]}, "'a3'"),
    "value": ({"vary": [{"key": "object.mass", "values": [1.0, -1.0]}]}, "vary[0].values[1]"),
    "range": ({"vary": [{**RANGE, "from": -0.1, "steps": 5}]}, "vary[0]"),
    "backwards": ({"vary": [{**RANGE, "to": 0.0, "steps": 5}]}, "vary[0].to"),
    "no steps": ({"vary": [RANGE]}, "vary[0].steps"),
    "steps of a sample": (
        {"vary": [{**RANGE, "steps": 3}], "sample": {"method": "sobol", "count": 4}},
        "vary[0].steps",
    ),
    "both": ({"vary": [{**RANGE, "values": [1.0]}]}, "vary[0]"),
    "row": ({"vary": [{"keys": ["object.mass", "name"], "values": [[1.0]]}]}, "values[0]"),
    "twice": ({"vary": [{**RANGE, "steps": 2}, {**RANGE, "steps": 3}]}, "twice"),
    "record": ({"record": ["after.ellipsoid.radi.0"]}, "did you mean 'radii'"),
    "record of many": ({"record": ["after.ellipsoid.radii"]}, "record[0]"),
    "map": ({"map": {"x": "object.position.x"}}, "map.x"),
    "map value": ({"map": {"value": "after.payload"}}, "map.value"),
    "set": ({"set": ["object.mas=3"]}, "set: object.mas"),
    "alias": ({"vary": [{"key": "object.mass", "form": 1.0, "to": 2.0}]}, "'from'"),
    "problem": ({"problem": "nowhere.toml"}, "study.toml: problem: nowhere.toml: no such file"),
    "second key": (
        {"vary": [{**RANGE, "steps": 3}, {"key": "name", "values": [3]}]},
        "vary[1].values[0]: name = 3",
    ),
    "parts": (
        {
            "vary": [
                {"key": "object.position.x", "values": [0.5]},
                {"key": "object.position", "values": [[0.4, 0.5]]},
            ]
        },
        "set the same",
    ),
    "component": (
        {
            "vary": [
                {"key": "object.position.x", "values": [0.5]},
                {"key": "object.position.0", "values": [0.5]},
            ]
        },
        "set the same",
    ),
    "set again": ({"set": ["object.mass=1"]}, "set the same"),
    "seed": ({"vary": [{"key": "search.seed", "values": [1]}]}, "seeds says which"),
    "seeds": ({"seeds": [0, 1]}, "seeds: evaluate uses none"),
    "too many": (
        {"vary": [{**RANGE, "steps": 9_999_999}], "seeds": [0, 1, 2], "command": "solve"},
        "asks for 3e+07 points",
    ),
    "start": ({"problem": str(PROBLEMS / "two-panda-box.toml")}, "start"),
}


@pytest.mark.parametrize("fault", WRONG)
@pytest.mark.parametrize("command", ["study", "check"])
def test_wrong_studies_are_one_line_and_leave_nothing(
    tmp_path: Path, monkeypatch, capsys, fault: str, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    change, words = WRONG[fault]
    file = written(tmp_path, study_text(**change))
    assert main([command, file.name]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("copose: ") and err.count("\n") == 1 and words in err
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]


def test_check_tells_points_and_time(tmp_path: Path, capsys) -> None:
    assert main(["check", str(written(tmp_path, study_text(command="solve", seeds=[0, 1])))]) == 0
    out = capsys.readouterr().out
    assert (
        "masses: 5 points, 2 seeds each, of" in out
        and "object.mass: 5 values" in out
        and "a point" in out
    )
