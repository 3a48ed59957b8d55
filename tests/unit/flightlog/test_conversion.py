import numpy as np
import pytest

from cpfls_cli.flightlog import ImportSettings, SignalMap
from cpfls_cli.flightlog.frames import to_program_frames

ROTORS = SignalMap(columns=("m1", "m2", "m3", "m4"), unit="1")
SHARES = np.array([[0.0, 0.25, 0.64, 1.0], [-0.1, 0.04, 0.5, 0.81]])


@pytest.mark.parametrize(
    ("meaning", "kept"),
    [("speed", SHARES), ("thrust", [[0.0, 0.5, 0.8, 1.0], [0.0, 0.2, np.sqrt(0.5), 0.9]])],
)
def test_a_command_is_kept_as_a_share_of_speed(meaning, kept):
    settings = ImportSettings(signals={"rotor_command": ROTORS}, torque_source=None, rotor_command_is=meaning)
    assert to_program_frames({"rotor_command": SHARES}, settings)["rotor_command"] == pytest.approx(np.array(kept))
