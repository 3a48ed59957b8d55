import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.evolution.settings import EvolutionSettings


def test_subpopulations_of_one_are_refused():
    with pytest.raises(SettingError, match="at least 10") as error:
        EvolutionSettings(population=9, subpopulations=5)
    assert error.value.key == "population"


def test_two_individuals_per_subpopulation_are_enough():
    assert EvolutionSettings(population=10, subpopulations=5).population == 10
