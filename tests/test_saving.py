"""A problem is saved as changed: its file loads as the same, and what was not changed stays."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import copose
from cells import FILES, tables, two_pandas
from cells import toml as toml_text
from copose.errors import InputError
from copose.live.problem_file import toml_text as edited
from copose.live.problem_file.document import tables_of
from copose.live.problem_file.saving import problem_text, save_problem
from copose.live.problem_file.toml_text import text_of, text_with
from copose.problem import Problem, held, overridden
from copose.problem import parse as parse_complete
from reference import PROBLEMS

NAMES = ("panda-three-cases", "panda-walls", "panda-carry-path", "two-planar-4r")
TEXTS = {name: (PROBLEMS / f"{name}.toml").read_text() for name in NAMES}
NUMBER = st.floats(-5, 5) | st.integers(-3, 3) | st.floats(0, 1e-9)
LENGTH = st.floats(0.01, 3)


def triple(planar: bool) -> st.SearchStrategy[object]:
    return st.tuples(*[NUMBER] * (2 if planar else 3)).map(list)


def keys(name: str) -> dict[str, st.SearchStrategy[object]]:
    """Keys of a problem with values that it may have; not all go with one another."""
    planar = name == "two-planar-4r"
    place, cell = triple(planar), tables(name)
    turn = {"angle": NUMBER} if planar else {"rpy": place, "quaternion": st.just([0.6, 0, 0.8, 0])}
    shape = st.builds(lambda a: {"kind": "disk" if planar else "sphere", "radius": a}, LENGTH)
    body = st.builds(
        lambda at, what, word: {"name": word, "position": at, "shape": what},
        place,
        shape,
        st.sampled_from(["a", "b.c", 'd "e"', "left wall"]),
    )
    found = {
        "description": st.text(max_size=20),
        "object.mass": LENGTH,
        "object.position": place,
        "object.position.y": NUMBER,
        "object.shape": shape,
        "object.freedom.x": st.just([-0.1, 0.1]),
        "constraints.collision": st.booleans(),
        "constraints.joint_margin": st.floats(0, 0.01),
        "search.seed": st.integers(0, 2**60),
        "world.gravity": place,
        "ellipsoid.gravity": st.booleans(),
        "objective": st.sampled_from(
            [{"kind": "volume"}, {"kind": "isotropy", "axes": ["x", "y"]}]
        ),
        "objective.kind": st.sampled_from(["volume", "isotropy", "velocity-volume"]),
        "objective.axes": st.just(["x", "y"]),
        "obstacles": st.lists(body, max_size=3, unique_by=lambda table: table["name"]),
        "cases": st.sampled_from([[], [{"name": "one"}, {"name": "two", "mass": 3.5}]]),
        "path": st.just({"waypoints": [{"position": [0.5] * (2 if planar else 3)}, {}, {}]}),
    }
    found |= {f"object.{key}": value for key, value in turn.items()}
    for arm in ("left", "right"):
        found |= {f"arms.{arm}.{k}.{key}": v for k in ("base", "grasp") for key, v in turn.items()}
        found |= {
            f"arms.{arm}.base.position.x": NUMBER,
            f"arms.{arm}.base": st.builds(lambda at: {"position": at}, place),
            f"arms.{arm}.grasp.position": place,
            f"arms.{arm}.start": st.just([0.1] * (4 if planar else 7)),
            f"arms.{arm}.freedom.grasp.{'angle' if planar else 'yaw'}": st.just([-0.1, 0.2]),
            f"arms.{arm}.freedom": st.just({"base": {"x": [-0.5, 0.5]}}),
            f"arms.{arm}.position_limits.1": st.just([-2.5, 2.25]),
            f"arms.{arm}.grip": st.sampled_from([{}, {"force": 100.0}]),
        }
    for k, obstacle in enumerate(cell.get("obstacles", [])):
        found[f'obstacles."{obstacle["name"]}".position.{"xyz"[k]}'] = NUMBER
    for case in cell.get("cases", []):
        found |= {f"cases.{case['name']}.rpy": place, f"cases.{case['name']}.weight": LENGTH}
    if "path" in cell:
        found |= {"path.waypoints.0.position.z": NUMBER, "path.duration": st.just("shortest")}
        found["path.waypoints.1"] = st.builds(lambda at: {"position": at, "rpy": at}, place)
    return found


@st.composite
def changed(draw: st.DrawFn) -> tuple[str, dict[str, object]]:
    name = draw(st.sampled_from(NAMES))
    values = keys(name)
    chosen = draw(st.lists(st.sampled_from(sorted(values)), max_size=6, unique=True))
    return name, {key: draw(values[key]) for key in chosen}


def outcome(make: Callable[[], object]) -> object:
    try:
        return make()
    except InputError as error:
        return str(error)


def comments(text: str, changed: set[str]) -> list[str]:
    """The comments of a text on lines of their own and, below headers that do not change, others.

    Lines end as TOML's do: a string may hold what else ends one.
    """
    found, header = [], ""
    for line in text.split("\n"):
        if opened := re.match(r"\[+([a-z]\w*)", line):
            header = opened[1]
        if line.startswith("#") or ("#" in line and header and header not in changed):
            found.append(line[line.index("#") :])
    return found


@settings(max_examples=150, suppress_health_check=list(HealthCheck))
@given(changed())
@example(("panda-three-cases", {"description": "#\u2028# no comment"}))
def test_the_text_loads_as_the_changed_problem(case: tuple[str, dict[str, object]]) -> None:
    name, changes = case
    text, file = TEXTS[name], PROBLEMS / f"{name}.toml"
    wanted = outcome(lambda: overridden(tomllib.loads(text), changes))
    problem = outcome(lambda: copose.load(file, set=changes))
    if isinstance(wanted, str):
        assert str(problem).endswith(wanted)
        return
    assert isinstance(wanted, dict)
    # Its tables are kept as text whether they are a problem or not.
    edited = [text_with(text, wanted)]
    assert tomllib.loads(edited[0]) == wanted
    assert outcome(lambda: copose.parse(tomllib.loads(edited[0]), file)) == problem
    if isinstance(problem, Problem):
        edited.append(problem_text(problem))
        assert copose.parse(tomllib.loads(edited[1]), file) == problem
    # No comment is lost with a value that stays.
    touched = {key.split(".")[0] for key in changes}
    for found in edited:
        assert comments(found, touched) == comments(text, touched)
        assert text_with(found, tomllib.loads(found)) == found


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_nothing_changes_without_changes(file: Path) -> None:
    text = file.read_text()
    assert problem_text(copose.load(file)) == text
    mass = tables(file.stem)["object"]["mass"]
    assert problem_text(copose.load(file, set={"object.mass": np.float64(mass)})) == text
    lines = text.splitlines()
    other = problem_text(copose.load(file, set={"object.mass": mass + 0.1 + 0.2})).splitlines()
    differ = [k for k, (one, two) in enumerate(zip(lines, other, strict=True)) if one != two]
    assert len(differ) == 1
    assert other[differ[0]].startswith(f"mass = {mass + 0.1 + 0.2!r}")


ODD = """\
# head
format = 1   # one
name = 'odd'
task.space = "planar"

