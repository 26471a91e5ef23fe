"""What notebooks show of problems and results, and the notebook that ships with the problems."""

from __future__ import annotations

import base64
import io
import json
import pickle
import re
import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import matplotlib as mpl
import nbformat
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure
from nbclient import NotebookClient
from PIL import Image

import copose
from cells import planar
from copose import InputError
from copose.results import Solution
from reference import PROBLEMS
from test_motion_report import made, nowhere

STEPS = PROBLEMS / "first-steps.ipynb"


@cache
def solved() -> Solution:
    return copose.solve(copose.load(PROBLEMS / "paper-fig2.toml"))


class Page(HTMLParser):
    """The text of a piece of HTML, its pictures, and every tag in it, all closed."""

    def __init__(self, content: str) -> None:
        super().__init__()
        self.text, self.pictures, self.tags, self.open = "", [], set(), []
        self.feed(content)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.tags.add(tag)
        if tag != "img":
            self.open.append(tag)
            return
        kind, _, data = dict(attrs)["src"].partition(",")
        assert kind == "data:image/png;base64"
        self.pictures.append(Image.open(io.BytesIO(base64.b64decode(data, validate=True))))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.mark.parametrize("kind", ["problem", "solution", "motion"])
def test_a_table_and_a_picture_are_shown(kind: str) -> None:
    settings, figures = dict(mpl.rcParams), pyplot.get_fignums()
    shown, said = {
        "problem": (copose.load(PROBLEMS / "paper-fig2.toml"), ["a1: planar links, 3 joints"]),
        "solution": (solved(), ["paper-fig2: solved", "log-volume", "local optima"]),
        "motion": (made(), ["made: solved", "least-norm"]),
    }[kind]
    page = Page(shown._repr_html_())
    assert all(words in page.text for words in said)
    (picture,) = page.pictures
    assert np.asarray(picture.convert("L")).std() > 5 and len(shown._repr_html_()) < 500_000
    assert dict(mpl.rcParams) == settings and pyplot.get_fignums() == figures


def test_names_are_escaped() -> None:
    odd = "<script>alert('1') & \"co\""
    cell = planar(name=odd)
    cell["arms"][0]["name"] = "<b>"
    problem = copose.parse(cell)
    solution = solved()
    record = solution.problem.model_copy(update={"name": odd})
    for shown in (problem, solution.model_copy(update={"problem": record})):
        page = Page(shown._repr_html_())
        assert page.tags <= {"pre", "span", "img"} and odd in page.text


def test_what_has_no_picture_is_shown_in_words() -> None:
    cell = planar()
    cell["arms"][0]["start"] = [9.0, 0.0, 0.0]
    cell["arms"][0]["position_limits"] = [[-1.0, 1.0]] * 3
    changes = {"status": "failed", "reason": "no time", "after": None}
    for shown, said in (
        (copose.parse(cell), "9.0 is outside the limits of joint1"),
        (solved().model_copy(update=changes), "failed"),
        (nowhere(), "infeasible"),
    ):
        page = Page(shown._repr_html_())
        assert said in page.text and page.pictures == []


def test_a_figure_is_drawn_where_no_file_is_named(tmp_path: Path) -> None:
    for result in (solved(), made()):
        figures = pyplot.get_fignums()
        drawn = copose.draw(result)
        assert isinstance(drawn, Figure) and pyplot.get_fignums() == figures
        file = tmp_path / "x.png"
        assert copose.draw(result, file) is None
        assert drawn._repr_png_() == file.read_bytes()
        assert isinstance(pickle.loads(pickle.dumps(drawn)), Figure)
    with pytest.raises(InputError, match="no motion to draw"):
        copose.draw(nowhere())


def test_joints_are_arrays_with_their_names() -> None:
    solution, motion = solved(), made()
    assert solution.q_names == tuple(f"a{i}/joint{j}" for i in (1, 2) for j in (1, 2, 3))
    stacked = [x for arm in ("a1", "a2") for x in solution.after.joints[arm]]
    assert solution.after.q.tolist() == stacked
    assert motion.q.shape == (9, 4) and motion.q[3].tolist() == motion.knots[3].q.tolist()
    assert motion.q_names[1] == "arm 0/elbow"
    with pytest.raises(InputError, match="no motion, it is infeasible"):
        nowhere().q  # noqa: B018


def test_frames_and_datasets() -> None:
    solution, motion = solved(), made()
    frame = solution.to_dataframe()
    assert list(frame.columns) == ["before", "after"] and frame.index.name == "joint"
    assert frame.loc["a2/joint1", "after"] == solution.after.joints["a2"][0]
    moved = motion.to_dataframe()
    assert moved.index.name == "time" and list(moved.columns) == list(motion.q_names)
    assert np.array_equal(moved.to_numpy(), motion.q)
    data = solution.to_xarray()
    after = data.q.sel(posture="after", joint="a2/joint1")
    assert float(after) == solution.after.joints["a2"][0] and str(after.arm.values) == "a2"
    data = motion.to_xarray()
    assert data.velocity.sel(joint="arm 1/shoulder").values.tolist() == [
        knot.velocity["arm 1"][0] for knot in motion.knots
    ]
    # The third knot has no torque.
    assert np.isnan(data.torque.values).all(axis=1).tolist() == [k == 2 for k in range(9)]
    assert data.objective.values.tolist() == [knot.objective for knot in motion.knots]


def test_cases_are_columns() -> None:
    after = solved().after
    data = {key: getattr(after, key) for key in after.model_fields_set}
    cases = tuple(
        copose.results.CasePosture(**data, name=name, weight=1.0, objective=None)
        for name in ("low", "high")
    )
    several = solved().model_copy(update={"after": None, "cases": cases})
    assert list(several.to_dataframe().columns) == ["low", "high"]
    assert several.to_xarray().posture.values.tolist() == ["low", "high"]


@pytest.mark.parametrize("name", ["pandas", "xarray"])
def test_a_package_that_is_missing_is_named(name: str, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    told = rf"the package {name} is not installed; pip install 'copose\[notebook\]'$"
    for result in (solved(), made()):
        with pytest.raises(InputError, match=told):
            result.to_dataframe() if name == "pandas" else result.to_xarray()


def test_the_notebook_runs(tmp_path: Path, monkeypatch) -> None:
    for name in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR"):
        monkeypatch.setenv(name, str(tmp_path / name))
    for file in PROBLEMS.glob("paper-*.toml"):
        (tmp_path / file.name).symlink_to(file)
    notebook = nbformat.read(STEPS, as_version=4)
    assert all(not cell.outputs for cell in notebook.cells if cell.cell_type == "code")
    nbformat.validate(notebook)
    NotebookClient(notebook, timeout=60, resources={"metadata": {"path": str(tmp_path)}}).execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    results = [cell.outputs[-1] for cell in cells]
    kinds = [[*result.get("data", {})] for result in results]
    assert all("text/html" in kinds[i] for i in (0, 1, 3)) and "image/png" in kinds[5]
    assert "2.727" in results[4]["data"]["text/plain"]
    assert "a1_joint1" in results[6]["data"]["text/plain"]
    assert not re.search("Error|Warning", json.dumps(notebook.cells))
