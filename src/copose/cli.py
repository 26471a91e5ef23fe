"""The command `copose`."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeAlias

from copose import export_command, interrupt, live_command
from copose.errors import InputError, one_line, shown
from copose.progress import sheltered, stage
from copose.terminal import print_line, print_place, print_rich, printing, tell, watching
from copose.version import __version__

if TYPE_CHECKING:
    from rich.console import RenderableType

    from copose.problem import Problem
    from copose.report.figures.files import Style
    from copose.results import Motion, Solution

SOLVED, WRONG_INPUT, INFEASIBLE, FAILED = 0, 2, 3, 4
READER_GONE = 128 + 13
_STATUS = {"solved": SOLVED, "infeasible": INFEASIBLE, "failed": FAILED}
_RESULT, _PICTURE = "result.json", "before_after.png"
_TRAJECTORY, _ROS, _WAY, _FILM = "trajectory.csv", "trajectory.yaml", "path.png", "path.gif"
_FIGURE = "also draw a .png, .pdf or .svg"
_MISS = f"{_FIGURE}; of an infeasible problem, its nearest miss"


def main(argv: Sequence[str] | None = None, *, began: float | None = None) -> int:
    """Run a command line and return its exit status.

    Args:
        argv: the command line; default that of the process.
        began: when the command did, on the clock of `time.perf_counter`; default now.
    """
    began = time.perf_counter() if began is None else began
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    try:
        try:
            parser = _parser()
            _complete(parser)
            arguments = parser.parse_args(argv)
        except SystemExit:
            # After --help and --version: mistakes are input errors here.
            with printing():
                return SOLVED
        arguments.began = began
        status: int = arguments.run(arguments)
        return status
    except InputError as error:
        tell(str(error))
        return WRONG_INPUT
    except BrokenPipeError:
        return READER_GONE


def _complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that completes a line, if it is one that asks, and end the process."""
    if "_ARGCOMPLETE" in os.environ:
        with contextlib.suppress(ImportError):
            import argcomplete

            argcomplete.autocomplete(parser)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        # argparse would print its usage over several lines.
        raise InputError(f"{one_line(message)} (see {self.prog} --help)")

    def print_help(self, file: object = None) -> None:
        # argparse would pass over a reader that has gone.
        with printing():
            sys.stdout.write(self.format_help())


