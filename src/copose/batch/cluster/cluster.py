"""The lines of a study's points from a Dask cluster."""

from __future__ import annotations

import contextlib
import logging
import re
import socket
import warnings
from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING

from copose.batch.point_solver import Recipe
from copose.errors import InputError, shown
from copose.progress import stage
from copose.studies.points.points import Point
from copose.studies.robot_files import RobotFiles

if TYPE_CHECKING:
    from distributed import Client

    from copose.batch.cluster.local_workers import LocalWorkers


def cluster_lines(
    recipe: Recipe,
    points: Iterator[Point],
    robots: RobotFiles,
    workers: int,
    scheduler: str | None = None,
) -> Generator[str, None, None]:
    """The lines of points, as JSON, in the order in which workers send them: processes of a local
    cluster, or those of a scheduler that exists at an address. Points are taken as workers need
    them.

    Raises:
        StoppedError: the call has to end.
        SchedulerLostError: the scheduler is gone; what was yielded stays.
        InputError: Dask is not installed, no scheduler answers, or a worker cannot solve points.
        CoposeError: local workers die as they start.
    """
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "workers need Dask, which is not installed; pip install 'copose[study]'"
        ) from None
    from copose.batch.cluster.dispatcher import Dispatcher

    stage("waiting for workers")
    with _quiet(), _connected(workers, scheduler) as (client, local):
        yield from Dispatcher(client, recipe, points, robots, local).lines()


@contextlib.contextmanager
def _connected(
    workers: int, scheduler: str | None, patience: float = 5.0
) -> Iterator[tuple[Client, LocalWorkers | None]]:
    """A client of a scheduler that exists, or of one in this process, with its workers; one that
    does not answer so long, s, is not there.
    """
    from distributed import LocalCluster

    from copose.batch.cluster.local_workers import LocalWorkers

    with contextlib.ExitStack() as stack:
        if scheduler is not None:
            yield stack.enter_context(_client(scheduler, patience)), None
            return
        cluster = stack.enter_context(
            LocalCluster(
                n_workers=0,
                threads_per_worker=1,
                dashboard_address=None,
                scheduler_kwargs={"allowed_failures": 0, "dashboard_address": "127.0.0.1:0"},
            )
        )
        client = stack.enter_context(_client(cluster.scheduler_address, patience))
        local = LocalWorkers(workers, cluster.scheduler_address)
        stack.callback(local.stop)
        yield client, local


@contextlib.contextmanager
def _client(address: str, patience: float) -> Iterator[Client]:
    """A client of the scheduler at an address.

    Raises:
        InputError: it is no address, or no scheduler answers there.
    """
    from distributed import Client

    parts = re.fullmatch(r"(tcp|tls|ws|wss)://\[?([^\s/\]]+)\]?:(\d{1,5})", address)
    if parts is None:
        raise InputError(
            f"{shown(address)} is no address of a Dask scheduler; tcp://HOST:PORT is expected",
            key="--scheduler",
        )
    try:
        if parts[1] == "tcp":
            _greeted(parts[2], int(parts[3]), patience)
        client = Client(address, timeout=patience, set_as_default=False)
    except (OSError, OverflowError, ValueError, ImportError):
        raise InputError(f"no Dask scheduler answers at {address}", key="--scheduler") from None
    try:
        yield client
    finally:
        with contextlib.suppress(OSError, TimeoutError):
            client.close(timeout=1)


def _greeted(host: str, port: int, patience: float) -> None:
    """Wait for a scheduler's first byte; for that of another server Dask would wait forever.

    Raises:
        OSError: nobody is there, or says nothing.
    """
    with socket.create_connection((host, port), timeout=patience) as connection:
        if not connection.recv(1):
            raise OSError


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """A time in which Dask says nothing: what matters is told in copose's words."""
    # Some of them have levels of their own.
    names = [
        name
        for name in logging.root.manager.loggerDict
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio")
    ]
    loggers = [logging.getLogger(name) for name in names]
    levels = [logger.level for logger in loggers]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        try:
            yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.setLevel(level)
