"""The gap workflow on flights of others, with the shipped configs."""

import json
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cpfls_cli.cli.app import app

FLIGHTS = Path(os.environ.get("CPFLS_FLIGHTS", "../shared/data"))
CONFIGS = Path(__file__).parents[3] / "configs" / "gap"


@pytest.fixture(scope="session")
def answer_of(tmp_path_factory):
    """Run `cpfls gap` on logs below the folder of flights; what it says, for machines."""

    def call(config, folder, *names, held_out=(), options=()):
        paths = [FLIGHTS / folder / f"{name}.csv" for name in (*names, *held_out)]
        for path in paths:
            if not path.exists():
                pytest.skip(f"{path} is absent; set CPFLS_FLIGHTS to the folder of other people's flights")
        held = [word for path in paths[len(names) :] for word in ("--held-out", path)]
        out = tmp_path_factory.mktemp("gap") / "out"
        words = ("gap", CONFIGS / f"{config}.yaml", *paths[: len(names)], *held, "-o", out, "--json", *options)
        result = CliRunner().invoke(app, [str(word) for word in words])
        assert result.exit_code == 0, result.stderr
        return json.loads(result.stdout)

    return call


@pytest.fixture(scope="session")
def coefficients_of():
    """Coefficients of one named effect, by name."""

    def call(answer, effect):
        (found,) = [entry for entry in answer["effects"] if entry["name"] == effect]
        return found["coefficients"]

    return call
