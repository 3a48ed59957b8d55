"""Linear algebra runs on one thread whatever the environment asks for."""

import json
import os
import subprocess
import sys

# Reports, when the command has ended, what it limited and how many threads its libraries had started.
PROGRAM = """
import json, os, sys
sys.argv = {words!r}
from cpfls_cli.cli import main
# The timer that ends what hangs has a thread of its own.
main.end_what_hangs = lambda: None
assert "numpy" not in sys.modules, "numpy has read its limits before they were set"
try:
    main.run()
except SystemExit as end:
    code = end.code
tasks = len(os.listdir("/proc/self/task")) if os.path.isdir("/proc/self/task") else 1
limits = {{name: os.environ[name] for name in os.environ if name.endswith("_THREADS")}}
print(json.dumps([code or 0, "numpy" in sys.modules, tasks, limits]))
"""
LIMITS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def test_one_thread_whatever_the_environment_says(pipeline, study, tmp_path):
    words = ("cpfls", "reduce", study, pipeline.flight, "-o", tmp_path / "out.h5", "-q")
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(words=[*map(str, words)])],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert result.stderr == ""
    code, numerical, tasks, limits = json.loads(result.stdout)
    assert (code, numerical, tasks) == (0, True, 1)
    assert limits == dict.fromkeys(LIMITS, "1")
