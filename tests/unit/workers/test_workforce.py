import numpy as np

from cpfls_cli.evolution import Evaluation
from cpfls_cli.workers import Workforce

GENES = np.arange(12).reshape(6, 2)


class Backwards(Workforce):
    """Finish the last part first, and rows of a part in no order."""

    def stream(self, genes):
        for rows in (np.array([5, 3]), np.array([4]), np.array([1, 0, 2])):
            yield rows, Evaluation(genes[rows] + 100, genes[rows] / 7)


def test_rows_come_back_where_they_were_whatever_finished_first():
    evaluation = Backwards()(GENES)
    assert evaluation.genes.tolist() == (GENES + 100).tolist()
    assert evaluation.objectives.tobytes() == (GENES / 7).tobytes()
