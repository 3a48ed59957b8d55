"""Programs that print the tables of the docs: ``python -m benchmarks.NAME --help``, from the root of the repository."""

import os

# The libraries read it when they load; the tables are those of one thread.
os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