# the thing
[object]
mass = 1.0            # kg, weighed
inertia = 0.01        # kg·m²
position = [
    0.45,   # along
    0.5,    # up
]

  [object.shape]  # a plate
  kind = "box"
  size = [0.3, 0.1]

# the first
[[arms]]
name = "left"
links = [
    # upper
    { length = 0.5, mass = 1.5, inertia = 0.012, com = 0.15 },
    { length = 0.4, mass = 1.2, inertia = 0.010, com = 0.15 },  # lower
]
grasp.position = [0.0, 0.0]
grasp.angle = 0.5
tool.mass = 1.0
tool.inertia = 0.1

[arms.freedom.base]
x = [-0.1, 0.1]

# at last
[objective]
kind = "volume"

# after all"""


ODD_CHANGES = {
    "object.mass": 2,
    "object.position.x": 0.125,
    "object.angle": 0.5,
    "object.shape.size.1": 0.2,
    "arms.left.links.1.length": 0.45,
    "arms.left.grasp.angle": -0.5,
    "arms.left.tool.com": [0, 0],
    "arms.left.start": [0.0, 1.0],
    "arms.left.freedom.grasp.x": [0.0, 0.1],
    "objective.axes": ["x", "y"],
    "description": "more",
    "search.seed": 7,
}


