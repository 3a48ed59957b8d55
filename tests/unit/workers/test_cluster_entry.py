"""What needs no Dask: its absence, addresses, versions."""

import subprocess
import sys
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version

import pytest

from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.workers.cluster import Processor, processor, require_same_processor, require_same_versions
from cpfls_cli.workers.workforce import employ, require_address

OWN = processor()


class Client:
    """A connection to workers of which one has something else."""

    def __init__(self, package, answer):
        self.package, self.answer = package, answer

    def run(self, function, *arguments, on_error):
        assert on_error == "return"
        own = function(*arguments)
        other = self.answer if arguments == (self.package,)[: len(arguments)] else own
        return {"tcp://10.0.0.1:40001": own, "tcp://10.0.0.2:40001": other}


def test_equal_versions_pass():
    require_same_versions(Client("numpy", version("numpy")))


@pytest.mark.parametrize(
    ("package", "answer", "words"),
    [
        ("cpfls", PackageNotFoundError("cpfls"), "has no cpfls, and here is cpfls"),
        ("numpy", "1.0.0", "has numpy 1.0.0, and here is numpy"),
        ("scipy", "1.0.0", "has scipy 1.0.0, and here is scipy"),
        ("numba", "0.1.0", "has numba 0.1.0, and here is numba"),
        ("llvmlite", "0.1.0", "has llvmlite 0.1.0, and here is llvmlite"),
    ],
)
def test_a_worker_with_other_software_is_named(package, answer, words):
    with pytest.raises(ComputationError, match=f"worker tcp://10.0.0.2:40001 {words}.*install the same"):
        require_same_versions(Client(package, answer))


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (Processor("riscv64 u74", OWN.instructions), "runs on riscv64 u74, and here is"),
        (replace(OWN, instructions=OWN.instructions | {"amx-8"}), r"with other instructions \(amx-8\), and here is"),
        (OSError("no compiler"), r"runs on an unknown processor \(no compiler\)"),
    ],
)
def test_a_worker_with_another_processor_is_named(answer, words):
    require_same_processor(Client(None, OWN))
    with pytest.raises(ComputationError, match=f"worker tcp://10.0.0.2:40001 .*{words}.*with this processor only"):
        require_same_processor(Client(None, answer))


def test_without_dask_the_message_says_what_to_install(monkeypatch):
    for module in ("distributed", "cpfls_cli.workers.cluster"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ComputationError, match=r'pip install "cpfls\[dask\]"'):
        employ(print, scheduler="tcp://127.0.0.1:8786")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:8786", "tls://host.example:1", "tcp://[::1]:8786"])
def test_addresses_pass(address):
    require_address(address)


@pytest.mark.parametrize(
    "address", ["", "host", "host:8786", "tcp://host", "tcp://:8786", "foo://host:8786", "tcp://host:x", "tcp://[::1"]
)
def test_other_texts_are_refused(address):
    with pytest.raises(InputError, match="expected tcp://host:port"):
        require_address(address)


def test_dask_is_loaded_only_for_a_scheduler():
    program = (
        "import sys, cpfls_cli.workers.workforce; sys.exit(not {'distributed', 'llvmlite'}.isdisjoint(sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
