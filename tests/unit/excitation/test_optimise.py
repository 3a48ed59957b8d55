import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.excitation import condition_number, optimised_rotation
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.trajectory.rotation import RotationLimits, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings
from cpfls_cli.vehicle.settings import VehicleSettings

DURATION, STRUCTURE, VEHICLE = 20.0, StructureSettings(), VehicleSettings()
SMALL = {"starts": 3, "iterations": 20}


def optimised(seed=0, progress=None, structure=STRUCTURE, **settings):
    chosen = RotationSettings(**(SMALL | settings))
    return optimised_rotation(chosen, DURATION, structure, VEHICLE, np.random.default_rng(seed), progress)


def test_better_than_the_best_of_as_many_random_paths():
    found = optimised()
    rng = np.random.default_rng(1)
    structure = model_structure(STRUCTURE)
    random = [full_rotation(RotationSettings(), DURATION, rng) for _ in range(found.evaluations)]
    assert found.condition_number < 0.8 * min(condition_number(path, structure, 500) for path in random)


def test_the_result_is_judged_on_many_samples():
    found = optimised()
    again = condition_number(found.path, model_structure(STRUCTURE), 20_000)
    assert found.condition_number == pytest.approx(again, rel=1e-3)


def test_jumps_of_the_slopes_of_seesaw_consequents_do_not_stop_the_search():
    seesaw = StructureSettings(consequents="seesaw", products="additive", membership_functions=3)
    found = optimised(structure=seesaw)
    assert found.condition_number < 0.7 * found.random.min()


def test_limits_hold():
    settings = {"torque_max_n_m": (2.0, 2.0, 1.0), "rate_max_rad_s": 4.0}
    limits = RotationLimits(RotationSettings(**settings), VEHICLE.inertia_kg_m2)
    path = optimised(**settings).path
    assert np.abs(limits.loads(path.sample(path.times(40_000)))).max() <= 1


def test_limits_hold_where_the_search_left_them(monkeypatch):
    monkeypatch.setattr("cpfls_cli.excitation._COSTS", (1e-9, 1e-9))
    limits, seen = RotationLimits(RotationSettings()), []
    enforced = RotationLimits.enforced
    monkeypatch.setattr(RotationLimits, "enforced", lambda own, path: seen.append(path) or enforced(own, path))
    path = optimised().path
    assert limits.peaks(seen[0]).max() > 1.05
    assert limits.peaks(path).max() <= 1


def test_a_seed_gives_one_path():
    first, again = (optimised(seed=4, iterations=3) for _ in range(2))
    np.testing.assert_array_equal(first.path.sine, again.path.sine)
    assert first.condition_number == again.condition_number


def test_progress_counts_every_evaluation():
    calls = []
    found = optimised(progress=lambda *call: calls.append(call), iterations=2)
    assert [call[:2] for call in calls] == [(done, 5) for done in range(1, 6)]
    assert found.evaluations == 5
    assert all(call[2].startswith("condition number ") for call in calls)


def test_never_worse_than_the_random_path_it_began_with(monkeypatch):
    monkeypatch.setattr("cpfls_cli.excitation._STEP", 10.0)
    found = optimised(iterations=2)
    assert found.condition_number == pytest.approx(found.random.min(), rel=0.1)


def test_without_iterations_the_best_random_path_remains():
    found = optimised(iterations=0)
    assert found.condition_number == pytest.approx(found.random.min(), rel=0.1)


def test_turns_beyond_the_limits_are_refused():
    with pytest.raises(SettingError, match="complete turns"):
        optimised(turns=(20, 1, 1))
