"""Never mute, and done in time: what calls tell, time limits, and interrupts."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import copose
from cells import planar, toml
from copose import progress
from copose.commands.command_line import main
from copose.errors import InputError
from copose.kernels import Kernel
from copose.motion.search.candidates import CandidateSearch
from copose.motion.search.refinement import Refiner
from copose.posture.local.multistart import LocalSearches
from copose.posture.run.run import Run
from copose.posture.search import combinations, global_search
from copose.posture.solvers.ipopt import Ipopt
from copose.posture.solvers.placed_newton import PlacedPolisher
from copose.problem import parse
from copose.progress import Progress, StoppedError, heed, hushed, sheltered, stage, watched
from path_problems import hinged
from path_truth import faults

LIMIT = 0.8
# What a limit may be overrun by, s, and what a machine may that others use too.
LATE = 0.4 + 1.5


def stalled(
    monkeypatch: pytest.MonkeyPatch, owner: object, name: str, *, after: int = 0
) -> list[float]:
    """A method, or a function, that does not come to its end before the call that it serves has to,
    from some call on; when it did.
    """
    whole, calls, ended = getattr(owner, name), [], []

    def slow(*arguments: object, **options: object) -> object:
        calls.append(name)
        while len(calls) > after and not progress.over():
            time.sleep(0.01)
        if len(calls) > after:
            ended.append(time.perf_counter())
        return whole(*arguments, **options)

    monkeypatch.setattr(owner, name, slow)
    return ended


class TestWatch:
    def test_what_is_done_is_told_with_the_best_so_far(self) -> None:
        told: list[Progress] = []
        with watched(told.append):
            stage("closing", 0, 2)
            progress.attained(1.0)
            progress.attained(0.5)
            with hushed():
                stage("an errand")
                progress.attained(7.0)
            stage("polishing")
        seen = [(now.stage, now.done, now.total, now.best) for now in told]
        assert seen == [
            ("closing", 0, 2, None), ("closing", 0, 2, 1.0), ("polishing", None, None, 1.0)
        ]  # fmt: skip
        assert 0 <= told[0].elapsed <= told[-1].elapsed < 1

    def test_nobody_is_told_and_nothing_ends_without_a_watch(self) -> None:
        stage("closing")
        heed()
        assert not progress.over()

    def test_a_limit_is_heeded_between_units_of_work(self) -> None:
        with watched(limit=0.02):
            stage("polishing")
            heed()
            time.sleep(0.03)
            with sheltered():
                heed()
                assert progress.over()
            for _ in range(2):
                with pytest.raises(StoppedError, match=r"^stopped by the limit of 0.02 s while"):
                    heed()
        heed()

    def test_kernels_heed_it_but_not_where_an_answer_is_put_together(self) -> None:
        x = ca.SX.sym("x", 1)
        kernel = Kernel(x, ca.SX.sym("p", 0), 2 * x)
        with watched() as watch:
            watch.interrupt()
            with sheltered():
                assert kernel(np.ones((1, 1)), np.zeros(0)) == 2
            with pytest.raises(StoppedError, match=r"^interrupted while"):
                kernel(np.ones((1, 1)), np.zeros(0))

    def test_a_part_ends_with_the_whole_and_counts_from_its_beginning(self) -> None:
        told: list[Progress] = []
        began = time.perf_counter() - 100
        with watched(told.append, limit=1e6, began=began) as whole:
            with watched(limit=1e9):
                stage("polishing")
                threading.Thread(target=whole.interrupt).start()
                with pytest.raises(StoppedError, match=r"^interrupted while polishing$"):
                    while True:
                        heed()
            with watched(limit=50.0), pytest.raises(StoppedError, match="50 s"):
                whole._interrupted = False
                heed()
        assert told[0].elapsed >= 100

    @pytest.mark.parametrize("limit", [0, -1.0, math.nan, math.inf, True, "2"])
    def test_what_is_no_limit_is_refused(self, limit: object) -> None:
        with pytest.raises(InputError, match=r"time_limit: .* is no finite number of seconds"):
            copose.solve(parse(planar()), time_limit=limit)

    def test_a_limit_ends_a_run_of_ipopt_between_iterations(self) -> None:
        x = ca.SX.sym("x", 50)
        valley = ca.sum1(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2)
        options = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
        sizes, start = (50, 0, 0), np.full(50, -0.7)
        run = Ipopt("valley", {"x": x, "f": valley}, sizes, options)
        plain = ca.nlpsol("valley", "ipopt", {"x": x, "f": valley}, options)
        whole = run(x0=start)
        assert run.stats()["return_status"] == "Solve_Succeeded"
        assert np.array_equal(np.array(whole["x"]), np.array(plain(x0=start)["x"]))
        iterations = run.stats()["iter_count"]
        with watched() as watch:
            watch.interrupt()
            with pytest.raises(StoppedError):
                run(x0=start)
        assert run.stats()["return_status"] == "User_Requested_Stop"
        assert run.stats()["iter_count"] < 2 < iterations


def cut_short(solution: copose.Solution | copose.Motion, words: str) -> bool:
    return any(
        re.match(f"stopped by the limit of {LIMIT} s while {words}.*: the best so far; .* from run "
                 "to run: allow more time", note)
        for note in solution.notes
    )  # fmt: skip


class TestLimits:
    def test_the_best_so_far_is_the_answer(self, monkeypatch: pytest.MonkeyPatch) -> None:
        problem = parse(planar(2, 4))
        best = copose.solve(problem).objective.after
        ended = stalled(monkeypatch, LocalSearches, "add", after=1)
        found = copose.solve(problem, time_limit=LIMIT)
        assert time.perf_counter() - ended[0] < LATE
        assert found.status == "solved" and cut_short(found, "polishing")
        assert copose.verify(problem, found) == ()
        assert found.objective.before <= found.objective.after <= best + 1e-9

    def test_a_sample_stands_in_where_nothing_was_polished(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        problem = parse(planar(2, 4))
        stalled(monkeypatch, LocalSearches, "add")
        found = copose.solve(problem, time_limit=LIMIT)
        assert found.status == "solved" and cut_short(found, "comparing postures")
        assert copose.verify(problem, found) == ()
        assert found.objective.after == pytest.approx(found.search.best_sample, abs=1e-9)

    def test_the_start_is_an_answer_too(self, monkeypatch: pytest.MonkeyPatch) -> None:
        problem = parse(planar(2, 4))
        stalled(monkeypatch, combinations, "screen")
        found = copose.solve(problem, time_limit=LIMIT)
        assert found.status == "solved" and cut_short(found, "comparing postures")
        assert found.after == found.before and copose.verify(problem, found) == ()

    def test_bodies_are_heeded_all_the_same(self, monkeypatch: pytest.MonkeyPatch) -> None:
        wall = {"name": "wall", "shape": {"kind": "box", "size": [0.2, 0.4]},
                "position": [0.35, 0.55]}  # fmt: skip
        cell = planar(2, 4, constraints={"collision": True}, obstacles=[wall])
        stalled(monkeypatch, LocalSearches, "add", after=1)
        found = copose.solve(parse(cell), time_limit=LIMIT)
        assert found.status == "solved" and cut_short(found, ""), found.reason
        assert found.after.collision.distance >= 0.01

    def test_nothing_yet_is_a_failure(self, monkeypatch: pytest.MonkeyPatch) -> None:
        stalled(monkeypatch, global_search, "sample_together", after=0)
        found = copose.solve(parse(planar(2, 4)), time_limit=LIMIT)
        assert found.status == "failed" and found.after is None
        assert found.reason.startswith(f"stopped by the limit of {LIMIT} s while closing arm a2")

    def test_placements(self, monkeypatch: pytest.MonkeyPatch) -> None:
        cell = planar(2, 4)
        cell["object"]["freedom"] = {"x": [-0.1, 0.1]}
        stalled(monkeypatch, PlacedPolisher, "direction", after=2)
        found = copose.solve(parse(cell), time_limit=5.0)
        assert found.status == "solved"
        assert any("while climbing" in note for note in found.notes)
        assert copose.verify(parse(cell), found) == ()

    def test_a_verification_that_is_cut_short(self, monkeypatch: pytest.MonkeyPatch) -> None:
        problem = parse(planar(2, 4))
        best = copose.solve(problem)
        stalled(monkeypatch, Run, "_verified")
        found = copose.solve(problem, verify=True, time_limit=3.0)
        assert found.after == best.after and found.search.verification is None
        assert any("the best so far" in note for note in found.notes)

    @pytest.mark.parametrize(
        ("owner", "name", "after"), [(Refiner, "finished", 0), (CandidateSearch, "_direct", 1)]
    )
    def test_the_best_motion_so_far(
        self, owner: type, name: str, after: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        cell = hinged(knots=25)
        stalled(monkeypatch, owner, name, after=after)
        found = copose.plan(parse(cell), time_limit=3.0)
        assert found.status == "solved"
        assert any("the best so far" in note for note in found.notes)
        assert faults(cell, json.loads(found.model_dump_json())) == []

    def test_no_motion_yet(self, monkeypatch: pytest.MonkeyPatch) -> None:
        stalled(monkeypatch, CandidateSearch, "outcome")
        found = copose.plan(parse(hinged()), time_limit=LIMIT)
        assert found.status == "failed" and found.knots is None
        assert found.reason.endswith("while finding routes: no motion was found yet")

    def test_what_a_limit_does_not_reach_is_the_same(self) -> None:
        problem = parse(planar(2, 4))
        timeless = {"timing": None}
        one, other = (
            copose.solve(problem, time_limit=limit).model_copy(update=timeless)
            for limit in (None, 600.0)
        )
        assert one == other


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("p.toml").write_text(toml(planar(2, 4)))
    return tmp_path


def names(folder: str) -> list[str]:
    return sorted(file.name for file in Path(folder).iterdir())


class TestCommand:
    @pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "soon"])
    @pytest.mark.parametrize("command", ["solve", "path"])
    def test_what_is_no_limit_is_wrong_input(
        self, command: str, text: str, here: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert main([command, "p.toml", f"--time-limit={text}"]) == 2
        wrong = f"copose: argument --time-limit: {text!r} is no finite number of seconds above 0"
        assert capsys.readouterr().err.startswith(wrong)

    @pytest.mark.parametrize("command", ["solve", "path"])
    def test_nothing_yet_is_4(
        self, command: str, here: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        began = time.perf_counter() - 1.0
        assert main([command, "p.toml", "--time-limit", "0.5", "--quiet"], began=began) == 4
        out, err = capsys.readouterr()
        assert out == "" and re.fullmatch(
            r"copose: failed: stopped by the limit of 0.5 s while \w+: (no motion|nothing) was "
            r"found yet\n", err
        )  # fmt: skip
        result = json.loads(Path("cell/result.json").read_text())
        assert result["status"] == "failed" and result["reason"] in err
        assert names("cell") == ["result.json"]

    def test_the_best_so_far_is_0(
        self, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        stalled(monkeypatch, LocalSearches, "add", after=1)
        assert main(["solve", "p.toml", f"--time-limit={LIMIT}"]) == 0
        assert "the best so far" in " ".join(capsys.readouterr().out.split())
        assert names("cell") == ["before_after.png", "result.json"]

    def test_a_line_a_stage_if_it_is_asked_for(
        self, here: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        stages = {
            "check": ["reading"],
            "solve": ["reading", "building", "closing arm a1", "closing arm a2",
                      "comparing postures", "polishing", "drawing"],
        }  # fmt: skip
        for command, wanted in stages.items():
            assert main([command, "p.toml", "--verbose"]) == 0
            lines = capsys.readouterr().err.splitlines()
            shown = r"copose: (\d+\.\d) s: ([^,/]+)(, best so far .*)?"
            told = [re.fullmatch(shown, line) for line in lines]
            assert all(told)
            seen = list(dict.fromkeys(each[2] for each in told))
            assert [name for name in seen if name in wanted] == wanted
            # A line a stage, not one for each of its parts.
            assert all(one[2] != other[2] for one, other in pairwise(told))
        assert main(["check", "p.toml", "--verbose", "--quiet"]) == 2

    def test_a_terminal_sees_what_is_done_before_anything_is_loaded(self, here: Path) -> None:
        import pty

        stuck = (
            "import sys, time, copose.commands.posture as posture, copose.__main__ as command\n"
            "def _prepare(*_): time.sleep(60)\n"
            "posture.prepare = _prepare; sys.exit(command.run())"
        )
        leader, follower = pty.openpty()
        with subprocess.Popen(
            [sys.executable, "-c", stuck, "solve", "p.toml"], stderr=follower,
            env=os.environ | {"TERM": "xterm"},
        ) as process:  # fmt: skip
            os.close(follower)
            seen = b""
            while len(re.findall(rb"[\d.]+ s: reading", seen)) < 2:
                seen += os.read(leader, 4096)
            process.kill()
        os.close(leader)
        times = [float(t) for t in re.findall(rb"([\d.]+) s: reading", seen)]
        # The first word does not wait for CasADi and Pinocchio; time goes on by itself.
        assert times[0] < 0.5 and times == sorted(times)


# An interrupt as often as is asked for when a method of a class is called for the second time.
STRUCK = """
import importlib, signal, sys
import copose.__main__ as command
where, name, method, times = sys.argv[1:5]
sys.argv[1:5] = []
def strike():
    owner = getattr(importlib.import_module(where), name)
    whole, calls = getattr(owner, method), []
    def struck(*given, **options):
        calls.append(method)
        for _ in range(int(times) if len(calls) == 2 else 0):
            signal.raise_signal(signal.SIGINT)
        return whole(*given, **options)
    setattr(owner, method, struck)
