import numpy as np

from cpfls_cli.identification.chromosome import LARGEST_GENE, decode, encode, uniform_chromosome
from cpfls_cli.regressor import StructureSettings, model_structure, uniform_breakpoints

STRUCTURE = model_structure(StructureSettings(membership_functions=(2, 3, 1, 5, 6, 7)))


def test_encode_rounds_and_clips_without_making_a_function_of_zero_width():
    genes = encode(np.array([-0.1, 0.0, 0.5, 1.0, 1.2, 1.6 / LARGEST_GENE]))
    assert genes.tolist() == [1, 1, 32768, 65535, 65535, 2]


def test_encoded_weights_decode_to_their_breakpoints():
    weights = np.random.default_rng(21).uniform(0.1, 1, STRUCTURE.genes)
    exact, rounded = (decode(STRUCTURE, w) for w in (weights, encode(weights).astype(float)))
    for b, b_rounded in zip(exact, rounded, strict=True):
        np.testing.assert_allclose(b_rounded, b, atol=1e-4)


def test_uniform_chromosome_is_equidistant():
    decoded = decode(STRUCTURE, uniform_chromosome(STRUCTURE).astype(float))
    for b, uniform in zip(decoded, uniform_breakpoints(STRUCTURE), strict=True):
        np.testing.assert_allclose(b, uniform, atol=1e-15)


def test_only_the_all_zero_partition_is_undefined():
    weights = np.ones(STRUCTURE.genes)
    weights[1:3] = 0
    finite = [bool(np.isfinite(b).all()) for b in decode(STRUCTURE, weights)]
    assert finite == [True, False, True, True, True, True]
