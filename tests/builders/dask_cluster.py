"""A Dask scheduler and its workers as processes on the loopback."""

import os
import re
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[2]
# Each process looks at its own stack a hundred times in a second otherwise, and at the machine.
UNWATCHED = {
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "10s",
}


@contextmanager
def running(folder, *words, announced=None):
    """A process of Dask that ends with the context, and what it prints after some words."""
    # A folder for its own temporary files, and the threads that a machine gives by itself.
    free = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    with subprocess.Popen(
        [sys.executable, "-m", *words, "--no-dashboard"],
        cwd=folder,
        env=free | UNWATCHED | {"PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE if announced else subprocess.DEVNULL,
        text=True,
    ) as process:
        try:
            yield (
                process,
                announced and next(match[1] for line in process.stderr if (match := re.search(announced, line))),
            )
        finally:
            process.kill()


@contextmanager
def dask_cluster(folder, workers, tls=()):
    """Give the address of a scheduler, its process, and the processes of its workers.

    `tls` holds more options of both, such as those that name certificates.
    """
    from distributed import Client

    scheduler = ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-show", *tls]
    if tls:
        scheduler += ["--protocol", "tls"]
    with ExitStack() as stack:
        announced = r"Scheduler at:\s+(t\w+://\S+)"
        process, address = stack.enter_context(running(folder, *scheduler, announced=announced))
        worker = ["distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny", *tls]
        others = [stack.enter_context(running(folder, *worker))[0] for _ in range(workers)]
        if workers:
            with Client(address, set_as_default=False) as client:
                client.wait_for_workers(workers, timeout=60)
        yield address, process, others
