"""What the selection of samples says of numbers that it cannot compute with."""

from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError
from cpfls_cli.stages.reduce import _naming


def test_numbers_that_overflow_are_an_error_that_names_the_flight():
    said = r"own/flight\.h5: the regressor has numbers too far apart"
    with pytest.raises(ComputationError, match=said), _naming([Path("own/flight.h5")]):
        np.linalg.eigvalsh(np.full((3, 3), np.nan))
