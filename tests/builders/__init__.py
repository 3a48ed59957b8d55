"""What tests of several packages build: flights, models, artifacts, programs and workers. No tests."""

from cpfls_cli.cli.main import use_one_thread

# Before numpy loads, also where `make` does not say it: on a busy machine threads of linear algebra wait for each other
# many times as long as they compute.
use_one_thread()