import copose.commands.posture as posture
prepare = posture.prepare
posture.prepare = lambda *given: (prepare(*given), strike())[0]
sys.exit(command.run())
"""


def struck(where: str, method: str, times: int = 1) -> tuple[int, str, str]:
    module, _, name = where.rpartition(".")
    answer = subprocess.run(
        [sys.executable, "-c", STRUCK, module, name, method, str(times), "solve", "p.toml"],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    return answer.returncode, answer.stdout, answer.stderr


class TestInterrupts:
    def test_the_first_leaves_the_best_so_far(self, here: Path) -> None:
        written = "copose: interrupted: the best so far is in cell/result.json\n"
        assert struck("copose.posture.local.multistart.LocalSearches", "add") == (130, "", written)
        result = json.loads(Path("cell/result.json").read_text())
        assert result["status"] == "solved" and names("cell") == ["result.json"]
        assert any(note.startswith("interrupted while polishing: ") for note in result["notes"])
        assert copose.verify(parse(planar(2, 4)), copose.read_solution("cell/result.json")) == ()

    def test_with_nothing_found_nothing_is_written(self, here: Path) -> None:
        end = struck("copose.self_motion.sampling.ArmSampler", "draw")
        assert end == (130, "", "copose: interrupted\n") and not Path("cell").exists()

    def test_the_second_ends_the_process(self, here: Path) -> None:
        end = struck("copose.posture.local.multistart.LocalSearches", "add", 2)
        assert end == (130, "", "copose: interrupted\n") and not Path("cell").exists()
