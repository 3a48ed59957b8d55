"""Every key of a config is documented, and the commented default shows it."""

from typing import get_args

import pytest

from cpfls_cli.config.check import commented_default, keys_of, known_keys
from cpfls_cli.config.load import load_study, parse_config, validate
from cpfls_cli.config.study import SECTIONS, Study, resolved
from cpfls_cli.errors import ConfigError
from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.units import KNOWN_UNITS
from tests.builders.studies import VEHICLE


def all_keys(settings, prefix=""):
    for key in keys_of(settings):
        yield prefix + key.name, key
        if key.section is not None:
            yield from all_keys(key.section, f"{prefix}{key.name}.")


def test_every_key_has_one_line_of_documentation():
    undocumented = [path for path, key in all_keys(Study) if not key.doc.strip() or "\n" in key.doc]
    assert undocumented == []


def test_the_commented_default_shows_every_line():
    comments = {line.split("#", 1)[1].strip() for line in commented_default().splitlines() if "#" in line}
    entries = {comment.split(": ", 1)[-1] for comment in comments}
    missing = [path for path, key in all_keys(Study) if key.doc not in comments | entries]
    assert missing == []


def test_sections_are_those_of_the_study():
    assert [key.name for key in keys_of(Study) if key.section is not None] == list(SECTIONS)


def test_known_keys_look_inside_lists_and_mappings():
    assert known_keys(["vehicle", "rotors", "0"]) == known_keys(["vehicle", "rotors", "3"])
    assert "spin" in known_keys(["vehicle", "rotors", "0"])
    assert "unit" in known_keys(["import", "signals", "attitude"])
    assert known_keys(["vehicle", "mass_kg"]) == []
    assert known_keys(["nowhere"]) == []
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
    assert set(signals) == {"attitude", "body_torque"}
    assert signals["body_torque"].sign == (1, -1, -1)


def test_a_config_file_with_keys_that_are_gone_is_refused_with_what_to_do(tmp_path):
    path = tmp_path / "study.yaml"
    path.write_text("report: {paper: true, evaluation_times: []}\n" + VEHICLE)
    with pytest.raises(ConfigError) as refused:
        load_study(path)
    lines = str(refused.value).splitlines()
    assert [line.split(": ")[1] for line in lines] == ["report.evaluation_times", "report.paper"]
    assert all("remove it; `make reproduce`" in line for line in lines)
    path.write_text("sweep: {seeds: 3}\n" + VEHICLE)
    with pytest.raises(ConfigError, match=r"sweep\.seeds: is no longer a key: remove it; a loop over `cpfls identify"):
        load_study(path)


def test_keys_that_are_gone_are_left_out_of_the_configs_of_artifacts():
    study = validate({"report": {"title": "A study", "paper": True, "evaluation_times": []}}, "study.yaml")
    assert resolved(study)["report"] == {"title": "A study", "notes": []}
    assert validate({"sweep": {"seeds": 3}}, "study.yaml") == validate({}, "study.yaml")


def test_a_key_that_has_no_effect_any_more_is_read_with_a_warning(tmp_path, caplog):
    config = tmp_path / "study.yaml"
    config.write_text(f"{VEHICLE}playback: {{generations: 0, folds: 4}}\n")
    with caplog.at_level("WARNING"):
        assert load_study(config).playback.folds == 4
    assert f"{config}: playback.generations has no effect any more; remove it" in caplog.text
