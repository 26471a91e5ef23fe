"""The gallery is current: every problem has a row and the picture of its answer."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import gallery
import pytest
from PIL import Image

from cells import FILES
from copose.problem import is_study

NAMES = sorted(file.stem for file in FILES)
PLANAR = [file.stem for file in FILES if 'space = "planar' in file.read_text()]


def chunks(name: str) -> dict[str, str]:
    with Image.open(gallery.PICTURES / f"{name}.png") as picture:
        assert picture.width == gallery.WIDTH
        return dict(picture.info)


def test_the_page_has_a_row_for_every_problem() -> None:
    assert sorted(name for names in gallery.GROUPS.values() for name in names) == NAMES
    assert gallery.PAGE.read_text() == gallery.page(), "run benchmarks/gallery.py"
    assert {file.stem for file in gallery.PICTURES.iterdir()} == {*NAMES, *gallery.STUDIES}
    studies = gallery.PROBLEMS.glob("studies/*.toml")
    named = {file.stem for file in studies if is_study(tomllib.loads(file.read_text()))}
    assert named == {*gallery.STUDIES}


@pytest.mark.parametrize("name", gallery.LIVE)
def test_pictures_of_the_live_page_are_of_problems_as_they_are(name: str) -> None:
    problem, words = gallery.LIVE[name]
    file = gallery.PROBLEMS / f"pictures/live-{name}.png"
    with Image.open(file) as picture:
        assert picture.size == (1200, 750)
        told = picture.info["problem"]
    assert told == gallery.digest(problem), f"run benchmarks/live_gallery.py {name}"
    assert file.stat().st_size < gallery.LIVE_BYTES
    assert f'<img src="pictures/live-{name}.png" width="600" alt="{words}">' in gallery.page()


@pytest.mark.parametrize("name", [*NAMES, *gallery.STUDIES])
def test_a_picture_is_of_the_problem_as_it_is(name: str) -> None:
    told = chunks(name)
    assert told["problem"] == gallery.digest(name), f"run benchmarks/gallery.py {name}"
    assert json.loads(told["objective"]) is not None
    assert (gallery.PICTURES / f"{name}.png").stat().st_size < gallery.MOST_BYTES


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in PLANAR else pytest.mark.long) for name in NAMES],
)
def test_a_picture_is_of_the_answer_as_it_is(name: str) -> None:
    shown = json.loads(chunks(name)["objective"])
    assert gallery.answer(name).objective.after == pytest.approx(shown, rel=1e-6, abs=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("name", gallery.STUDIES)
def test_a_map_is_of_the_answers_as_they_are(name: str, tmp_path: Path) -> None:
    shown = json.loads(chunks(name)["objective"])
    table = gallery.study_table(name, tmp_path)
    assert table.numbers["objective"][table.best(1)[0]] == pytest.approx(shown, rel=1e-6, abs=1e-6)
