"""What a search tells of itself: how often the best was met, and what may have been missed."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import copose
from cells import planar, tables
from copose.report.words import evidence_words
from copose.results import BasinRecord, Optimum, Solution, read_solution, to_json
from copose.viewer import page_html
from path_problems import hinged

PLANAR_BASE = {"base": {"x": [-0.1, 0.1], "y": [-0.1, 0.1]}}


def free_base() -> dict:
    """Two planar 4-joint arms, the base of one free."""
    cell = tables("two-planar-4r")
    cell["arms"][1]["freedom"] = copy.deepcopy(PLANAR_BASE)
    return cell


def two_cases() -> dict:
    """The same for two poses of the object."""
    poses = [{"name": "here"}, {"name": "there", "position": [0.4, 0.5], "weight": 2.0}]
    return free_base() | {"cases": poses}


def among_bodies() -> dict:
    """Two planar arms that have to keep apart."""
    return tables("two-planar-4r") | {"constraints": {"collision": True}}


def all_round() -> dict:
    """Two planar arms with torque limits, on hinges."""
    cell = planar(2, 3, "planar-linear", objective={"kind": "all-round"})
    for arm in cell["arms"]:
        arm["torque_limits"] = [20.0, 10.0, 5.0]
    return cell


KINDS = {
    "plain": lambda: tables("two-planar-4r"),
    "placement": free_base,
    "cases": two_cases,
    "reachable": lambda: tables("two-planar-4r") | {"search": {"reachable": True}},
    "bodies": among_bodies,
    "all-round": all_round,
    "payload": lambda: tables("panda-payload"),
}


def record(*counts: int) -> BasinRecord:
    """The record of optima that were met so often, each worse than the one before."""
    optima = [Optimum(objective=-float(k), count=count) for k, count in enumerate(counts)]
    return BasinRecord.of(optima, 0.0)


@pytest.mark.parametrize("draws", [10, 40, 160])
def test_the_estimate_is_on_average_the_share_of_basins_never_met(draws: int) -> None:
    rng = np.random.default_rng(draws)
    shares = rng.dirichlet(np.full(60, 0.3))
    counts = rng.multinomial(draws, shares, size=4000)
    told = np.array([record(*row[row > 0]).unseen for row in counts])
    true = np.array([shares[row == 0].sum() for row in counts])
    # Σ p (1 − p)^(N − 1) of the estimate, Σ p (1 − p)^N of the share itself.
    assert abs(told.mean() - shares @ (1 - shares) ** (draws - 1)) < 4 * told.std() / 4000**0.5
    assert abs(true.mean() - shares @ (1 - shares) ** draws) < 4 * true.std() / 4000**0.5
    assert -0.002 < told.mean() - true.mean() < 1 / draws


def test_counts_of_the_record() -> None:
    assert record(3, 1, 1, 2) == BasinRecord(converged=7, best=3, unseen=2 / 7)
    assert record() == BasinRecord(converged=0, best=0, unseen=None)
    mirrored = [Optimum(objective=x, count=2) for x in (5.0, 5.0 - 1e-9, 4.9)]
    assert BasinRecord.of(mirrored, 5.0).best == 4
    assert BasinRecord.of(mirrored, 5.1).best == 0
    # Optima that are no answer count as met.
    assert BasinRecord.of(mirrored[:1], 5.0, [2, 1, 1]) == BasinRecord(
        converged=4, best=2, unseen=0.5
    )


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_search_tells(kind: str) -> None:
    solution = copose.solve(copose.parse(KINDS[kind]()), effort="low")
    search = solution.search
    assert search is not None and search.basins is not None, solution.reason
    counts = [optimum.count for optimum in search.local_optima]
    basins = search.basins
    assert basins.best == sum(
        optimum.count
        for optimum in search.local_optima
        if optimum.objective >= search.local_optima[0].objective - 1e-6
    )
    assert basins.best >= 1
    assert sum(counts) <= basins.converged <= search.starts
    if kind not in ("reachable", "bodies"):
        assert basins.converged == sum(counts)
        assert basins.unseen == counts.count(1) / sum(counts)
    assert (search.bound is not None) == (kind == "all-round")
    if search.bound is not None:
        assert search.best_sample <= search.bound
    assert read(solution) == solution


def read(solution: Solution) -> Solution:
    """A result written and read again."""
    return Solution.model_validate_json(to_json(solution))


def test_a_path_tells_of_the_motions_of_its_routes() -> None:
    motion = copose.plan(copose.parse(hinged()))
    assert motion.search is not None and motion.search.basins is not None
    values = [route.value for route in motion.search.routes if route.value is not None]
    basins = motion.search.basins
    assert basins.converged == len(values)
    counts = [sum(abs(value - other) < 1e-6 for other in values) for value in values]
    assert basins.best == counts[values.index(max(values))] >= 1
    assert basins.unseen == counts.count(1) / len(values)


def test_it_is_said_in_one_line() -> None:
    problem = copose.parse(all_round())
    solution = copose.solve(problem, effort="low")

    def words(**basins: object) -> str:
        changed = solution.search.model_copy(update={"basins": BasinRecord(**basins)})
        return evidence_words(solution.model_copy(update={"search": changed}))

    assert words(converged=8, best=3, unseen=0.125).startswith(
        "one more start finds another optimum with a chance of about 12.5 % (Good-Turing)"
    )
    assert words(converged=2, best=1, unseen=1.0).startswith("each optimum was met once")
    bound = f"no combination of the samples is worth more than {solution.search.bound:.6f}"
    assert words(converged=0, best=0, unseen=None) == bound
    assert evidence_words(solution).endswith(bound)
    assert bound in page_html(solution, problem)
    assert bound.split()[-1] in solution._repr_html_()


def test_results_without_it_are_read(tmp_path) -> None:
    solution = copose.solve(copose.parse(planar()), effort="low")
    data = solution.model_dump(mode="json")
    del data["search"]["basins"]
    (tmp_path / "result.json").write_text(Solution.model_validate(data).model_dump_json())
    assert read_solution(tmp_path / "result.json").search.basins is None
