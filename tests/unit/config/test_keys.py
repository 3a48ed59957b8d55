"""Keys of a config: what is known, overridden, preset and written."""

import re
from dataclasses import asdict, fields
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli.config.check import commented_default, keys_of, known_keys
from cpfls_cli.config.load import apply_override, load_study, parse_config, validate
from cpfls_cli.config.study import SECTIONS, Study, parse_yaml, resolved, to_yaml
from cpfls_cli.errors import ConfigError
from cpfls_cli.evolution.settings import EvolutionSettings
from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.identification.settings import PRESETS
from cpfls_cli.units import KNOWN_UNITS
from cpfls_cli.vehicle.rotors import body_wrench
from tests.builders.studies import VEHICLE, put_file

FOLDER = Path(__file__).parents[3] / "configs" / "gap"
SPEED = np.array([[300.0, 350.0, 400.0, 470.0]])
O1, O2, O3, O4 = SPEED[0] ** 2


def all_keys(settings, prefix=""):
    for key in keys_of(settings):
        yield prefix + key.name, key
        if key.section is not None:
            yield from all_keys(key.section, f"{prefix}{key.name}.")


def test_every_key_has_one_line_of_documentation_which_the_commented_default_shows():
    assert [path for path, key in all_keys(Study) if not key.doc.strip() or "\n" in key.doc] == []
    comments = {line.split("#", 1)[1].strip() for line in commented_default().splitlines() if "#" in line}
    entries = {comment.split(": ", 1)[-1] for comment in comments}
    assert [path for path, key in all_keys(Study) if key.doc not in comments | entries] == []
    assert [key.name for key in keys_of(Study) if key.section is not None] == list(SECTIONS)


def test_known_keys_look_inside_lists_and_mappings():
    assert known_keys(["vehicle", "rotors", "0"]) == known_keys(["vehicle", "rotors", "3"])
    assert "spin" in known_keys(["vehicle", "rotors", "0"])
    assert "unit" in known_keys(["import", "signals", "attitude"])
    assert (known_keys(["vehicle", "mass_kg"]), known_keys(["nowhere"])) == ([], [])
    assert "vehicle.rotors.spin" in known_keys([], deep=True)


