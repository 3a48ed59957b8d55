"""Commands in the process of the tests, and what ends their searches too early."""

import itertools
import json
import os
import signal
from contextlib import contextmanager
from functools import cache

import pytest
from typer import testing

from cpfls_cli.cli.stages import app
from cpfls_cli.report import canvas
from cpfls_cli.workers.workforce import employ

# Every call would build all commands anew, which takes longer than most of them run.
testing._get_command = cache(testing._get_command)
_RUNNER = testing.CliRunner()


def invoked(*words):
    """Run a command; give what it printed, its exit code, and any exception."""
    return _RUNNER.invoke(app, [str(word) for word in words])


def run(*words):
    """Run a command; anything but an exit is a bug and is raised."""
    result = invoked(*words)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def done(*words):
    """Run a command that must end well."""
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result


def summary(*words):
    """Give what a command that ends well shows machines."""
    return json.loads(done(*words, "--json").stdout)


def made(*words, at):
    """Give what a command that ends well writes."""
    done(*words, "-o", at)
    return at


run.done, run.summary, run.made = done, summary, made


_FIGURES = {name: vars(canvas._Drawing)[name] for name in ("svg", "rows")} | {"_inline_svg": canvas._inline_svg}


@contextmanager
def undrawn():
    """Leave the pictures of pages away: most of their time, and nothing to a test of their words and numbers."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(canvas, "_inline_svg", lambda *_: "<svg></svg>")
        monkeypatch.setattr(canvas._Drawing, "svg", "<svg></svg>")
        monkeypatch.setattr(canvas._Drawing, "rows", ())
        yield


@contextmanager
def drawn(*, shown=True):
    """Draw them all the same; where they are not `shown`, only what they look like is not worked out."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        for name in ("svg", "rows"):
            monkeypatch.setattr(canvas._Drawing, name, _FIGURES[name])
        if shown:
            monkeypatch.setattr(canvas, "_inline_svg", _FIGURES["_inline_svg"])
        yield


def act_at_evaluation(monkeypatch, number, action):
    """Do something when so many chromosomes are evaluated, over all searches of a command."""
    count = itertools.count(1)

    def counting(evaluate, **options):
        def evaluate_and_count(genes):
            evaluation = evaluate(genes)
            if next(count) == number:
                action()
            return evaluation

        return employ(evaluate_and_count, **options)

    monkeypatch.setattr("cpfls_cli.search.employ", counting)


def interrupt_this_process():
    os.kill(os.getpid(), signal.SIGINT)