_Commands: TypeAlias = "argparse._SubParsersAction[_Parser]"
_Run: TypeAlias = Callable[[argparse.Namespace], int]


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="copose",
        description="The most dexterous posture of several robot arms holding one object together.",
    )
    parser.add_argument("--version", action="version", version=f"copose {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_Parser)

    _add_init(commands)

    solve = _command(
        commands, "solve", "find the best posture", _solve,
        "problems/two-panda-box.toml -o panda --set object.mass=3 --verify",
    )  # fmt: skip
    _add_outputs(solve, (_PICTURE,), _MISS)
    _add_aim(solve)
    _add_search(solve)
    solve.add_argument(
        "--effort", choices=("low", "normal", "high"), default="normal",
        help="how much is searched (default: normal)",
    )  # fmt: skip
    solve.add_argument(
        "--verify", action="store_true",
        help="search again, another seed and twice the effort, and say whether the answer stands",
    )  # fmt: skip

    evaluate = _command(
        commands, "evaluate", "the ellipsoids of the file's start", _evaluate,
        "problems/two-panda-box.toml --joints panda/result.json --figure panda.pdf",
    )  # fmt: skip
    _add_outputs(evaluate, (_PICTURE,), _MISS)
    _add_aim(evaluate)
    evaluate.add_argument(
        "--joints", type=Path, metavar="RESULT.json", help="measure this result's posture instead"
    )

    path = _command(
        commands, "path", "the best joint motion along an object path", _path,
        "problems/panda-carry-path.toml -o carried --ros --animate",
    )  # fmt: skip
    _add_outputs(path, (_TRAJECTORY, _WAY), _FIGURE)
    _add_search(path)
    path.add_argument(
        "--ros", action="store_true",
        help=f"also write {_ROS}, a trajectory_msgs/JointTrajectory",
    )  # fmt: skip
    path.add_argument("--animate", action="store_true", help=f"also draw {_FILM}")

    compare = _added(
        commands, "compare", "two results side by side", _compare,
        "panda/result.json worst/result.json --figure compare.pdf",
    )  # fmt: skip
    compare.add_argument("one", type=Path, metavar="A.json")
    compare.add_argument("other", type=Path, metavar="B.json")
    compare.add_argument(
        "--figure", type=Path, metavar="FILE", default=Path("compare.png"),
        help="the picture, a .png, .pdf or .svg (default: compare.png)",
    )  # fmt: skip
    _add_style(compare)
    _add_telling(compare)

    export = _added(
        commands, "export", "a posture or a motion for another program", _export,
        "panda/result.json --to moveit -o panda.yaml",
    )  # fmt: skip
    export_command.add_arguments(export)
    _add_telling(export)

    live = _command(
        commands, "live", "a page in the browser: drag the object, the arms follow", _live,
        "problems/two-panda-box.toml --port 8081",
    )  # fmt: skip
    live_command.add_arguments(live)
    _add_aim(live)
    _add_telling(live)

    _added(
        commands, "schema", "JSON Schema of problem files, for editors", _schema,
        "> copose.schema.json",
    )  # fmt: skip

    manual = _added(
        commands, "manual", "the manual, or the list of its topics", _manual, "problem-files"
    )
    topic = manual.add_argument("topic", nargs="?", metavar="TOPIC", help="what to read about")
    topic.completer = _topics  # type: ignore[attr-defined]

    check = _command(
        commands, "check", "read the file and the robots, and print the chains", _check,
        "problems/two-panda-box.toml --figure start.png",
    )  # fmt: skip
    check.add_argument(
        "--figure", type=Path, metavar="FILE",
        help="draw bodies and frames at the start into a .png, .pdf or .svg",
    )  # fmt: skip
    _add_style(check)
    _add_telling(check)
    return parser


def _add_init(commands: _Commands) -> None:
    init = _added(
        commands, "init", "make a problem file from robots; guesses have a comment", _init,
        "example-robot-data://panda_description/urdf/panda.urdf --mass 2 -o cell.toml",
    )  # fmt: skip
    init.add_argument(
        "robots", nargs="+", metavar="ROBOT",
        help="a URDF or MuJoCo model with several arms, or several: a path, package://… or "
        "example-robot-data://…",
    )  # fmt: skip
    init.add_argument(
        "-o", "--output", type=Path, metavar="FILE.toml",
        help="the problem file (default: the robots' names)",
    )  # fmt: skip
    init.add_argument(
        "--tip", action="append", default=[], metavar="[NAME=]LINK",
        help="a link that grasps, and what its arm is called (repeatable)",
    )  # fmt: skip
    init.add_argument(
        "--joints", action="append", default=[], type=_named_numbers, metavar="ARM=Q1,Q2,…",
        help="joint positions, rad or m: the arms hold the object as they are (repeatable)",
    )  # fmt: skip
    init.add_argument("--mass", type=_positive, metavar="KG", help="of the object")
    init.add_argument("--size", type=_edges, metavar="X,Y,Z", help="of the box that it is, m")
    init.add_argument(
        "--space", choices=("spatial", "spatial-linear"), help="rigid grasps, or ball joints"
    )
    init.add_argument("--overwrite", action="store_true", help="replace a file that is there")
    _add_telling(init)


def _topics(**_: object) -> list[str]:
    from copose.manual import topics

    return list(topics())


def _added(commands: _Commands, name: str, text: str, run: _Run, example: str) -> _Parser:
    """A command with a help that ends in an example of its arguments."""
    command = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}.",
        epilog=f"example:\n  copose {name} {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.set_defaults(run=run)
    return command


def _command(commands: _Commands, name: str, text: str, run: _Run, example: str) -> _Parser:
    """A command that a problem file is given to."""
    command = _added(commands, name, text, run, example)
    command.add_argument("problem", type=Path, metavar="PROBLEM.toml", help="the problem file")
    command.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE",
        help="in place of the file's, such as arms.left.base.position.y=0.4; repeatable",
    )  # fmt: skip
    return command