def enumerated(schema):
    """Find every list of allowed values in a JSON schema."""
    if isinstance(schema, dict):
        yield from [frozenset(schema["enum"])] if isinstance(schema.get("enum"), list) else []
        for part in schema.values():
            yield from enumerated(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from enumerated(part)


def test_the_values_of_every_key_are_those_that_the_validating_library_allows():
    listed = [set(values) - {None} for _, key in all_keys(Study) for values in (key.choices, key.entries) if values]
    assert len(listed) > 20
    # A value allowed besides others, such as an estimate in place of a number, is a constant and no list.
    assert set(map(frozenset, listed)) == set(enumerated(Study.model_json_schema()))


def above(key):
    """Comments above a key of the commented default."""
    lines = [line.strip() for line in commented_default().splitlines()]
    end = lines.index(key)
    start = max(number for number in range(end) if not lines[number].startswith("#"))
    return [line.removeprefix("# ") for line in lines[start + 1 : end]]


def test_the_commented_default_lists_the_values_below_the_line_on_the_key():
    assert above("torque_source: column")[1:] == ["one of column, rotor-speed, rotor-command, null"]
    assert above("time_unit: s") == ["unit of the time stamps", "one of s, ms, us, ns"]
    assert len(above("gap_s: 0.1")) == len(above("delay_s: 0.0")) == 1


def test_signals_come_with_their_names_units_and_an_example_that_is_a_study():
    comments = above("signals: {}")
    assert all(name in " ".join(comments[1:4]) for name in get_args(SignalName))
    assert f"    one of '1', {', '.join(list(KNOWN_UNITS)[1:])}" in comments
    begin = next(number for number, line in enumerate(comments) if line.startswith("example"))
    example = "import:\n  signals:\n" + "\n".join(f"  {line}" for line in comments[begin + 1 :])
    signals = validate(parse_config(example, "example"), "example").import_.signals
    assert (set(signals), signals["body_torque"].sign) == ({"attitude", "body_torque"}, (1, -1, -1))


def test_a_config_file_with_keys_that_are_gone_is_refused_with_what_to_do(tmp_path):
    path = put_file(tmp_path / "study.yaml", "report: {paper: true, evaluation_times: []}\n" + VEHICLE)
    with pytest.raises(ConfigError) as refused:
        load_study(path)
    lines = str(refused.value).splitlines()
    assert [line.split(": ")[1] for line in lines] == ["report.evaluation_times", "report.paper"]
    assert all("remove it; `make reproduce`" in line for line in lines)
    path.write_text("trajectory: {next_flight: {to_tell: [inflow], box_m: [1, 2, 3]}}\n" + VEHICLE)
    wrong = r"study.yaml: trajectory\.next_flight\.to_tell: is no longer a key: call it separate"
    with pytest.raises(ConfigError, match=wrong):
        load_study(path)
    path.write_text("sweep: {seeds: 3}\n" + VEHICLE)
    with pytest.raises(ConfigError, match=r"sweep\.seeds: is no longer a key: remove it; a loop over `cpfls identify"):
        load_study(path)


def test_keys_that_are_gone_are_left_out_of_the_configs_of_artifacts():
    study = validate({"report": {"title": "A study", "paper": True, "evaluation_times": []}}, "study.yaml")
    assert resolved(study)["report"] == {"title": "A study", "notes": []}
    assert validate({"sweep": {"seeds": 3}}, "study.yaml") == validate({}, "study.yaml")


def test_a_key_that_has_no_effect_any_more_is_read_with_a_warning(tmp_path, caplog):
    config = put_file(tmp_path / "study.yaml", f"{VEHICLE}playback: {{generations: 0, folds: 4}}\n")
    with caplog.at_level("WARNING"):
        assert load_study(config).playback.folds == 4
    assert f"{config}: playback.generations has no effect any more; remove it" in caplog.text


@pytest.mark.parametrize(
    ("data", "override", "result"),
    [
        ({}, "seed=3", {"seed": 3}),
        ({}, "vehicle.mass_kg=1e-3", {"vehicle": {"mass_kg": 0.001}}),
        ({"vehicle": None}, "vehicle.mass_kg=2", {"vehicle": {"mass_kg": 2}}),
        ({"vehicle": {"mass_kg": 1, "a": 5}}, "vehicle.mass_kg=2", {"vehicle": {"mass_kg": 2, "a": 5}}),
        ({"a": [1, 2]}, "a.1=7", {"a": [1, 7]}),
        ({"a": [{"b": 1}]}, "a.0.b=x", {"a": [{"b": "x"}]}),
        ({}, "report.title=a=b", {"report": {"title": "a=b"}}),
        ({}, "import.crop_s=[0, 1]", {"import": {"crop_s": [0, 1]}}),
        ({}, "vehicle.mass_kg=", {"vehicle": {"mass_kg": None}}),
    ],
)
def test_override(data, override, result):
    apply_override(data, override)
    assert data == result


def test_a_list_that_the_config_leaves_out_starts_from_the_default_unless_it_is_of_a_vehicle():
    data = {}
    apply_override(data, "trajectory.direction.2=0.5")
    assert data["trajectory"]["direction"] == [*resolved(Study())["trajectory"]["direction"][:2], 0.5]
    with pytest.raises(ConfigError, match="the config holds no list 'rotors', and there is no default for it"):
        apply_override({"vehicle": {"mass_kg": 0.03}}, "vehicle.rotors.2.spin=-1")


@pytest.mark.parametrize("override", ["", "=", "a", ".=1", "a.=1", ".a=1", "a..b=1"])
def test_malformed(override):
    with pytest.raises(ConfigError, match=r"write section\.key=value"):
        apply_override({}, override)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001), ("-.5", -0.5), ("1.", 1.0), ("+3", 3), ("0", 0), ("true", True), ("null", None), ("~", None),
        ("on", "on"), ("yes", "yes"), ("1:30", "1:30"), ("0x10", "0x10"), ("1_000", "1_000"),
        ("2001-01-01", "2001-01-01"), ("010", 10.0),
    ],
)  # fmt: skip
def test_scalars(text, value):
    parsed = parse_yaml(text, "file")
    assert parsed == value
    assert type(parsed) is type(value)


@pytest.mark.parametrize(
    "text", ["1e-3", "-.5", "1.", ".inf", "on", "yes", "1:30", "0x10", "1_000", "2001-01-01", "010", "", "null", "# no"]
)
def test_text_that_looks_like_something_else_stays_text(text):
    assert parse_yaml(to_yaml({"title": text}), "file") == {"title": text}


def test_merge_keys_and_anchors_are_plain_yaml():
    assert parse_yaml("a: &a {x: 1}\nb: {<<: *a, y: 2}\n", "file") == {"a": {"x": 1}, "b": {"x": 1, "y": 2}}


def study(name):
    return load_study(FOLDER / f"{name}.yaml")


def torque(name, speed=SPEED):
    return body_wrench(study(name).vehicle, speed).body_torque[0]


def test_craft_have_the_torques_of_their_origin():
    k, b, d = 5.57e-6, 1.36e-7, 0.1202081528
    expected = [k * d * (O1 - O2 - O3 + O4), k * d * (-O1 - O2 + O3 + O4), b * (O1 - O2 + O3 - O4)]
    np.testing.assert_allclose(torque("rotorpy"), expected, rtol=1e-12)
    k, b, arm = 121.5e-6, 2.7e-6, 0.3
    expected = [arm * k * (O4 - O2), arm * k * (O3 - O1), b * (-O1 + O2 - O3 + O4)]
    np.testing.assert_allclose(torque("sixkg"), expected, rtol=1e-12)
    assert {(rotor.radius_m, rotor.position_m[2]) for rotor in study("sixkg").vehicle.rotors} == {(0.2, 0.05)}


