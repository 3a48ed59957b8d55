"""`cpfls effects`: the table, one effect in full, and a name that is none."""

import re

from cpfls_cli import page
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.report.terminal import terminal_lines
from cpfls_cli.stages.effects import described, effects
from cpfls_cli.vehicle.settings import VehicleSettings


def test_table_lists_every_effect(cpfls):
    text = cpfls("effects").stdout
    assert all(re.search(rf"\b{name}\b", text) for name in CATALOGUE)
    lines = cpfls("effects", "-v").stdout.partition("what each is:\n")[2].splitlines()
    assert lines[0].split() == ["Effect", "Kind", "What", "it", "is"]
    assert [line.split()[0] for line in lines[1 : 1 + len(CATALOGUE)]] == list(CATALOGUE)


def test_one_effect_shows_its_range_and_its_rivals(cpfls):
    text = cpfls("effects", "wind", "-v").stdout
    assert "W_x from -15 to 15 m/s" in text
    assert "default, 6 kg with 4 rotors" in text
    rivals = CATALOGUE["wind"].rivals
    assert re.search(rf"^looks like  +{', '.join(rivals)}$", text, re.MULTILINE)
    assert all(re.search(rf"^{rival}  +{re.escape(flight)}", text, re.MULTILINE) for rival, flight in rivals.items())


def test_what_takes_an_effects_place_once_it_is_named_is_listed(cpfls):
    assert re.findall(r"\b(c_.) from", cpfls("effects", "com_offset").stdout) == ["c_x", "c_y", "c_z"]


def test_machines_get_the_same(cpfls):
    summary = cpfls.summary("effects", "motor_lag")
    assert (summary["kind"], summary["shapes"][0]["name"]) == ("actuator", "time_constant_s")
    assert set(summary["rivals"]) == set(CATALOGUE["motor_lag"].rivals)
    assert len(cpfls.summary("effects")["effects"]) == len(CATALOGUE)


def test_an_unknown_name_is_refused(refuse):
    assert refuse("effects", "rotor_drug")[0].startswith("rotor_drug: no such effect (did you mean rotor_drag")


def test_all_of_it_fits_a_terminal_of_80_columns():
    vehicle = VehicleSettings()
    shown = [described(each, vehicle) for each in CATALOGUE.values()]
    pages = [effects.text({"vehicle": "default", "effects": own}) for own in (shown, *([each] for each in shown))]
    assert max(len(line) for text in pages for line in terminal_lines(page.blocks(text), 80, whole=True)) <= 80
