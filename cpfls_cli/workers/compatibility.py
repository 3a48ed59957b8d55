"""The same software and processor for all workers of a cluster, because others may give other digits."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

from cpfls_cli.workers.workforce import WorkerError

if TYPE_CHECKING:
    from distributed import Client

# llvmlite holds the compiler behind numba.
_PACKAGES = ("cpfls", "numpy", "scipy", "numba", "llvmlite")


def require_same_versions(client: Client) -> None:
    """Require that all workers have the packages that make the result, in the versions of this process."""
    for package in _PACKAGES:
        here = version(package)
        for worker, answer in client.run(version, package, on_error="return").items():
            if answer != here:
                raise WorkerError(
                    f"the Dask worker {worker} has {_words(package, answer)}, and here is {package} {here}: "
                    "install the same versions everywhere"
                )


def require_same_processor(client: Client) -> None:
    """Require that the compiler makes the same code for all workers as for this process."""
    here = processor()
    for worker, answer in client.run(processor, on_error="return").items():
        if answer != here:
            raise WorkerError(
                f"the Dask worker {worker} runs on {_described(answer, here)}, and here is {here.name}: other "
                "processors add numbers in another order, which gives other digits; start workers on machines with "
                "this processor only, or start `cpfls` on one like theirs"
            )


def _words(package: str, answer: object) -> str:
    if isinstance(answer, PackageNotFoundError):
        return f"no {package}"
    return f"{package} {answer}"


def _described(answer: object, here: Processor) -> str:
    if not isinstance(answer, Processor):
        return f"an unknown processor ({answer})"
    if answer.name != here.name:
        return answer.name
    return f"{answer.name} with other instructions ({', '.join(sorted(answer.instructions ^ here.instructions))})"


@dataclass(frozen=True)
class Processor:
    """Processor that a compiler makes code for: architecture and model, and extensions that may be used."""

    name: str
    instructions: frozenset[str]


def processor() -> Processor:
    """Describe the processor of this machine."""
    # The compiler behind numba; slow to load, and needed only where workers are elsewhere.
    compiler = import_module("llvmlite.binding")
    usable = (name for name, there in compiler.get_host_cpu_features().items() if there)
    return Processor(f"{platform.machine()} {compiler.get_host_cpu_name()}", frozenset(usable))
