"""A reduction that the flight does not allow: the key and its value, also where nothing would be computed."""

import pytest


@pytest.mark.parametrize("dry", [(), ("--dry-run",)], ids=["run", "dry-run"])
@pytest.mark.parametrize(
    ("size", "message"),
    [
        (550, "the training set has only 549 samples; keep fewer"),
        (37, "the training set has rank 113, which takes 38 samples or more"),
    ],
)
def test_size_that_does_not_suit_the_flight(refuse, pipeline, study, tmp_path, size, message, dry):
    words = ("-o", tmp_path / "out.h5", "--set", f"reduction.size={size}", *dry)
    assert refuse("reduce", study, pipeline.flight, *words) == [f"reduction.size = {size}: {message}"]


def test_all_samples_can_be_asked_for(cpfls, pipeline, study, tmp_path):
    words = ("-o", tmp_path / "out.h5", "--set", "reduction.size=549", "--dry-run")
    assert cpfls("reduce", study, pipeline.flight, *words).exit_code == 0
