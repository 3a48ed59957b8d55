"""`cpfls changed` on flights of others: a propeller cut further and further beside three flights with a whole one."""

import json
from itertools import pairwise
from pathlib import Path

import pytest

from tests.builders.command_line import run
from tests.builders.recorded_flights import path_of_log

CONFIGS = Path(__file__).parents[3] / "configs" / "gap"
NORMAL = [f"normal_flight__E8_log0{number}" for number in range(3)]
CUT = {
    millimetres: [f"cut_propeller_M3_{millimetres}mm_{millimetres}mm_{left}mm__E8_log0{number}" for number in (0, 1)]
    for millimetres, left in ((3, 41), (4, 39))
}


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    out = tmp_path_factory.mktemp("changed") / "out"

    def call(today, since):
        flown, before = ([path_of_log("real/crazypad_usd", name) for name in side] for side in (today, since))
        words = ("changed", CONFIGS / "crazypad_usd.yaml", *flown, "--since", *before, "-o", out, "--json", "--force")
        result = run(*words)
        assert result.exit_code == 0, result.stderr
        return json.loads(result.stdout)

    return call


@pytest.mark.parametrize("today", NORMAL)
def test_nothing_has_changed_between_flights_with_whole_propellers(changed, today):
    assert not changed([today], [name for name in NORMAL if name != today])["changed"]


def test_a_cut_propeller_is_named_and_pulls_the_less_the_more_is_cut(changed):
    told = [changed(flights, NORMAL) for flights in CUT.values()]
    assert [[cause["name"] for cause in each["causes"]] for each in told] == [["rotor M3"]] * len(CUT)
    assert all(each["causes"][0]["named"] for each in told)
    losses = [each["causes"][0]["sizes"][0]["value"] for each in told]
    assert all(0 < less < more for less, more in pairwise(losses))
