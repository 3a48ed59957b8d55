"""The workflow on an identified model in place of the vehicle's own numbers."""

import json

import h5py
import pytest

import cpfls_cli


@pytest.fixture(scope="module")
def answer(cpfls, gap_config, pipeline, with_attitude, tmp_path_factory):
    folder = tmp_path_factory.mktemp("model") / "gap"
    return folder, cpfls.summary("gap", gap_config, *with_attitude, "--model", pipeline.model, "-o", folder)


def test_artifacts_carry_the_model(answer, pipeline):
    folder, _ = answer
    with h5py.File(folder / "diagnosis.h5") as file, h5py.File(pipeline.model) as model:
        functions = model["model/fuzzy/coefficients"][()]
        assert (file["base/fuzzy/coefficients"][()] == functions).all()


def test_offset_is_found_next_to_the_model(answer):
    _, summary = answer
    effects = {effect["name"]: effect for effect in [*summary["effects"], *summary["closest"]]}
    assert effects["com_offset"]["coefficients"]["c_x"]["value"] == pytest.approx(0.008, rel=0.1)


def test_later_stages_need_no_model_again(cpfls, gap_config, answer, tmp_path):
    folder, _ = answer
    cpfls.done("diagnose", gap_config, folder / "disagreement.h5", "-o", tmp_path / "d.h5")
    assert (tmp_path / "d.h5").read_bytes() == (folder / "diagnosis.h5").read_bytes()


def test_a_flight_without_attitude_is_refused(refuse, gap_config, pipeline, shifted, tmp_path):
    (message,) = refuse("compare", gap_config, shifted[0], "--model", pipeline.model, "-o", tmp_path / "x.h5")
    assert "the model needs the attitude" in message


def test_extended_model_predicts_and_is_compared(cpfls, gap_config, answer, with_attitude, tmp_path):
    folder, summary = answer
    assert summary["extension"]["written"]
    cpfls.done("import", gap_config, with_attitude[1], "-o", tmp_path / "f.h5")
    extended = folder / "extended.h5"
    assert len(cpfls_cli.load_model(extended, gap_config).predict(tmp_path / "f.h5").time) == 2400
    words = ("compare", gap_config, with_attitude[1], "--model", extended, "-o", tmp_path / "d.h5", "--json")
    result = cpfls.done(*words)
    # What was held out for the diagnosis, seen again through the extended model.
    gap = json.loads(result.stdout)["gap"]["torque_n_m"]
    assert gap == pytest.approx(summary["gap_after"]["torque_n_m"], rel=1e-6)