def _add_outputs(command: argparse.ArgumentParser, beside: tuple[str, ...], figure: str) -> None:
    *others, last = _RESULT, *beside
    command.add_argument(
        "-o", "--output", type=Path, metavar="DIR",
        help=f"folder for {', '.join(others)} and {last} (default: the problem's name)",
    )  # fmt: skip
    command.add_argument("--figure", type=Path, metavar="FILE", help=figure)
    _add_style(command)
    _add_telling(command)
    command.add_argument("--json", action="store_true", help="print the result instead of a table")


def _add_style(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--style", choices=("bodies", "sticks"), default="bodies",
        help="how pictures show arms in space (default: bodies)",
    )  # fmt: skip


def _add_search(command: argparse.ArgumentParser) -> None:
    command.add_argument("--seed", type=_seed, metavar="N", help="in place of the file's seed")
    command.add_argument(
        "--time-limit", type=_seconds, metavar="S",
        help="the best found S seconds after the command began, writing apart",
    )  # fmt: skip


def _add_aim(command: argparse.ArgumentParser) -> None:
    command.add_argument("--objective", metavar="KIND", help="in place of the file's")
    command.add_argument(
        "--direction", nargs="+", type=float, metavar="NUMBER",
        help="of the objective; three in space are linear; alone: task-compatibility",
    )  # fmt: skip


def _add_telling(command: argparse.ArgumentParser) -> None:
    told = command.add_mutually_exclusive_group()
    told.add_argument("--quiet", action="store_true", help="print no table, show no progress")
    told.add_argument(
        "--verbose", action="store_true",
        help="tell more of the search, and print a line a stage on stderr",
    )  # fmt: skip


def _seed(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text[:20]) >= 2**63:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no whole number from 0 to 2⁶³ − 1")
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 < seconds < math.inf:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no finite number of seconds above 0")
    return seconds


def _numbers(text: str) -> list[float]:
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if not values or not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError(f"{shown(text)}: numbers apart by commas are needed")
    return values


def _positive(text: str) -> float:
    values = _numbers(text)
    if len(values) != 1 or values[0] <= 0:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no number above zero")
    return values[0]


def _edges(text: str) -> list[float]:
    values = _numbers(text)
    if len(values) != 3 or min(values) <= 0:
        raise argparse.ArgumentTypeError(f"{shown(text)}: three numbers above zero are needed")
    return values


def _named_numbers(text: str) -> tuple[str, list[float]]:
    name, equals, values = text.partition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f"{shown(text)}: ARM=Q1,Q2,… is needed")
    return name, _numbers(values)


def _init(arguments: argparse.Namespace) -> int:
    with watching(arguments):
        from copose.setup import Wishes, default_name, draft

        file = arguments.output
        if file is None:
            file = Path(f"{default_name(arguments.robots)}.toml")
        _check_place(file)
        if file.exists() and not arguments.overwrite:
            raise InputError("is there already; --overwrite replaces it", file=file)
        wishes = Wishes(
            tips=arguments.tip,
            joints=dict(arguments.joints),
            mass=arguments.mass,
            size=arguments.size,
            space=arguments.space,
        )
        made = draft(arguments.robots, file, wishes)
        from copose.results import write_file

        write_file(file, made.text.encode())
    if not arguments.quiet:
        from copose.report import guesses

        print_rich(guesses(made.guesses))
        print_place(file)
    missed = [start for start in made.starts if not start.closed]
    if missed:
        told = (f"arm {start.arm.name!r} misses its grasp by {start.miss}" for start in missed)
        tell(f"no posture that closes was found: {'; '.join(told)}")
        return INFEASIBLE
    return SOLVED


def _solve(arguments: argparse.Namespace) -> int:
    with watching(arguments) as watch:
        folder, problem = _prepare(arguments, (_PICTURE,))
        from copose.posture import solve

        with _on_interrupt(watch.interrupt):
            solution = solve(
                problem,
                seed=arguments.seed,
                effort=arguments.effort,
                verify=arguments.verify,
                time_limit=arguments.time_limit,
            )
        if watch.interrupted:
            return _interrupted(solution, folder, {})
        _write_solution(solution, folder, arguments)
    return _say_solution(solution, folder, arguments)


