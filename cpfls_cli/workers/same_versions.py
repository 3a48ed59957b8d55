"""The same software on all workers of a cluster, because other versions may give other digits."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

from cpfls_cli.workers.worker_error import WorkerError

if TYPE_CHECKING:
    from distributed import Client

_PACKAGES = ("cpfls", "numpy", "scipy")


def require_same_versions(client: Client) -> None:
    """Require that all workers have the packages that make the result, in the versions of this process.

    Parameters
    ----------
    client : Client
        Connection to a scheduler with workers.

    Raises
    ------
    WorkerError
        Naming the first worker and package that differ.
    """
    for package in _PACKAGES:
        here = version(package)
        for worker, answer in client.run(version, package, on_error="return").items():
            if answer != here:
                raise WorkerError(
                    f"the Dask worker {worker} has {_words(package, answer)}, and here is {package} {here}: "
                    "install the same versions everywhere"
                )


def _words(package: str, answer: object) -> str:
    if isinstance(answer, PackageNotFoundError):
        return f"no {package}"
    return f"{package} {answer}"
