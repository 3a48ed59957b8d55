"""What benchmarks print of vehicles that they find, and the baselines that they fit."""

from benchmarks.shared.found_vehicles import learned
from tests.builders.playback_flights import MIDDLING, STATED, flown, truth


def test_a_vehicle_is_found_with_the_baselines_of_its_choice(capsys):
    models = learned(STATED, flown(truth(), ("figure", "steps"), duration_s=4.0, noise=MIDDLING, seed=2))
    said = capsys.readouterr().out
    assert [name.partition(",")[0] for name in models] == ["vehicle", "added", "everything"]
    for name in ("chosen", "best", "added", "everything", "nothing"):
        assert f"  {name}: error " in said
    # The stated vehicle with all named effects, and all there is.
    assert "inertia" not in next(line for line in said.splitlines() if line.startswith("  added: "))
    assert len(models) == len({id(model) for model in models.values()})
