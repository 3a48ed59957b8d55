"""The program in a copy of this process, which need not load it again: that takes longer than most commands run."""

import os
import signal
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

from cpfls_cli.cli import main

NAMES = ("stdin", "stdout", "stderr")


class Forked:
    """A command with streams, signals and an exit code of its own.

    Its streams are files or descriptors; None closes one, as a caller may. `patch` is called in the copy before the
    program, and its environment comes on top of this process's.
    """

    def __init__(self, words, stdout, stderr, *, stdin=0, patch=lambda: None, environment=None):
        self._files = {"stdout": stdout, "stderr": stderr}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            self._pid = os.fork()
        if self._pid == 0:
            os.environ.update(environment or {})
            self._become_program(words, (stdin, stdout, stderr), patch)
        self._status = None

    def _become_program(self, words, streams, patch):
        code = 70
        try:
            for number, stream in enumerate(streams):
                _redirect(number, stream)
            patch()
            sys.argv = ["cpfls", *map(str, words)]
            main.run()
        except SystemExit as end:
            code = end.code or 0
        finally:
            os._exit(code)

    def poll(self):
        """Give the exit code as `subprocess` shows it, None while it runs."""
        if self._status is None:
            pid, status = os.waitpid(self._pid, os.WNOHANG)
            self._status = status if pid else None
        return None if self._status is None else os.waitstatus_to_exitcode(self._status)

    def send(self, number):
        os.kill(self._pid, number)

    def kill(self):
        self.send(signal.SIGKILL)

    def wait(self):
        """Wait for its end; give the exit code, and what it printed into files."""
        if self._status is None:
            _, self._status = os.waitpid(self._pid, 0)
        texts = {name: file.read_text() for name, file in self._files.items() if isinstance(file, Path)}
        return SimpleNamespace(returncode=self.poll(), **texts)


def _redirect(number, stream):
    """Make a stream of Python from a file or descriptor, or leave it closed."""
    if stream is None:
        os.close(number)
        setattr(sys, NAMES[number], None)
        return
    if isinstance(stream, Path):
        stream = os.open(stream, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    if stream != number:
        os.dup2(stream, number)
    if number > 0:
        setattr(sys, NAMES[number], os.fdopen(number, "w", buffering=1))


def finished(words, folder, **options):
    """Run a command to its end; give its exit code and what it printed, by way of files in a folder."""
    return Forked(words, folder / ".stdout", folder / ".stderr", **options).wait()
