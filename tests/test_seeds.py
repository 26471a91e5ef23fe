"""The tool that counts the seeds that miss, and the problems that it draws."""

from __future__ import annotations

import tomllib
from pathlib import Path

import building
import pytest
import seeds
from cases import Case
from random_problems import COUNT, closes, random_problem, written
from sampling import closed_postures
from truth import Truth

import copose
from reference import pose


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return written(tmp_path_factory.mktemp("random"))


def test_forty_problems_of_all_kinds_are_read_and_drawn_alike(files: list[Path]) -> None:
    assert len({*files}) == COUNT == 40
    for number, file in enumerate(files):
        copose.load(file)
        kind, tables = random_problem(number)
        assert tomllib.loads(file.read_text()) == tables
        assert seeds.kind_of(tables) in (kind, "planar", "payload", "acceleration")


@pytest.mark.parametrize("number", [0, 12, 26, 33, 34, 35, 36, 37])
def test_every_arm_holds_the_object_at_all_its_poses(number: int) -> None:
    _, tables = random_problem(number)
    poses = [*tables.pop("cases", [{}]), *tables.pop("path", {"waypoints": []})["waypoints"]]
    for arm in tables["arms"]:
        arm.pop("freedom", None)
    for place in poses:
        thing = tables["object"] | {k: v for k, v in place.items() if k in tables["object"]}
        truth = Truth(Case(tables["name"], "", tables))
        truth.place(pose(thing))
        for i in range(len(truth.names)):
            assert len(closed_postures(truth, i, 512, 0))


def test_a_draw_out_of_reach_does_not_count() -> None:
    tables, joints = building.cell("two-pandas", ("panda", "panda"), 0)
    thing = tables["object"]
    near, far = (
        {"position": [x + shift for x in thing["position"]], "rpy": thing["rpy"]}
        for shift in (0.01, 2.0)
    )
    assert closes(tables, joints, [near])
    assert not closes(tables, joints, [near, far])


def line(seed: int, value: float | None, status: str = "solved") -> seeds.Line:
    return {"problem": "p", "kind": "plain", "seed": seed, "status": status, "value": value,
            "seconds": 0.1}  # fmt: skip


def test_a_run_misses_by_more_than_a_millionth() -> None:
    values = [5.0, 5.0 - 5e-6, 5.0 - 7e-6, None]
    lines = [line(seed, value) for seed, value in enumerate(values)]
    best, missed = seeds.best_and_missed(lines)
    assert best == 5.0 and [each["seed"] for each in missed] == [2, 3]
    page = seeds.page(lines)
    assert "| p | plain | 4 | 5 | 2 | seed 2 4.999993, seed 3 solved |" in page
    assert "4 runs at the default effort, 2 of which (50.00 %)" in page
    assert seeds.best_and_missed([line(0, None, "failed")])[0] is None


def test_answers_are_kept_and_not_asked_again(tmp_path: Path) -> None:
    file = tmp_path / "seeds.jsonl"
    seeds.searched(seeds.PROBLEMS / "paper-fig2.toml", [0, 3], seeds.Store(file), 60.0)
    store = seeds.Store(file)
    assert store.missing("paper-fig2", range(5)) == [1, 2, 4]
    assert abs(store.lines[0]["value"] - 1.8224952484278525) < 1e-6
    store.forget(["paper-fig2"])
    assert seeds.Store(file).missing("paper-fig2", range(2)) == [0, 1]


def test_the_value_of_a_path_is_what_is_maximised() -> None:
    problem = copose.load(seeds.PROBLEMS / "panda-carry-path.toml")
    motion = copose.read_motion(Path(__file__).parent / "snapshots/path.json")
    after = motion.objective.after - problem.path.smoothness * motion.smoothness
    assert seeds.value_of(motion, problem) == after
    hurried = problem.path.model_copy(update={"duration": "shortest"})
    hurried = problem.model_copy(update={"path": hurried})
    assert seeds.value_of(motion, hurried) == -motion.duration


@pytest.mark.parametrize(
    ("number", "best", "some"), [(17, 104.6073636, (5, 10)), (18, 87.268075, (4,))]
)
def test_arms_sampled_on_surfaces_climb_alone_where_programs_judge(
    files: list[Path], number: int, best: float, some: tuple[int, ...]
) -> None:
    """The posture that is best beside another is met by climbs of one arm, hardly by pairs."""
    planner = copose.Planner(copose.load(files[number]))
    for seed in some:
        assert planner.solve(seed=seed).objective.after > best - 1e-6 * (1 + best)


def test_an_ascent_goes_on_where_opposite_facets_are_as_near(files: list[Path]) -> None:
    """The nearer of the two has a kink there, along which the radius still grows."""
    planner = copose.Planner(copose.load(files[24]))
    for seed in (0, 8):
        assert planner.solve(seed=seed).objective.after == pytest.approx(206.66972986, rel=1e-9)
