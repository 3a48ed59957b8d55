"""Searches of settings by seed: each run that of `cpfls identify`, kept at once, and gone on from where it stopped."""

import numpy as np
import pytest

from benchmarks.paper import searches
from benchmarks.paper.replicates import Sweep
from cpfls_cli.search import Watch
from cpfls_cli.store import read
from tests.builders.studies import VEHICLE

STUDY = """\
trajectory: {sample_time_s: 0.2}
reduction: {criterion: D}
identification: {consequents: seesaw, products: additive, membership_functions: 3, base: none, subpopulations: 2,
  local_search: {enabled: false}, validation: {enabled: false}}
"""
SIZE = ("--set", "identification.population=8", "--set", "identification.generations=2")


@pytest.fixture(scope="module")
def folder(cpfls, tmp_path_factory):
    folder = tmp_path_factory.mktemp("searches")
    (folder / "study.yaml").write_text(STUDY + VEHICLE)
    cpfls.done("trajectory", folder / "study.yaml", "-o", folder / "path.h5")
    cpfls.done("simulate", folder / "study.yaml", folder / "path.h5", "-o", folder / "flight.h5")
    return folder


def search(folder, output, seeds=2):
    given = (folder / "study.yaml", folder / "flight.h5", searches.Compared.READINGS, output)
    searches.main(*given, seed=1, seeds=seeds, population=8, generations=2, samples=[30])
    return read(output, Sweep)[0]


@pytest.fixture(scope="module")
def found(folder):
    return search(folder, folder / "whole.h5")


def test_a_run_is_that_of_reduce_and_identify(cpfls, folder, found, tmp_path):
    assert found.complete
    assert [setting.runs for setting in found.settings] == [2] * 10
    setting = next(own for own in found.settings if own.name == "cpFLS, 30 samples by sigma_min, judged on learned")
    rule = ("--set", "reduction.size=30", "--set", "reduction.criterion=sigma_min")
    cpfls.done("reduce", folder / "study.yaml", folder / "flight.h5", *rule, "-o", tmp_path / "few.h5")
    words = ("--selection", tmp_path / "few.h5", "--seed", "2", *SIZE, "--set", "identification.judged_on=learned")
    alone = cpfls.told("identify", folder / "study.yaml", folder / "flight.h5", *words, "-o", tmp_path / "m.h5")
    run = setting.replicates[1]
    assert (run.seed, setting.samples) == (2, 30)
    assert alone["errors"]["mse"] == pytest.approx(run.mse[0], rel=1e-9)


def test_stopped_it_goes_on_to_the_same_end(folder, found, tmp_path, monkeypatch):
    stops = iter([None] * 40 + ["time-limit"] * 99)
    with monkeypatch.context() as patch:
        patch.setattr(Watch, "should_stop", lambda _: next(stops))
        with pytest.raises(SystemExit):
            search(folder, tmp_path / "s.h5")
    partial = tmp_path / "s.h5.partial"
    kept = read(partial, Sweep)[0].runs
    assert 0 < kept < 20
    assert not (tmp_path / "s.h5").exists()
    ran = []
    monkeypatch.setattr(searches, "run", lambda *given, own=searches.run: ran.append(given[2]) or own(*given))
    again = search(folder, tmp_path / "s.h5")
    assert len(ran) == 20 - kept
    assert not partial.exists()
    for one, two in zip(found.settings, again.settings, strict=True):
        assert [run.chromosome for run in one.replicates] == [run.chromosome for run in two.replicates]
        np.testing.assert_array_equal(one.errors, two.errors)
