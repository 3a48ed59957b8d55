import numpy as np
import pytest

from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Archive, Evaluation


class Recorder:
    """Evaluate to (sum, -sum) of genes that a local search rounds up to a multiple of ten."""

    def __init__(self):
        self.calls = []

    def __call__(self, genes):
        self.calls.append(genes.tolist())
        refined = -(-genes // 10) * 10
        total = refined.sum(axis=1, keepdims=True).astype(float)
        return Evaluation(refined, np.hstack([total, -total]))


def test_only_unknown_chromosomes_are_evaluated_once_in_order_of_appearance():
    archive, recorder = Archive(), Recorder()
    archive.evaluate(np.array([[13], [2], [13], [31]]), recorder)
    archive.evaluate(np.array([[5], [2], [5], [31]]), recorder)
    assert recorder.calls == [[[13], [2], [31]], [[5]]]
    assert len(archive) == 4


def test_a_known_chromosome_recalls_its_refinement_and_so_does_the_refined_one():
    archive, recorder = Archive(), Recorder()
    first = archive.evaluate(np.array([[13, 4]]), recorder)
    again = archive.evaluate(np.array([[20, 10], [13, 4]]), recorder)
    assert len(recorder.calls) == 1
    assert first.genes.tolist() == [[20, 10]]
    assert again.genes.tolist() == [[20, 10], [20, 10]]
    assert again.objectives.tolist() == [[30.0, -30.0]] * 2


def test_objectives_that_are_not_finite_are_kept_as_worst():
    archive = Archive()
    archive.store(np.array([[1], [2]]), Evaluation(np.array([[1], [2]]), np.array([[np.nan, -np.inf], [1, 2]])))
    assert archive.results.objectives.tolist() == [[np.inf, np.inf], [1.0, 2.0]]
    assert archive.front.genes.tolist() == [[2]]


def test_the_front_grows_and_forgets_the_dominated():
    archive = Archive()
    genes = np.arange(5)[:, np.newaxis]
    objectives = np.array([[3.0, 3.0], [1.0, 5.0], [2.0, 2.0], [2.0, 2.0], [5.0, 1.0]])
    fronts = []
    for row in range(5):
        archive.store(genes[[row]], Evaluation(genes[[row]], objectives[[row]]))
        fronts.append(archive.front.genes[:, 0].tolist())
    assert fronts == [[0], [0, 1], [1, 2], [1, 2], [1, 2, 4]]


@pytest.mark.parametrize(
    ("genes", "objectives", "name"),
    [
        (np.zeros((2, 2), dtype=int), np.zeros((3, 1)), "genes"),
        (np.zeros((3, 2)), np.zeros((3, 1)), "genes"),
        (np.zeros((3, 2), dtype=int), np.zeros((2, 1)), "objectives"),
        (np.zeros((3, 2), dtype=int), np.zeros(3), "objectives"),
    ],
)
def test_an_evaluation_that_does_not_fit_is_refused(genes, objectives, name):
    with pytest.raises(ComputationError, match=f"evaluation.{name}: expected"):
        Archive().evaluate(np.arange(6).reshape(3, 2), lambda _: Evaluation(genes, objectives))


def test_rebuilt_archive_knows_counts_and_gives_the_same():
    rng = np.random.default_rng(8)

    def evaluate(genes):
        # Refined to even genes: what one chromosome becomes, another one is, and equal objectives are common.
        refined = genes // 2 * 2
        objectives = np.column_stack([refined.sum(axis=1) % 5, refined[:, 0] % 7]).astype(float)
        objectives[refined[:, 1] > 12] = np.nan
        return Evaluation(refined, objectives)

    archive = Archive()
    for _ in range(8):
        archive.evaluate(rng.integers(0, 16, (12, 2)), evaluate)
    rebuilt = Archive.of(archive.submitted, archive.results)
    assert len(rebuilt) == len(archive)
    asked = np.stack(np.meshgrid(np.arange(16), np.arange(16)), axis=-1).reshape(-1, 2)
    for one, other in ((archive.front, rebuilt.front), *[[a.evaluate(asked, evaluate) for a in (archive, rebuilt)]]):
        np.testing.assert_array_equal(one.genes, other.genes)
        np.testing.assert_array_equal(one.objectives, other.objectives)
    np.testing.assert_array_equal(archive.submitted, rebuilt.submitted)