def _path(arguments: argparse.Namespace) -> int:
    wanted = {_TRAJECTORY: True, _ROS: arguments.ros, _WAY: True, _FILM: arguments.animate}
    with watching(arguments) as watch:
        folder, problem = _prepare(arguments, [name for name, asked in wanted.items() if asked])
        from copose.motion import plan

        with _on_interrupt(watch.interrupt):
            motion = plan(problem, seed=arguments.seed, time_limit=arguments.time_limit)
        from copose.formats import joint_trajectory_yaml, trajectory_csv
        from copose.report import motion_animation, motion_table, picture

        makers: dict[str, Callable[[], bytes]] = {
            _TRAJECTORY: lambda: trajectory_csv(motion).encode(),
            _ROS: lambda: joint_trajectory_yaml(motion).encode(),
            _WAY: lambda: picture(motion, "png", arguments.style),
            _FILM: lambda: motion_animation(motion, arguments.style),
        }
        solved = motion.status == "solved"
        beside = {name: make for name, make in makers.items() if solved and wanted[name]}
        if watch.interrupted:
            quick = {name: beside[name] for name in (_TRAJECTORY, _ROS) if name in beside}
            return _interrupted(motion, folder, quick)
        figure = arguments.figure if solved else None
        _write(motion, folder, beside, figure, arguments.style)
    return _say(motion, motion_table(motion, verbose=arguments.verbose), folder, arguments)


def _evaluate(arguments: argparse.Namespace) -> int:
    with watching(arguments):
        folder, problem = _prepare(arguments, (_PICTURE,))
        from copose.posture import evaluate
        from copose.results import read_solution

        result = None if arguments.joints is None else read_solution(arguments.joints)
        try:
            solution = evaluate(problem, result)
        except InputError as error:
            if error.file is None:
                raise InputError(error.message, key=error.key, file=arguments.joints) from None
            raise
        _write_solution(solution, folder, arguments)
    return _say_solution(solution, folder, arguments)


def _compare(arguments: argparse.Namespace) -> int:
    with watching(arguments):
        from copose.report import check_format, compare, comparison_table, draw_comparison
        from copose.results import read_solution

        check_format(arguments.figure)
        _check_place(arguments.figure)
        files = arguments.one, arguments.other
        one, other = (read_solution(file) for file in files)
        found = compare(one, other, (str(files[0]), str(files[1])))
        stage("drawing")
        with _spared(arguments.figure):
            draw_comparison(found, arguments.figure, arguments.style)
    if not arguments.quiet:
        print_rich(comparison_table(found))
        print_place(arguments.figure)
    return SOLVED


def _export(arguments: argparse.Namespace) -> int:
    with watching(arguments):
        file, names = export_command.export_result(arguments)
    if not arguments.quiet:
        if names:
            print_line(names)
        print_place(file)
    return SOLVED


def _live(arguments: argparse.Namespace) -> int:
    with watching(arguments):
        from copose.live.handle import check_installed

        check_installed()
        problem = _load(arguments)
    live_command.serve(problem, arguments)
    return interrupt.INTERRUPTED


def _check(arguments: argparse.Namespace) -> int:
    with watching(arguments):
        from copose.motion import described
        from copose.posture import check
        from copose.report import chains, check_format, draw_start

        figure = arguments.figure
        if figure is not None:
            check_format(figure)
            _check_place(figure)
        problem = _load(arguments)
        found = check(problem)
        way = described(problem, found.arms)
        if figure is not None:
            stage("drawing")
            with _spared(figure):
                draw_start(problem, found.starts, figure, arguments.style)
    print_rich(chains(problem, found.starts, found.notes, way))
    if figure is not None:
        print_place(figure)
    return SOLVED


def _schema(arguments: argparse.Namespace) -> int:
    from copose.problem import SCHEMA, read_text

    with printing():
        sys.stdout.write(read_text(SCHEMA))
    return SOLVED


def _manual(arguments: argparse.Namespace) -> int:
    from rich.table import Table

    from copose.manual import page, topics

    if arguments.topic is not None:
        from copose.manual.markdown import Page

        print_rich(Page(page(arguments.topic)))
        return SOLVED
    table = Table.grid(padding=(0, 2))
    for topic, title in topics().items():
        table.add_row(topic, title)
    print_rich(table)
    return SOLVED


def _prepare(arguments: argparse.Namespace, beside: Sequence[str]) -> tuple[Path, Problem]:
    """The problem and the folder for its answer, both known to be usable before anything runs."""
    from copose.report import check_format

    if arguments.figure is not None:
        check_format(arguments.figure)
        _check_place(arguments.figure)
    problem = _load(arguments)
    folder = arguments.output if arguments.output is not None else Path(problem.name)
    for name in (_RESULT, *beside):
        _check_place(folder / name)
    return folder, problem


