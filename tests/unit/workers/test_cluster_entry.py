"""What needs no Dask: its absence, addresses, versions."""

import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version

import pytest

from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.workers import employ
from cpfls_cli.workers.address import require_address
from cpfls_cli.workers.same_versions import require_same_versions


class Client:
    """A connection to workers of which one has something else."""

    def __init__(self, package, answer):
        self.package, self.answer = package, answer

    def run(self, function, package, on_error):
        assert on_error == "return"
        other = self.answer if package == self.package else function(package)
        return {"tcp://10.0.0.1:40001": function(package), "tcp://10.0.0.2:40001": other}


def test_equal_versions_pass():
    require_same_versions(Client("numpy", version("numpy")))


@pytest.mark.parametrize(
    ("package", "answer", "words"),
    [
        ("cpfls", PackageNotFoundError("cpfls"), "has no cpfls, and here is cpfls"),
        ("numpy", "1.0.0", "has numpy 1.0.0, and here is numpy"),
        ("scipy", "1.0.0", "has scipy 1.0.0, and here is scipy"),
    ],
)
def test_a_worker_with_other_software_is_named(package, answer, words):
    with pytest.raises(ComputationError, match=f"worker tcp://10.0.0.2:40001 {words}.*install the same"):
        require_same_versions(Client(package, answer))


def test_without_dask_the_message_says_what_to_install(monkeypatch):
    for module in ("distributed", "cpfls_cli.workers.cluster"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ComputationError, match=r"pip install 'cpfls\[dask\]'"):
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
    program = "import sys, cpfls_cli.workers; sys.exit('distributed' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