@pytest.mark.parametrize("end", ["", "\n"], ids=["open", "ended"])
def test_odd_text_keeps_its_form(end: str) -> None:
    expected = ODD + "\n"
    for old, new in [
        ("mass = 1.0            # kg, weighed", "mass = 2            # kg, weighed"),
        ("0.45,   # along", "0.125,   # along"),
        ("    0.5,    # up\n]\n", "    0.5,    # up\n]\nangle = 0.5\n"),
        ("size = [0.3, 0.1]", "size = [0.3, 0.2]"),
        ("length = 0.4,", "length = 0.45,"),
        ("grasp.angle = 0.5\n", "grasp.angle = -0.5\n"),
        ("tool.mass = 1.0\n", "tool.mass = 1.0\ntool.com = [0, 0]\n"),
        ("tool.inertia = 0.1\n", "tool.inertia = 0.1\nstart = [0.0, 1.0]\n"),
        ('task.space = "planar"\n', 'task.space = "planar"\ndescription = "more"\n'),
        ("x = [-0.1, 0.1]\n\n", "x = [-0.1, 0.1]\n\n[arms.freedom.grasp]\nx = [0.0, 0.1]\n\n"),
        ('kind = "volume"\n', 'kind = "volume"\naxes = ["x", "y"]\n'),
        ("# after all\n", "# after all\n\n[search]\nseed = 7\n"),
    ]:
        assert expected.count(old) == 1
        expected = expected.replace(old, new)
    wanted = overridden(tomllib.loads(ODD), ODD_CHANGES)
    found = text_with(ODD + end, wanted)
    assert tomllib.loads(found) == wanted
    assert found == expected


def test_a_problem_of_odd_text_keeps_its_form(tmp_path: Path) -> None:
    text = ODD.replace("tool.mass = 1.0\n", "tool.mass = 1.0\ntool.com = [0.1, 0.0]  # off\n")
    file = tmp_path / "odd.toml"
    file.write_text(text)
    assert problem_text(copose.load(file)) == text
    changes = ODD_CHANGES | {"object.mass": 2.5, "arms.left.tool.com": [0.0, 0.0]}
    found = problem_text(copose.load(file, set=changes))
    assert found == text_with(text, overridden(tomllib.loads(text), changes))
    assert "tool.com = [0.0, 0.0]  # off\n" in found
    assert comments(found, set()) == comments(text, set())


def test_a_truth_value_is_no_number() -> None:
    assert text_with("a = 1  # one\n", {"a": 1.0}) == "a = 1  # one\n"
    assert text_with("a = 1  # one\n", {"a": True}) == "a = true  # one\n"


def test_dotted_keys_that_go_leave_the_others() -> None:
    text = "# kept\n" + "".join(
        f"objective.{key}\n"
        for key in ('kind = "acceleration"', "direction = [1, 0, 0]", 'axes = ["x"]  # along')
    )
    found = text_with(text, {"objective": {"kind": "volume", "axes": ["x"]}})
    assert found == '# kept\nobjective.kind = "volume"\nobjective.axes = ["x"]  # along\n'


def test_what_tomlkit_gets_wrong_is_written_without_comments(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(edited, "_merge", lambda document, *_: document.clear())
    found = text_with(ODD, tomllib.loads(ODD) | {"name": "even"})
    assert "#" not in found
    assert tomllib.loads(found) == tomllib.loads(ODD) | {"name": "even"}


def taught_cell(pupils: int) -> dict:
    cell = two_pandas()
    for arm in cell["arms"][:pupils]:
        arm["start"] = [0, -0.4, 0, -2.2, 0, 1.8, 0.8]
        del arm["grasp"]
    if pupils == 2:
        del cell["object"]["position"]
    return cell


@pytest.mark.parametrize("pupils", [1, 2], ids=["one", "all"])
@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"object.mass": 3}, False),
        ({"object.position": [0.4, 0.1, 0.6]}, True),
        ({"arms.left.base.position.x": -0.1}, True),
        ({"arms.left.start.1": -0.5}, True),
        ({"arms.left.start.1": -99}, True),
        ({"arms.left.grasp.position.x": 0.2}, True),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_a_taught_grasp_is_written_where_it_would_be_another(
    pupils: int, changes: dict, told: bool, tmp_path: Path
) -> None:
    file = tmp_path / "cell.toml"
    file.write_text("# kept\n" + toml_text(taught_cell(pupils)))
    problem, target = copose.load(file, set=changes), tmp_path / "saved.toml"
    assert save_problem(problem, target) == copose.load(target)
    assert copose.load(target).model_dump() == problem.model_dump()
    assert target.read_text().startswith("# kept\n")
    arms = tomllib.loads(target.read_text())["arms"]
    assert ["grasp" in arm for arm in arms] == [told or (pupils == 1 and k == 1) for k in (0, 1)]
    assert copose.parse(tomllib.loads(target.read_text()), file) == problem


