"""The command `copose study`: many problems, their record, its table and its map."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from copose.commands.terminal.answer import spared
from copose.commands.terminal.interrupts import on_interrupt, serve
from copose.commands.terminal.output import print_place, print_rich, tell, watching
from copose.commands.terminal.parser import (
    Command,
    CommandParser,
    add_page,
    add_verbosity,
    count,
    seconds,
)
from copose.commands.terminal.problem_input import check_place
from copose.errors import InputError
from copose.interrupt import ExitStatus
from copose.progress import sheltered, stage

if TYPE_CHECKING:
    from copose.batch import RunOutcome
    from copose.studies import Study, StudyFolder, StudyTable


class StudyCommand(Command):
    """`copose study`: many problems, their record, its table and its map."""

    name = "study"
    summary = "many problems, and a map of their answers"
    example = "problems/studies/box-over-table.toml --workers 2 --best 3"

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        parser.add_argument(
            "study", type=Path, metavar="STUDY.toml",
            help="the study file, or the folder of a study that was run",
        )  # fmt: skip
        parser.add_argument(
            "-o", "--output", type=Path, metavar="DIR",
            help="folder for study.jsonl, study.parquet and map.png (default: the study's name)",
        )  # fmt: skip
        parser.add_argument(
            "--workers", type=count, default=1, metavar="N",
            help="processes of a local Dask cluster (default: 1, a plain loop without Dask)",
        )  # fmt: skip
        parser.add_argument(
            "--scheduler", metavar="ADDRESS",
            help="a Dask scheduler that is there already, such as tcp://10.0.0.1:8786",
        )  # fmt: skip
        parser.add_argument(
            "--point-limit", type=seconds, metavar="S", help="time that a point may take"
        )
        parser.add_argument(
            "--retry", action="store_true",
            help="do points again that a time limit or a crash has ended",
        )  # fmt: skip
        parser.add_argument(
            "--best", type=count, default=0, metavar="N",
            help="also write the problem files of the best N points",
        )  # fmt: skip
        parser.add_argument(
            "--view", action="store_true", help="show the points in the live page, until ^C"
        )
        add_page(parser)
        add_verbosity(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        from copose.studies import StudyFolder, StudyTable

        outcome: RunOutcome | None = None
        with watching(arguments) as watch:
            if arguments.study.is_dir():
                _refuse_run_options(arguments)
                folder = StudyFolder(arguments.study)
                study = folder.study()
            else:
                study, folder = _read(arguments)
                with on_interrupt(watch.interrupt):
                    outcome = _run(study, folder, arguments)
            with sheltered():
                table = StudyTable.of(study, folder)
                _write(table, folder, pictured=outcome is None or not outcome.stopped)
                best = _write_best(table, folder, arguments.best)
        if outcome is not None and outcome.stopped:
            tell(
                f"interrupted: {outcome.done} of {outcome.points} points are in {folder.record}; "
                "the same command goes on"
            )
            return ExitStatus.INTERRUPTED
        if not arguments.quiet:
            from copose.report.studies import study_table

            print_rich(study_table(table, most=max(arguments.best, 3)))
            print_place(folder.path)
            for file in best:
                print_place(file)
        if arguments.view:
            from copose.live import open_study

            return serve(open_study, table, arguments)
        return ExitStatus.SOLVED


def _read(arguments: argparse.Namespace) -> tuple[Study, StudyFolder]:
    """The study of a file and the folder for what comes of it, both known to be usable."""
    from copose.batch import check_study
    from copose.studies import Study, StudyFolder

    study = Study.read(arguments.study)
    folder = arguments.output if arguments.output is not None else Path(study.file.name)
    place = StudyFolder(folder)
    for file in (place.record, place.about, place.parquet, place.picture):
        check_place(file)
    stage("checking every value")
    check_study(study)
    return study, place


def _refuse_run_options(arguments: argparse.Namespace) -> None:
    """Refuse options that a study which is only shown does not have."""
    given = {
        "--output": arguments.output is not None,
        "--workers": arguments.workers > 1,
        "--scheduler": arguments.scheduler is not None,
        "--point-limit": arguments.point_limit is not None,
        "--retry": arguments.retry,
    }
    for option, there in given.items():
        if there:
            text = "is of a study file; a folder is only shown"
            raise InputError(text, key=option, file=arguments.study)


def _run(study: Study, folder: StudyFolder, arguments: argparse.Namespace) -> RunOutcome:
    from copose.batch import RunOptions, run_points

    options = RunOptions(
        workers=arguments.workers,
        scheduler=arguments.scheduler,
        point_limit=arguments.point_limit,
        retry=arguments.retry,
    )
    return run_points(study, folder, options)


def _write(table: StudyTable, folder: StudyFolder, *, pictured: bool) -> None:
    """Write the table as Parquet, and the map."""
    from copose.studies import write_parquet

    if find_spec("pyarrow") is None:
        tell("note: no study.parquet without pyarrow; pip install 'copose[study]'")
    else:
        with spared(folder.parquet):
            write_parquet(table, folder.parquet)
    with spared(folder.picture):
        folder.picture.unlink(missing_ok=True)
    if pictured:
        from copose.report.studies import study_picture
        from copose.results import write_file

        stage("drawing")
        with spared(folder.picture):
            write_file(folder.picture, study_picture(table, "png"))


def _write_best(table: StudyTable, folder: StudyFolder, most: int) -> list[Path]:
    """Write the problem files of the best points; returns where."""
    files = list[Path]()
    for earlier in folder.path.glob("best-*.toml") if most else ():
        earlier.unlink()
    for place, point in enumerate(table.best(most, table.study.file.map.value), start=1):
        from copose.live.problem_file.saving import save_problem

        file = folder.path / f"best-{place}.toml"
        values = {
            **table.values(point),
            "search.seed": table.study.points.seed(point),
            "name": f"{table.study.file.name}-best-{place}",
        }
        with spared(file):
            save_problem(table.study.problems.at(values), file, overwrite=True)
            files.append(file)
    return files