def _load(arguments: argparse.Namespace) -> Problem:
    from copose.loader import load
    from copose.problem import read_override

    changes: dict[str, object] = {}
    for key, value in map(read_override, arguments.set):
        # What is set again counts where it stands last.
        changes.pop(key, None)
        changes[key] = value
    asked = vars(arguments)
    return load(
        arguments.problem,
        set=changes,
        objective=asked.get("objective"),
        direction=asked.get("direction"),
    )


def _check_place(file: Path) -> None:
    """Refuse a place that no file can be written to, before anything is."""
    folder = file.parent
    try:
        if file.is_dir():
            raise InputError("is a folder; a file was expected", file=file)
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=file) from None
    if not existing.is_dir():
        raise InputError("is a file; a folder was expected", file=existing)
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError("is a folder that you may not write to", file=existing)


def _write_solution(solution: Solution, folder: Path, arguments: argparse.Namespace) -> None:
    from copose.report import picture

    solved = solution.status == "solved"
    beside = {_PICTURE: lambda: picture(solution, "png", arguments.style)} if solved else {}
    _write(solution, folder, beside, arguments.figure, arguments.style)


def _say_solution(solution: Solution, folder: Path, arguments: argparse.Namespace) -> int:
    from copose.report import solution_table

    return _say(solution, solution_table(solution, verbose=arguments.verbose), folder, arguments)


def _write(
    answer: Solution | Motion,
    folder: Path,
    beside: Mapping[str, Callable[[], bytes]],
    figure: Path | None = None,
    style: Style = "bodies",
) -> None:
    """A result, then what lies beside it in place of an earlier run's, and a figure elsewhere."""
    from copose.report import draw
    from copose.results import to_json, write_file

    for name in (_PICTURE, _TRAJECTORY, _ROS, _WAY, _FILM):
        with _spared(folder / name):
            (folder / name).unlink(missing_ok=True)
    write_file(folder / _RESULT, to_json(answer).encode())
    if beside or figure is not None:
        stage("drawing")
    with _on_interrupt(partial(interrupt.end, f": the answer is in {folder / _RESULT}")):
        for name, make in beside.items():
            with _spared(folder / name):
                write_file(folder / name, make())
        if figure is not None:
            with _spared(figure):
                draw(answer, figure, style)


@contextlib.contextmanager
def _spared(file: Path) -> Iterator[None]:
    """A file that an answer can do without: where it fails, a line says so."""
    try:
        yield
    except InputError as error:
        tell(f"warning: {error}")
    except Exception as error:
        # Whatever may go wrong in a drawing: fonts, settings, what Matplotlib itself lacks.
        tell(f"warning: {file}: {type(error).__name__}: {error}")


def _say(
    answer: Solution | Motion, table: RenderableType, folder: Path, arguments: argparse.Namespace
) -> int:
    """Print an answer, and return its exit status."""
    if arguments.json:
        from copose.results import to_json

        with printing():
            sys.stdout.write(to_json(answer))
    elif not arguments.quiet:
        print_rich(table)
        print_place(folder)
    if answer.reason is not None:
        tell(f"{answer.status}: {answer.reason}")
    return _STATUS[answer.status]


@contextlib.contextmanager
def _on_interrupt(act: Callable[[], None]) -> Iterator[None]:
    """A first ^C that does not end the process; the next does what it did before."""
    before = signal.getsignal(signal.SIGINT)
    if not callable(before) or threading.current_thread() is not threading.main_thread():
        yield
        return

    def first(*_: object) -> None:
        signal.signal(signal.SIGINT, before)
        act()

    signal.signal(signal.SIGINT, first)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _interrupted(
    answer: Solution | Motion, folder: Path, beside: Mapping[str, Callable[[], bytes]]
) -> int:
    """Write what an interrupted command has found, without pictures, which take a second or two,
    and say so.
    """
    written = ""
    if answer.status == "solved":
        with sheltered():
            _write(answer, folder, beside)
        written = f": the best so far is in {folder / _RESULT}"
    tell(f"interrupted{written}")
    return interrupt.INTERRUPTED
