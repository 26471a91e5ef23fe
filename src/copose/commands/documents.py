"""The commands `copose schema` and `copose manual`: texts that ship with the package."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from copose.commands.terminal.output import print_rich, printing
from copose.commands.terminal.parser import Command, CommandParser
from copose.interrupt import ExitStatus


class SchemaCommand(Command):
    """`copose schema`: the JSON Schema of problem files."""

    name = "schema"
    summary = "JSON Schema of problem files, for editors"
    example = "> copose.schema.json"

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`: none."""

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        from copose.problem import SCHEMA, read_text

        with printing():
            sys.stdout.write(read_text(SCHEMA))
        return ExitStatus.SOLVED


class ManualCommand(Command):
    """`copose manual`: a page of the manual, or the list of its topics."""

    name = "manual"
    summary = "the manual, or the list of its topics"
    example = "problem-files"

    def add_arguments(self, parser: CommandParser) -> None:
        """See `Command.add_arguments`."""
        parser.add_argument(
            "topic", action=_TopicAction, nargs="?", metavar="TOPIC", help="what to read about"
        )

    def run(self, arguments: argparse.Namespace) -> int:
        """See `Command.run`."""
        from rich.table import Table

        from copose.manual import page, topics

        if arguments.topic is not None:
            from copose.manual.markdown import ManualPage

            print_rich(ManualPage(page(arguments.topic)))
            return ExitStatus.SOLVED
        table = Table.grid(padding=(0, 2))
        for topic, title in topics().items():
            table.add_row(topic, title)
        print_rich(table)
        return ExitStatus.SOLVED


class _TopicAction(argparse.Action):
    """A topic of the manual, which argcomplete completes."""

    @staticmethod
    def completer(**_: object) -> list[str]:
        """The topics, for argcomplete."""
        from copose.manual import topics

        return list(topics())

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        setattr(namespace, self.dest, values)
