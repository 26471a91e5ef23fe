"""The process of a local worker: ``python -m copose.batch.cluster.local_worker ADDRESS FOLDER``."""

from __future__ import annotations

import asyncio
import logging
import os
import shutil
import sys
import threading

import dask
from distributed import Worker


def _end_with_parent(folder: str) -> None:
    """End at once, and leave nothing, when the process is gone that holds the other end of the
    standard input.
    """
    os.read(0, 1)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


async def _work(address: str, folder: str) -> None:
    async with Worker(
        address, nthreads=1, memory_limit=0, dashboard=False, local_directory=folder
    ) as worker:
        await worker.finished()


def run(address: str, folder: str) -> None:
    """Work for a scheduler until it, or the parent, is gone."""
    threading.Thread(target=_end_with_parent, args=[folder], daemon=True).start()
    logging.disable()
    # It samples the stack every 10 ms.
    dask.config.set({"distributed.worker.profile.enabled": False})
    asyncio.run(_work(address, folder))


if __name__ == "__main__":
    run(*sys.argv[1:])
