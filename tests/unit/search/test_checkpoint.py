"""Checkpoints: bit by bit what they were, and refused where they are damaged or of another search."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.artifacts.job import origin_before
from cpfls_cli.config.load import validate
from cpfls_cli.errors import InputError
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.evolution.engine import start, step
from cpfls_cli.files import seal_of
from cpfls_cli.identification.search import Unfinished
from cpfls_cli.search import Checkpoint, SearchState

INPUTS = {"flight": InputFile("f.h5", "a" * 64, "cpfls/flight"), "validate-1": InputFile("v.h5", "b" * 64, "csv")}


def header(inputs=INPUTS, seed=1, **keys):
    settings = {"population": 20, "generations": 9, "subpopulations": 2, **keys}
    return origin_before(validate({"seed": seed, "identification": settings}, "study.yaml"), inputs)


def settings():
    return validate({"identification": {"population": 20, "generations": 9, "subpopulations": 2}}, "s").identification


def failing_sometimes(genes):
    refined = genes // 3 * 3
    x = refined / 65535
    objectives = np.column_stack([np.sum((x - place) ** 2, axis=1) / 3 for place in (0.1, 0.5, 0.7)])
    objectives[genes[:, 0] % 4 == 0] = np.inf
    return Evaluation(refined, objectives)


def evolved(generations=3):
    state = start(failing_sometimes, 5, settings(), np.random.default_rng(11))
    for _ in range(generations):
        state = step(state, failing_sometimes, settings())
    return state


def assert_same(one, other):
    assert (one.index, one.rng.bit_generator.state) == (other.index, other.rng.bit_generator.state)
    pairs = [(vars(one), vars(other)), (vars(one.history), vars(other.history))]
    pairs += [({"submitted": s.archive.submitted, **vars(s.archive.results)} for s in (one, other))]
    for first, second in pairs:
        for name in ("genes", "objectives", "subpopulations", "submitted", "evaluations", "best", "front_size"):
            if name in first:
                assert first[name].dtype == second[name].dtype
                np.testing.assert_array_equal(first[name], second[name])


@pytest.fixture
def checkpoint(tmp_path):
    kept = Checkpoint.of_output(tmp_path / "model.h5", header())
    kept.write(evolved())
    return kept


def test_it_lies_next_to_the_output(checkpoint, tmp_path):
    assert (checkpoint.path, checkpoint.output) == (tmp_path / "model.h5.checkpoint", tmp_path / "model.h5")
    checkpoint.remove()
    checkpoint.remove()
    assert list(tmp_path.iterdir()) == []


def test_state_comes_back_bit_by_bit_and_goes_on_the_same(checkpoint):
    read, kept = checkpoint.read().state, evolved()
    assert np.isinf(kept.archive.results.objectives).any()
    assert_same(read, kept)
    for _ in range(5):
        read, kept = step(read, failing_sometimes, settings()), step(kept, failing_sometimes, settings())
    assert_same(read, kept)


def unfinished():
    genes = np.random.default_rng(12).integers(0, 65536, (7, 5))
    evaluation = failing_sometimes(genes)
    evaluation.objectives[2] = np.nan
    return Unfinished(genes, evaluation)


@pytest.mark.parametrize("finished", [True, False], ids=["with a generation", "before the first"])
def test_what_was_evaluated_of_the_next_generation_comes_back(checkpoint, finished):
    assert len(checkpoint.read().unfinished.submitted) == 0
    if not finished:
        checkpoint.remove()
    checkpoint.add(unfinished())
    assert store.findings_in(checkpoint.path, SearchState) == []
    stopped = checkpoint.read()
    for stored, kept in (
        (stopped.unfinished.submitted, unfinished().submitted),
        (stopped.unfinished.evaluation.genes, unfinished().evaluation.genes),
        (stopped.unfinished.evaluation.objectives, unfinished().evaluation.objectives),
    ):
        assert stored.dtype == kept.dtype
        np.testing.assert_array_equal(stored, kept)
    assert (stopped.state is not None) == finished
    if stopped.state is not None:
        assert_same(stopped.state, evolved())
        checkpoint.write(stopped.state)
        assert len(checkpoint.read().unfinished.submitted) == 0


def test_it_is_a_good_artifact_and_equal_states_are_equal_files(checkpoint, tmp_path):
    assert store.findings_in(checkpoint.path, SearchState) == []
    other = Checkpoint.of_output(tmp_path / "other.h5", header())
    other.write(checkpoint.read().state)
    assert other.path.read_bytes() == checkpoint.path.read_bytes()


@pytest.mark.parametrize(
    ("now", "said"),
    [
        (header(seed=2), "seed = 1 there, 2 here"),
        (header(mutated_bits=0.5), "identification.mutated_bits = 0.003 there, 0.5 here"),
        (header(ridge={"folds": 7}), "identification.ridge.folds = 5 there, 7 here"),
        (header(generations=2), "identification.generations = 2, but it has reached generation 3"),
        (header({"flight": replace(INPUTS["flight"], sha256="c" * 64)}), "flight = f.h5 (aaaaaaaaaaaa) there, f.h5 (c"),
        (header({**INPUTS, "selection": InputFile("s.h5", "d" * 64, "x")}), "selection = none there, s.h5 (dddddddddd"),
        (replace(header(), version="9.9"), "this is 9.9"),
    ],
)
def test_checkpoint_of_another_search_names_the_difference(checkpoint, now, said):
    with pytest.raises(InputError) as error:
        Checkpoint(checkpoint.path, now).read()
    assert str(error.value).startswith(f"{checkpoint.path}: belongs to another search: ")
    assert said in str(error.value)
    assert str(error.value).count(" here") <= 1
    assert "--force" in str(error.value)


@pytest.mark.parametrize(
    "now",
    [
        header(generations=3),
        header(generations=500),
        header({"flight": replace(INPUTS["flight"], name="renamed.h5")}),
        header({**INPUTS, "validate-1": InputFile("w.h5", "e" * 64, "csv")}),
    ],
)
def test_what_does_not_change_the_search_may_change(checkpoint, now):
    assert_same(Checkpoint(checkpoint.path, now).read().state, evolved())


def test_every_bit_of_the_datasets_counts(checkpoint):
    checkpoint.add(unfinished())
    content = checkpoint.path.read_bytes()
    held = {name: values for name, (_, values) in store.flat(checkpoint.path).items() if values.dtype.kind != "U"}
    for name, values in held.items():
        changed = np.array(values)
        changed.reshape(-1).view(np.uint8)[-1] ^= 1
        with h5py.File(checkpoint.path, "r+") as file:
            file[name][...] = changed
        # A write of its own would seal the change; damage leaves the seal of before.
        checkpoint.path.write_bytes(checkpoint.path.read_bytes() + seal_of(content[: -len(seal_of(content))]))
        with pytest.raises(InputError, match=r"model\.h5\.checkpoint: .*--force without --resume starts again"):
            checkpoint.read()
        checkpoint.path.write_bytes(content)
