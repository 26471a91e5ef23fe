"""Mutated problem files: always exit 0, 2, 3 or 4, one line, nothing half-written."""

from __future__ import annotations

import contextlib
import copy
import io
import json
import os
import tempfile
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cells import planar, toml, two_pandas
from copose.commands.command_line import main

SCALARS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(-2, 2),
    st.sampled_from(
        [0, -1, 1e-300, 1e300, 10**30, True, "", "x", "box", "planar", "\x00", "é" * 300, "$a_b$"]
    ),
)
VALUES = st.one_of(
    SCALARS,
    st.lists(SCALARS, max_size=8),
    st.lists(st.lists(st.floats(-3, 3), max_size=4), max_size=7),
    st.dictionaries(
        st.sampled_from(["kind", "position", "x", "size", "mass"]), SCALARS, max_size=3
    ),
)
KINDS = {
    "planar-linear": planar(2, 3),
    "planar": planar(2, 4, "planar"),
    "three": planar(3, 3),
    "spatial": two_pandas(),
    "spatial-linear": two_pandas("spatial-linear"),
}
FULL = {
    "constraints": {"joint_margin": 0.05},
    "search": {"seed": 1},
    "ellipsoid": {"gravity": True},
    "objective": {"kind": "volume"},
}
OBJECTIVES = [
    {"kind": "volume"},
    {"kind": "volume", "axes": ["x"]},
    {"kind": "worst-direction"},
    {"kind": "isotropy", "axes": ["y", "x"]},
    {"kind": "task-compatibility", "directions": [{"direction": [1.0, 0.5], "weight": -1.0}]},
]
ELLIPSOIDS = {
    "resolution": ["pseudoinverse", "torque-optimal"],
    "torque_scaling": ["unit", "limits"],
    "load_distribution": ["moore-penrose", "nonsqueezing"],
    "gravity": [True, False],
}


def places(node: object, path: tuple = ()) -> list[tuple]:
    """Every key and index of a tree."""
    items = (
        node.items()
        if isinstance(node, dict)
        else enumerate(node)
        if isinstance(node, list)
        else ()
    )
    found = []
    for key, value in items:
        found += [(*path, key), *places(value, (*path, key))]
    return found


@st.composite
def mutated(draw: st.DrawFn) -> dict:
    cell = copy.deepcopy(KINDS[draw(st.sampled_from(sorted(KINDS)))] | FULL)
    for arm in cell["arms"]:
        n = len(arm.get("links", range(7)))
        if draw(st.booleans()):
            arm["start"] = draw(st.lists(st.floats(-3, 3), min_size=n, max_size=n))
        arm["torque_limits"] = [20.0] * n
        if draw(st.booleans()):
            arm["position_limits"] = [[-2.9, 2.8]] * n
    cell["objective"] = copy.deepcopy(draw(st.sampled_from(OBJECTIVES)))
    cell["ellipsoid"] = {key: draw(st.sampled_from(v)) for key, v in ELLIPSOIDS.items()}
    if draw(st.booleans()):
        m = {"spatial": 6, "planar-linear": 2}.get(cell["task"]["space"], 3)
        cell["object"]["velocity"] = draw(st.lists(st.floats(-3, 3), min_size=m, max_size=m))
    gentle = draw(st.booleans())
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(places(cell)))
        node: object = cell
        for part in path[:-1]:
            node = node[part]
        how = draw(st.sampled_from(["replace", "scale", "scale", "remove", "rename", "repeat"]))
        value = node[path[-1]]
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if gentle:
            if number and path[-1] != "format":
                factor = draw(st.sampled_from([-1, 0.2, 0.9, 1.05, 1.5, 5.0]))
                node[path[-1]] = value * factor + draw(st.sampled_from([0.0, 0.1, -0.05]))
            elif path[-1] == "name":
                node["name"] = draw(
                    st.text(max_size=8) | st.sampled_from(["$a^", "_x", "[b]", "臂"])
                )
        elif how == "remove":
            del node[path[-1]]
        elif how == "rename" and isinstance(node, dict):
            node[draw(st.text(min_size=1, max_size=12))] = node.pop(path[-1])
        elif how == "repeat" and isinstance(node, list):
            node.append(copy.deepcopy(value))
        elif how == "scale" and number:
            node[path[-1]] = value * draw(st.sampled_from([-1, 0.0, 1e-6, 0.5, 3.0, 1e3, 1e9]))
        else:
            node[path[-1]] = draw(VALUES)
        if not places(cell):
            break
    return cell


def outcome(content: bytes, command: str) -> None:
    out, err = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "p.toml"
        file.write_bytes(content)
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = main([command, str(file), "-o", str(Path(folder) / "out"), "--quiet"])
        left = sorted(str(path.relative_to(folder)) for path in Path(folder).rglob("*"))
        assert status in (0, 2, 3, 4)
        assert err.getvalue().count("\n") == (0 if status == 0 else 1)
        assert len(err.getvalue()) <= 600
        if status == 2:
            assert left == ["p.toml"]
            return
        result = json.loads(
            (Path(folder) / "out/result.json").read_text(), parse_constant=lambda name: 1 / 0
        )
        expected = ["out", "out/result.json", "p.toml"]
        if status == 0:
            expected.insert(1, "out/before_after.png")
            assert max(result["after"]["closure_error"].values()) <= 1e-6
        assert left == expected
        assert (result["after"] is None) == (status != 0)


EXAMPLES = int(os.environ.get("COPOSE_FUZZ", "60"))
SETTINGS = settings(
    max_examples=EXAMPLES, deadline=None, derandomize=EXAMPLES <= 60,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip


@SETTINGS
@given(mutated(), st.sampled_from(["solve", "solve", "evaluate"]))
def test_mutated_tables(cell: dict, command: str) -> None:
    outcome(toml(cell).encode("utf-8", "surrogatepass"), command)


@SETTINGS
@given(st.data())
def test_mutated_text(data: st.DataObject) -> None:
    text = bytearray(toml(planar(2, 3)).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(text) - 1))
        length = data.draw(st.integers(0, 8))
        text[place : place + length] = data.draw(st.binary(max_size=4))
    outcome(bytes(text), "solve")


@SETTINGS
@given(st.binary(max_size=200))
def test_any_bytes(content: bytes) -> None:
    outcome(content, "solve")
