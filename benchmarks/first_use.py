"""What the first use of each compiled loop takes in a new process: from nothing, and compiled before.

python -m benchmarks.first_use

Processor time of the first call alone; numba itself is loaded before. Compared are processes with an empty cache.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    from benchmarks.shared.measure import table
    from tests.builders.compiled_loops import LOOPS

    rows = []
    for name in LOOPS:
        with tempfile.TemporaryDirectory() as cache:
            environment = dict(os.environ, NUMBA_CACHE_DIR=cache, OPENBLAS_NUM_THREADS="1")
            command = (sys.executable, __file__, name)
            rows.append((name, *(float(subprocess.check_output(command, env=environment)) for _ in range(2))))
    table("first_use", ("loop", "compiling, s", "compiled before, s"), rows)


def first_call(name: str) -> float:
    """Time the first call of a loop after all else was loaded."""
    import numba  # noqa: F401

    import cpfls_cli.identification.samples
    import cpfls_cli.playback.model  # noqa: F401
    from tests.builders.compiled_loops import LOOPS

    start = process_time()
    LOOPS[name]()
    return process_time() - start


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(first_call(sys.argv[1]))
    else:
        main()
