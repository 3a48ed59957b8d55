"""Equal config, seed and inputs give equal bytes, and artifacts say nothing of where and when they were made."""

import re
import socket
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

STAGES = ("trajectory", "flight", "selection", "model")


@pytest.fixture(scope="module")
def again(cpfls, pipeline, study, tmp_path_factory):
    """The same commands a second later, from another folder and into files of other names."""
    time.sleep(1.1)
    folder = tmp_path_factory.mktemp("again")
    out = {stage: folder / f"again-{stage}.h5" for stage in STAGES}
    commands = (
        ("trajectory", study, "-o", out["trajectory"]),
        ("simulate", study, pipeline.trajectory, "-o", out["flight"]),
        ("reduce", study, pipeline.flight, "-o", out["selection"]),
        ("identify", study, pipeline.flight, "--selection", pipeline.selection, "-o", out["model"]),
    )
    for words in commands:
        cpfls.done(*words)
    return out


@pytest.mark.parametrize("stage", STAGES)
def test_same_seed_same_bytes(pipeline, again, stage):
    assert again[stage].read_bytes() == pipeline.paths[stage].read_bytes()


def test_noise_too_comes_from_the_seed(cpfls, pipeline, study, tmp_path):
    files = [tmp_path / f"{number}.h5" for number in range(3)]
    for path, seed in zip(files, (5, 5, 6), strict=True):
        noise = ("--set", "simulation.relative_noise={torque: 0.05}", "--seed", seed)
        cpfls.done("simulate", study, pipeline.trajectory, "-o", path, *noise)
    first, same, other = (path.read_bytes() for path in files)
    assert first == same
    assert first != other


def test_another_seed_gives_another_model(cpfls, pipeline, study, tmp_path):
    words = ("identify", study, pipeline.flight, "--selection", pipeline.selection, "-o", tmp_path / "m.h5")
    cpfls.done(*words, "--seed", 7)
    with h5py.File(tmp_path / "m.h5") as other, h5py.File(pipeline.model) as first:
        assert not np.array_equal(other["pareto_front/objectives"], first["pareto_front/objectives"])


def texts(file):
    """All text inside an artifact: attributes, and datasets of text."""
    found = [str(value) for value in file.attrs.values()]

    def visit(_, item):
        found.extend(str(value) for value in item.attrs.values())
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "S":
            found.append(str(item[()]))

    file.visititems(visit)
    return "\n".join(found)


@pytest.mark.parametrize("stage", STAGES)
def test_no_path_no_host_no_date(pipeline, stage):
    content = pipeline.paths[stage].read_bytes()
    for folder in (pipeline.flight.parent, Path.cwd(), Path(tempfile.gettempdir())):
        assert f"{folder}/".encode() not in content
    with h5py.File(pipeline.paths[stage]) as file:
        text = texts(file)
    assert "membership_functions: 5" in text
    assert not re.search(rf"\b{re.escape(socket.gethostname())}\b", text)
    assert not re.search(r"20\d\d-\d\d|\d\d:\d\d", text)
