"""Logs that Crazyflies of others wrote on their cards, held against figures stated with them."""

import pytest

from cpfls_cli.logs.formats import is_log, log_contents
from tests.builders.recorded_flights import FLIGHTS

# Mean commands of roll and pitch while the vehicle is higher than 0.1 m.
STATED = {
    "normal_flight__E8_log00": (550, -396),
    "normal_flight__E8_log01": (94, -444),
    "normal_flight__E8_log02": (230, -579),
    "cut_propeller_M3_1mm_1mm_45mm__E8_log00": (3949, -85),
    "cut_propeller_M3_4mm_4mm_39mm__E8_log01": (8969, -7570),
    "weight_on_string_W3_near_M3__E8_log01": (4557, -1573),
}


@pytest.mark.parametrize("name", STATED)
def test_the_stated_figures_come_out(name):
    path = FLIGHTS / "real" / "crazypad_usd" / name
    if not path.exists():
        pytest.skip(f"{path} is absent; set CPFLS_FLIGHTS to the folder of other people's flights")
    assert is_log(path)
    contents = log_contents(path)
    flown = contents.topics["fixedFrequency"]
    high = flown["stateEstimate.z"] > 0.1
    assert contents.warnings == ()
    assert len(high) / flown["timestamp"][-1] == pytest.approx(101, abs=0.5)
    assert tuple(round(flown[f"controller.cmd_{axis}"][high].mean()) for axis in ("roll", "pitch")) == STATED[name]