def test_the_crazyflie_gives_the_stated_thrust_for_a_command():
    vehicle = study("arpl").vehicle
    share = np.array([[0.3, 0.5, 0.7, 0.9]])
    wrench = body_wrench(vehicle, share * vehicle.rotor_speed_max_rad_s)
    u = 0.15002497 * share[0] ** 2
    assert wrench.thrust[0] == pytest.approx(u.sum(), rel=1e-6)
    # M1 (+x, -y), M2 (-x, -y), M3 (-x, +y), M4 (+x, +y), and about z the signs - + - +.
    expected = 0.028 * np.array([-u[0] - u[1] + u[2] + u[3], -u[0] + u[1] + u[2] - u[3]])
    np.testing.assert_allclose(wrench.body_torque[0, :2], expected, rtol=1e-6)


@pytest.mark.parametrize("name", ["arpl", "crazypad", "crazypad_usd", "crazyswarm2", "crazyswarm2_card", "nanodrone"])
def test_the_motors_of_every_crazyflie_stand_and_turn_alike(name):
    rotors = study(name).vehicle.rotors
    assert [tuple(np.sign(rotor.position_m[:2])) for rotor in rotors] == [(1, -1), (-1, -1), (-1, 1), (1, 1)]
    alone = [torque(name, 1000 * np.eye(4)[[rotor]])[2] for rotor in range(4)]
    assert list(np.sign(alone)) == [-1, 1, -1, 1]


@pytest.mark.parametrize("name", ["rotorpy", "sixkg"])
def test_only_body_rates_are_needed_and_nothing_changes_the_data(name):
    settings = study(name).import_
    assert [signal for signal, entry in settings.signals.items() if entry.required] == ["body_rate"]
    changing = (settings.lowpass_hz, settings.spike_deviations, settings.rate_hz, settings.crop_s)
    assert (*changing, settings.delay_s, settings.torque_source) == (None, None, None, None, 0.0, None)


METHOD = Path(__file__).parents[3] / "docs/method.md"
ROW = re.compile(r"^\| `(\w+)` \| (\S+) \| (\S+) \|$", re.MULTILINE)
TABLE = METHOD.read_text(encoding="utf-8").partition("| key of `identification` |")[2].partition("\n\n")[0]
PAGE = {key: {"paper": paper, "fast": fast} for key, paper, fast in ROW.findall(TABLE)}
# A value of each key that is neither the paper's nor the default.
OTHER = {
    "population": 44, "generations": 7, "subpopulations": 2, "migration_rate": 0.11, "migration_interval": 3,
    "generation_gap": 0.5, "crossover_rate": 0.6, "insertion_rate": 0.4, "selective_pressure": 1.2,
    "mutated_individuals": 0.3, "mutated_bits": 0.02, "ranking": "pareto-count", "first_objective_weight": 4,
    "reinsertion": "fitness", "stall_generations": 9,
}  # fmt: skip


def identification(**keys):
    return validate({"identification": keys}, "study.yaml").identification


@pytest.mark.parametrize("preset", ["paper", "fast"])
def test_a_preset_gives_what_the_method_page_says(preset):
    """Section 7 of the page, where section 9 and Table 5 of the paper are read."""
    settings = asdict(identification(preset=preset))
    stated = {key: yaml.safe_load(row[preset]) for key, row in PAGE.items()}
    assert {key: settings[key] for key in stated} == stated


def test_the_page_names_every_key_of_the_paper():
    assert set(PAGE) == set(PRESETS["paper"])


@settings(deadline=None)
@given(st.sets(st.sampled_from(sorted(OTHER))))
def test_a_preset_fills_in_only_what_is_not_given(keys):
    chosen = {key: OTHER[key] for key in keys}
    filled = asdict(identification(preset="paper", **chosen))
    untouched = asdict(identification(**chosen))
    for key, value in filled.items():
        if key in chosen:
            assert value == chosen[key]
        elif key in PAGE:
            assert value == yaml.safe_load(PAGE[key]["paper"])
        elif key != "preset":
            assert value == untouched[key]


def test_the_other_values_would_be_noticed():
    for key, value in OTHER.items():
        assert value not in (yaml.safe_load(text) for text in PAGE[key].values())


def test_a_resolved_preset_reads_back_the_same_and_names_every_key_of_the_search():
    study = validate({"identification": {"preset": "paper", "population": 20}}, "study.yaml")
    assert validate(resolved(study), "study.yaml") == study
    # How small an improvement counts is never asked where no search is stopped for it.
    assert {key.name for key in fields(EvolutionSettings)} - set(PRESETS["paper"]) == {"stall_improvement"}


@pytest.mark.parametrize("preset", ["papre", 3, None])
def test_an_unknown_preset_is_refused(preset):
    with pytest.raises(ConfigError, match=r"preset.*'fast' or 'paper'"):
        identification(preset=preset)