@pytest.mark.parametrize(
    ("kind", "along"), [("payload", None), (None, [0, 0, 1]), ("acceleration", np.ones(6))]
)
def test_another_objective_and_direction_are_saved(kind: str | None, along: object) -> None:
    file = PROBLEMS / "panda-walls.toml"
    problem = copose.load(file, set={"object.mass": 3}, objective=kind, direction=along)
    text = problem_text(problem)
    assert copose.parse(tomllib.loads(text), file) == problem
    assert comments(text, set()) == comments(TEXTS[file.stem], set())


def beside(folder: Path) -> Path:
    """A problem whose robot and packages lie by relative paths beside it."""
    (folder / "robots").mkdir(parents=True)
    cell = two_pandas()
    cell["arms"][0] |= {"urdf": "../robots/arm.urdf", "packages": {"a": ".", "b": "/abs"}}
    (folder / "cells").mkdir()
    file = folder / "cells" / "cell.toml"
    file.write_text("# kept\n" + toml_text(cell))
    return file


def test_paths_lead_to_the_same_files_from_another_folder(tmp_path: Path) -> None:
    file = beside(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    target = tmp_path / "link" / "deep" / "saved.toml"
    problem = save_problem(copose.load(file, set={"object.mass": 3}), target)
    arms = tomllib.loads(target.read_text())["arms"]
    assert arms[0]["urdf"] == "../../robots/arm.urdf"
    assert arms[0]["packages"] == {"a": "../../cells", "b": "/abs"}
    assert arms[1]["urdf"].startswith("example-robot-data://")
    assert (target.resolve().parent / "../../robots").samefile(tmp_path / "robots")
    assert target.read_text().startswith("# kept\n")
    assert problem == copose.load(target)
    assert problem.object.mass == 3
    near = file.parent / "other.toml"
    assert save_problem(copose.load(file), near).arms == copose.load(file).arms
    assert near.read_text() == file.read_text()


def test_a_problem_is_saved_with_the_comments_of_its_file(tmp_path: Path) -> None:
    file, target = beside(tmp_path), tmp_path / "saved.toml"
    problem = copose.load(file, set={"object.mass": 3, "arms.left.base.rpy.z": 0.25})
    saved = save_problem(problem, target)
    assert target.read_text().startswith("# kept\n")
    assert saved == copose.load(target)
    assert saved.object == problem.object
    assert [arm.base for arm in saved.arms] == [arm.base for arm in problem.arms]
    assert [arm.file for arm in saved.arms] == ["robots/arm.urdf", problem.arms[1].file]
    for place in (file, target):
        with pytest.raises(InputError, match="is there already"):
            save_problem(problem, place)
    save_problem(problem, file, overwrite=True)
    assert copose.load(file) == problem


@pytest.mark.parametrize(
    ("name", "case"), [("panda-three-cases", "carry"), ("panda-second-base", "")]
)
def test_what_the_page_shows_is_saved(name: str, case: str, tmp_path: Path) -> None:
    problem = held(copose.load(PROBLEMS / f"{name}.toml"), case)
    saved = save_problem(problem, tmp_path / "saved.toml")
    assert saved.model_dump() == problem.model_dump()
    text = (tmp_path / "saved.toml").read_text()
    left = tomllib.loads(text)
    assert text.startswith("#:schema") and "cases" not in left
    assert not any("freedom" in table for table in (left["object"], *left["arms"]))


def test_nothing_is_replaced_unasked_and_nothing_wrong_is_written(tmp_path: Path) -> None:
    file = beside(tmp_path)
    text = file.read_text()
    (tmp_path / "wall").write_text("")
    problem = copose.load(file)
    wrong = problem.model_copy(update={"object": problem.object.model_copy(update={"mass": -1.0})})
    for saved, target, told in [
        (problem, file, "is there already"),
        (problem, tmp_path, "is a folder"),
        (problem, tmp_path / "wall" / "x.toml", "cannot be written"),
        (problem, tmp_path / ("x" * 300), "cannot be written"),
        (wrong, tmp_path / "x.toml", r"object.mass: -1.* must be above zero"),
    ]:
        with pytest.raises(InputError, match=told):
            save_problem(saved, target)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cells", "robots", "wall"]
    assert file.read_text() == text
    save_problem(copose.load(file, set={"object.mass": 7}), file, overwrite=True)
    assert copose.load(file).object.mass == 7
    if os.name == "posix":
        assert file.stat().st_mode & 0o600 == 0o600


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_problem_without_its_file_is_written_out(file: Path) -> None:
    read = copose.parse(tomllib.loads(file.read_text()))
    again = copose.parse(tomllib.loads(problem_text(read)))
    assert again == read
    assert again.model_dump() == read.model_dump()


@pytest.mark.parametrize("name", NAMES)
def test_the_text_of_a_problem_with_changes_is_its_files_with_them(name: str) -> None:
    file, mass = PROBLEMS / f"{name}.toml", {"object.mass": 3.5, "arms.right.name": "other"}
    assert problem_text(copose.load(file)) == TEXTS[name]
    problem = copose.load(file, set=mass)
    wanted = overridden(tomllib.loads(TEXTS[name]), mass)
    assert problem_text(problem) == text_with(TEXTS[name], wanted)
    shape = {"kind": "box", "size": [0.5] * (2 if "planar" in name else 3)}
    more = {"arms.left.grasp.position.y": 0.25, "object.shape": shape}
    problem = copose.load(file, set=more)
    text = problem_text(problem)
    assert copose.parse(tomllib.loads(text), file) == problem
    assert text.splitlines()[:4] == TEXTS[name].splitlines()[:4]


def test_the_text_of_a_taught_problem_says_its_grasps(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text("# kept\n" + toml_text(taught_cell(1)))
    assert problem_text(copose.load(file)) == file.read_text()
    problem = copose.load(file, set={"object.position": [0.4, 0.1, 0.6]})
    text = problem_text(problem)
    assert text.startswith("# kept\n")
    assert copose.parse(tomllib.loads(text), file) == problem
    file.unlink()
    assert copose.parse(tomllib.loads(problem_text(problem)), file) == problem


def test_a_quaternion_goes_where_another_rotation_comes(tmp_path: Path) -> None:
    cell = two_pandas()
    for arm in cell["arms"]:
        arm["base"] = {"quaternion": [0.5, 0.5, 0.5, 0.5]}
    file = tmp_path / "cell.toml"
    file.write_text(toml_text(cell))
    problem = copose.load(file, set={"arms.left.base.rpy.z": 0.3})
    text = problem_text(problem)
    assert copose.parse(tomllib.loads(text), file) == problem
    assert text.count("quaternion") == 1


def test_a_problem_of_tables_is_written_with_infinities_and_quaternions() -> None:
    cell = two_pandas()
    cell["arms"][0] |= {"torque_limits": [float("inf")] * 7, "locked": {"panda finger": 0.01}}
    cell["arms"][0]["base"] = {"quaternion": [0.5, 0.5, 0.5, 0.5]}
    cell["objective"] = {"kind": "volume", "axes": ["x", "y"]}
    problem = parse_complete(cell)
    text = text_of(tables_of(problem))
    assert copose.parse(tomllib.loads(text)) == problem


def test_without_tomlkit_one_line_says_what_to_install(tmp_path: Path) -> None:
    file, target = PROBLEMS / "two-planar-4r.toml", tmp_path / "saved.toml"
    code = f"""
import sys, tomllib
from pathlib import Path
sys.modules["tomlkit"] = None
import copose
from copose.live.problem_file.saving import save_problem
file = Path({str(file)!r})
of_file = copose.load(file, set={{"object.mass": 3}})
of_tables = copose.parse(tomllib.loads(file.read_text()))
for problem in (of_file, of_tables):
    try:
        save_problem(problem, Path({str(target)!r}))
    except copose.InputError as error:
        print(error)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    line = "tomlkit is missing, which saving needs: pip install 'copose[live]'"
    assert run.stdout.splitlines() == [line, line]
    assert not target.exists()
