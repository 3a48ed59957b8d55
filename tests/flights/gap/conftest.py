"""The gap workflow on flights of others, with the shipped configs."""

import json
from functools import cache
from pathlib import Path

import pytest

from tests.builders.command_line import run
from tests.builders.recorded_flights import path_of_log

BRIEF = ("--set", "gap.horizon_s=0.1")
CONFIGS = Path(__file__).parents[3] / "configs" / "gap"


@pytest.fixture(scope="session")
def answer_of(tmp_path_factory):
    """Run `cpfls gap` on logs below the folder of flights, once on each, with short free runs; give what it says."""

    @cache
    def call(config, folder, *names, held_out=(), options=()):
        paths = [path_of_log(folder, name) for name in (*names, *held_out)]
        held = [word for path in paths[len(names) :] for word in ("--held-out", path)]
        out = tmp_path_factory.mktemp("gap") / "out"
        words = ("gap", CONFIGS / f"{config}.yaml", *paths[: len(names)], *held, "-o", out, "--json", *BRIEF, *options)
        return json.loads(run.done(*words).stdout)

    return call


@pytest.fixture(scope="session")
def coefficients_of():
    """Coefficients of one named effect, by name."""

    def call(answer, effect):
        (found,) = [entry for entry in answer["effects"] if entry["name"] == effect]
        return found["coefficients"]

    return call
