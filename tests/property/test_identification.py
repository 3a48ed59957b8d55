"""Any chromosome, and any way to part the samples."""

from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cpfls_cli.errors import SettingError
from cpfls_cli.identification.data import TorqueData, split_flight
from cpfls_cli.identification.evaluator import LARGEST_GENE, decode
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings
from cpfls_cli.identification.solver import contiguous_blocks
from tests.builders.flights import random_motion, rigid_torque

times = st.lists(st.floats(1e-3, 0.5), min_size=1, max_size=60).map(np.cumsum)
embargoes = st.floats(0, 2)


@given(times, st.integers(1, 20), embargoes)
def test_blocks(time, folds, embargo):
    try:
        blocks = contiguous_blocks(time, time, folds, embargo)
    except SettingError:
        # Refused only where some block with its embargo covers all samples.
        label = np.arange(len(time)) * min(folds, len(time)) // len(time)
        parts = [time[label == fold] for fold in range(label[-1] + 1)]
        assert any(p[0] - embargo <= time[0] + 1e-9 and time[-1] - 1e-9 <= p[-1] + embargo for p in parts)
        return
    sizes = blocks.validation.sum(axis=1)
    assert len(sizes) == min(folds, len(time))
    assert sizes.max() - sizes.min() <= 1
    np.testing.assert_array_equal(blocks.validation.sum(axis=0), 1)
    for validation, left_out in zip(blocks.validation, blocks.left_out, strict=True):
        assert np.all(np.diff(np.flatnonzero(validation)) == 1)
        distance = np.abs(time[:, None] - time[validation]).min(axis=1)
        inside = (time >= time[validation][0]) & (time <= time[validation][-1])
        assert np.all(left_out[inside | (distance <= embargo - 1e-9)])
        assert not np.any(left_out[~inside & (distance > embargo + 1e-9)])


@given(times, st.floats(0.01, 1), embargoes)
def test_split(time, share, embargo):
    split = split_flight(time, share, embargo)
    training, held_out = time[split.training], time[split.held_out]
    assert split.training.start == 0
    assert len(training) == max(round(share * len(time)), 1)
    assert split.held_out.stop == len(time)
    if len(held_out):
        assert held_out[0] > training[-1] + embargo - 1e-9
    assert np.all(time[split.training.stop : split.held_out.start] <= training[-1] + embargo + 1e-9)


SEESAW = {"consequents": "seesaw", "products": "additive"}
MODELS = {
    "paper": {**SEESAW, "base": "none", "input_map": "data-range", "membership_functions": 5},
    "classic": {**SEESAW, "base": "none", "structure": "fls", "membership_functions": 5},
    "over a rigid body": {**SEESAW, "base": "rigid-body", "membership_functions": 5},
}
GENES = 24

any_gene = st.one_of(st.integers(0, LARGEST_GENE), st.sampled_from([0, 1, LARGEST_GENE - 1, LARGEST_GENE]))
any_chromosome = st.lists(any_gene, min_size=GENES, max_size=GENES).map(np.array)


@cache
def evaluator(model, refining):
    motion = random_motion(np.random.default_rng(38), 60, limit=1.0)
    torque = rigid_torque()(motion)
    torque[:, 1] += 0.1 * np.exp(motion.attitude[:, 0]) * motion.acceleration[:, 1]
    data = TorqueData(0.02 * np.arange(60), motion, torque)
    search = LocalSearchSettings(enabled=refining, evaluations=2)
    return model_evaluator(data, data, IdentificationSettings(**MODELS[model], local_search=search))


@pytest.mark.parametrize("model", MODELS)
@settings(deadline=None, max_examples=25)
@given(any_chromosome)
@example(np.zeros(GENES, dtype=int))
@example(np.ones(GENES, dtype=int))
@example(np.full(GENES, LARGEST_GENE))
@example(np.tile([LARGEST_GENE, 0], GENES // 2))
@example(np.tile([0, LARGEST_GENE], GENES // 2))
@example(np.tile([1, LARGEST_GENE, 1, 1], GENES // 4))
@example(np.tile([0, 0, 0, LARGEST_GENE], GENES // 4))
@example(np.tile([1, 0, 0, 0], GENES // 4))
def test_objectives(model, chromosome):
    plain, refining = evaluator(model, refining=False), evaluator(model, refining=True)
    assert plain.structure.genes == GENES
    found, refined = plain(chromosome[None]), refining(chromosome[None])
    defined = all(np.isfinite(part).all() for part in decode(plain.structure, chromosome.astype(float)))
    for objectives in (found.objectives[0], refined.objectives[0]):
        assert np.isfinite(objectives).all() if defined else np.all(objectives == np.inf)
        assert np.all(objectives >= 0)
    assert refined.objectives[0, 0] <= found.objectives[0, 0]
    assert np.all((refined.genes >= 0) & (refined.genes <= LARGEST_GENE))
