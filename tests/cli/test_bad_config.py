"""Configs: what is printed loads again, and each wrong key has a line."""

import json

import pytest
import yaml

from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import SECTIONS, Study
from cpfls_cli.report.content import number
from tests.builders.studies import put_file, with_vehicle


@pytest.fixture
def wrong(refuse, tmp_path):
    def call(content, *words, whole=False):
        """Refuse a config: as it is, or (`whole`) with the rest of the paper's vehicle."""
        config = tmp_path / "study.yaml"
        text = content if isinstance(content, bytes) else content.encode()
        config.write_bytes(with_vehicle(content).encode() if whole else text)
        lines = refuse("trajectory", config, "-o", tmp_path / "out.h5", *words)
        return [line.replace(f"{config}", "FILE") for line in lines]

    return call


def test_all_unknown_keys_are_listed_with_the_nearest_valid_name(wrong):
    lines = wrong(
        "vehicle:\n  mass: 3\n  rotors:\n  - {position_m: [1, 0, 0], spin: 1, spinn: 1}\n"
        "trajectory: {mass_kg: 3}\nidentificaton: {}\nimport: {signals: {attitude: {columns: [a, b, c], units: rad}}}\n"
        "reduction: {xyzzy: 1}\ngap: {horizon: 50}\n"
    )
    assert {line.split(" (")[0] + " (" + line.split(" (")[1] for line in lines if "unknown" in line} == {
        "FILE: vehicle.mass = 3: unknown key (did you mean 'mass_kg'?)",
        "FILE: vehicle.rotors.0.spinn = 1: unknown key (did you mean 'spin'?)",
        "FILE: trajectory.mass_kg = 3: unknown key (did you mean 'vehicle.mass_kg'?)",
        "FILE: gap.horizon = 50: unknown key (did you mean 'horizon_s', which is in seconds?)",
        "FILE: identificaton: unknown key (did you mean 'identification'?)",
        "FILE: import.signals.attitude.units = \"rad\": unknown key (did you mean 'unit'?)",
        "FILE: reduction.xyzzy = 1: unknown key (valid here: size, condition_number, criterion, rank_tolerance, pool)",
    }


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("vehicle: {mass_kg: heavy}", 'FILE: vehicle.mass_kg = "heavy": must be a number'),
        ("vehicle: {mass_kg: '6.0'}", 'FILE: vehicle.mass_kg = "6.0": must be a number'),
        ("vehicle: {mass_kg: null}", "FILE: vehicle.mass_kg = null: must be a number"),
        ("vehicle: {mass_kg: 1:30}", 'FILE: vehicle.mass_kg = "1:30": must be a number'),
        ("vehicle: {mass_kg: -6}", "FILE: vehicle.mass_kg = -6: must be greater than 0"),
        ("vehicle: {mass_kg: .nan}", "FILE: vehicle.mass_kg = NaN: must be a finite number"),
        ("vehicle: {gravity_m_s2: .inf}", "FILE: vehicle.gravity_m_s2 = Infinity: must be a finite number"),
        ("vehicle: {rotors: []}", "FILE: vehicle.rotors = []: needs 1 entries at least"),
        (
            "vehicle: {inertia_kg_m2: [1, 2]}",
            "FILE: vehicle.inertia_kg_m2 = [1, 2]: needs 3 entries or needs 6 entries",
        ),
        ("vehicle: 3", "FILE: vehicle = 3: must be a section of keys"),
        ("report: {title: 3}", "FILE: report.title = 3: must be text"),
        ("identification: {population: true}", "FILE: identification.population = true: must be a whole number"),
        ("identification: {population: 75.0}", "FILE: identification.population = 75.0: must be a whole number"),
        ("identification: {structure: fuzzy}", "FILE: identification.structure = \"fuzzy\": must be 'cpfls' or 'fls'"),
        (
            "identification: {membership_functions: x}",
            'FILE: identification.membership_functions = "x": must be a whole number or must be a list',
        ),
        ("import: {crop_s: [3, 1]}", "FILE: import.crop_s = [3, 1]: needs 0 <= begin < end"),
        ("import: {signals: {torque: {columns: [a, b, c]}}}", "FILE: import.signals.torque.unit: is missing"),
        ("identification: {size: 9}", "FILE: identification.size = 9: unknown key (did you mean 'reduction.size'?)"),
        ("seed: 010", "FILE: seed = 10.0: must be a whole number"),
        ("seed: null", "FILE: seed = null: must be a whole number"),
        ("seed: 99999999999999999999", "FILE: seed = 99999999999999999999: must be less than 9223372036854775808"),
    ],
)
def test_one_wrong_value(wrong, content, message):
    assert wrong(content, whole=True) == [message]


def test_a_key_gives_a_terminal_no_orders(wrong):
    (line,) = wrong('"\\e[31mred\\e[0m": 1', whole=True)
    assert line.startswith("FILE: \\x1b[31mred\\x1b[0m = 1: unknown key")


def test_wrong_values_of_one_section_come_together(wrong):
    lines = wrong(
        "vehicle: {mass_kg: -1, inertia_kg_m2: [0.6, 0.6, -1.2, 0, 0, x], rotor_speed_max_rad_s: 0}", whole=True
    )
    assert sorted(lines) == [
        "FILE: vehicle.inertia_kg_m2.2 = -1.2: must be greater than 0",
        'FILE: vehicle.inertia_kg_m2.5 = "x": must be a number',
        "FILE: vehicle.mass_kg = -1: must be greater than 0",
        "FILE: vehicle.rotor_speed_max_rad_s = 0: must be greater than 0",
    ]


def test_an_unknown_key_does_not_hide_a_rule_between_keys(wrong):
    lines = wrong(
        "vehicle: {mass: 3, inertia_kg_m2: [1, 1, 1, 2, 0, 0]}\nimport: {crop: 1, crop_s: [5, 2]}", whole=True
    )
    assert [line.split(" = ")[0] for line in sorted(lines)] == [
        "FILE: import.crop",
        "FILE: import.crop_s",
        "FILE: vehicle.inertia_kg_m2",
        "FILE: vehicle.mass",
    ]
    assert any("is not positive definite" in line for line in lines)
    assert any("needs 0 <= begin < end" in line for line in lines)


def test_errors_of_all_sections_come_together(wrong):
    lines = wrong("seed: x\nvehicle: {mass_kg: x}\nreduction: {size: x}\nreport: {notes: 1}\n", whole=True)
    assert [line.split(" = ")[0] for line in lines] == [
        "FILE: seed",
        "FILE: vehicle.mass_kg",
        "FILE: reduction.size",
        "FILE: report.notes",
    ]


def test_long_values_are_cut(wrong):
    (line,) = wrong(f"report: {{title: [{', '.join(['1'] * 500)}]}}", whole=True)
    assert len(line) < 150


# A few lines that written out would be a billion values.
ALIASES = "a0: &a0 [x]\n" + "".join(f"a{n}: &a{n} [{', '.join(10 * [f'*a{n - 1}'])}]\n" for n in range(1, 10))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("vehicle: {mass_kg: 1, mass_kg: 2}", "FILE:1:23: not valid YAML: key 'mass_kg' appears twice"),
        ("seed: 1\nseed: 2\n", "FILE:2:1: not valid YAML: key 'seed' appears twice"),
        ("vehicle:\n\tmass_kg: 1\n", "FILE:2:1: not valid YAML: found character '\\t' that cannot start any token"),
        ("seed: [1\nb: }", "FILE:2:2: not valid YAML: expected ',' or ']', but got ':'"),
        ("seed: 1\n---\nseed: 2\n", "FILE:2:1: not valid YAML: but found another document"),
        ("", "FILE: the config is empty; `cpfls config` prints a commented default"),
        ("# nothing\n", "FILE: the config is empty; `cpfls config` prints a commented default"),
        ("- seed\n", "FILE: a config is a mapping of sections; this is a list"),
        (b"\x89HDF\r\n\x1a\n\xff\xfe", "FILE: not a text file; a config is YAML in UTF-8"),
        (b"seed: \x00\n", "FILE: not valid YAML: unacceptable character #x0000: special characters are not allowed"),
        ("1: 2\n", "FILE:1:1: not valid YAML: key 1 is not text"),
        ("vehicle: &a [*a]\n", "FILE:1:10: not valid YAML: an anchor that holds itself"),
        ("seed: !!int ''\n", "FILE: not valid YAML: string index out of range"),
        ('report: {title: "\\ud800"}\n', "FILE:1:17: not valid YAML: '\\ud800' holds half a character"),
        (ALIASES, "FILE:6:5: not valid YAML: more than 100000 values with every alias written out"),
        (b"# " + b"x" * 1_000_000, "FILE: is larger than 1 MB, which no config is"),
    ],
)
def test_not_a_config(wrong, content, message):
    assert wrong(content) == [message]


@pytest.mark.parametrize("tag", ["!!binary aGk=", "!!set {a}", "!!timestamp 2001-01-01", "!!python/name:os.system ''"])
def test_tags_beyond_plain_data_are_refused(wrong, tag):
    (line,) = wrong(f"report: {{title: {tag}}}")
    assert line.startswith("FILE:1:17: not valid YAML: could not determine a constructor for the tag")


def test_a_number_of_many_digits_and_a_deep_list(wrong):
    assert wrong("seed: 1" + "0" * 5000) == ["FILE:1:7: not valid YAML: a number of 5001 digits"]
    assert wrong("[" * 3000) == ["FILE: lists or mappings are nested deeper than in any config"]


def test_what_has_no_end_is_not_read_to_its_end(refuse):
    assert refuse("config", "/dev/zero") == ["/dev/zero: is larger than 1 MB, which no config is"]


def test_missing_config_and_folder_as_config(refuse, tmp_path):
    words = ("-o", tmp_path / "out.h5")
    assert refuse("trajectory", tmp_path / "none.yaml", *words) == [
        f"{tmp_path / 'none.yaml'}: cannot read the config: No such file or directory"
    ]
    assert refuse("trajectory", tmp_path, *words) == [f"{tmp_path}: cannot read the config: Is a directory"]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("vehicle", "--set vehicle: write section.key=value"),
        ("vehicle.mass=3", "FILE: vehicle.mass = 3: unknown key (did you mean 'mass_kg'?)"),
        ("vehicle.mass_kg=x", 'FILE: vehicle.mass_kg = "x": must be a number'),
        ("vehicle.mass_kg=[", "--set vehicle.mass_kg:1:2: not valid YAML: "),
        ("vehicle.mass_kg.x=1", "--set vehicle.mass_kg.x=1: 'vehicle.mass_kg' is a single value and has no keys"),
        ("vehicle.rotors.9.spin=1", "--set vehicle.rotors.9.spin=1: '9' is not an index of a list of 4"),
        ("vehicle.rotors.-1.spin=1", "--set vehicle.rotors.-1.spin=1: '-1' is not an index of a list of 4"),
        ("vehicle.rotors.0.spinn=1", "FILE: vehicle.rotors.0.spinn = 1: unknown key (did you mean 'spin'?)"),
    ],
)
def test_wrong_override(wrong, override, message):
    (line,) = wrong("vehicle: {mass_kg: 6}\n", "--set", override, whole=True)
    assert line.startswith(message)


def test_an_integration_without_end_is_refused(wrong):
    key = "simulation.closed_loop.integration_rate_hz"
    (line,) = wrong("vehicle: {mass_kg: 6}\n", "--set", f"{key}=1e12", whole=True)
    assert line.startswith(f"FILE: {key} = 1000000000000.0: must be less than or equal to 100000")


def test_what_a_vehicle_lacks_is_named_and_no_other_vehicle_stands_in_for_it(wrong):
    lines = wrong("vehicle: {mass_kg: 0.03, rotors: [{position_m: [0.03, 0.03, 0]}]}")
    assert [line.partition(":")[2].partition(";")[0] for line in lines] == [
        " vehicle.inertia_kg_m2: is missing",
        " vehicle.rotor_speed_max_rad_s: is missing",
        " vehicle.rotors.0.spin: is missing",
        " vehicle.rotors.0.thrust_factor_n_s2: is missing",
        " vehicle.rotors.0.drag_factor_n_m_s2: is missing",
    ]
    assert "null if it is not known" in lines[0]
    assert "null" not in lines[1]
    assert len(wrong("seed: 1\n")) == 4


@pytest.mark.parametrize("inertia", ["[0.6, 0.6, 10]", "[1, 1, 1, 0.9, 0, 0]"])
def test_an_inertia_that_no_body_has_is_refused(wrong, inertia):
    (line,) = wrong(f"vehicle: {{inertia_kg_m2: {inertia}}}", whole=True)
    assert "no body has this inertia" in line
    assert line.startswith("FILE: vehicle.inertia_kg_m2 = [")


def test_an_inertia_that_flights_can_correct_is_taken(cpfls, tmp_path):
    """Of a flat vehicle Izz is the sum of the others, so that one of them stated too small is that of no body."""
    config = put_file(tmp_path / "study.yaml", with_vehicle("vehicle: {inertia_kg_m2: [0.42, 0.42, 1.2]}"))
    cpfls.done("config", config)


def test_default_is_the_default_study(cpfls, tmp_path):
    assert load_study(put_file(tmp_path / "default.yaml", cpfls("config").stdout)) == Study()


def test_shipped_configs_load_and_print_the_same_study(cpfls, configs, tmp_path):
    for config in configs:
        path = put_file(tmp_path / config.name, cpfls("config", config).stdout)
        assert load_study(path) == load_study(config), config


def test_any_yaml_reader_reads_it_as_the_json_says(cpfls, configs):
    for config in configs:
        as_json = cpfls.summary("config", config)
        assert yaml.safe_load(cpfls("config", config).stdout) == as_json


@pytest.mark.parametrize("section", SECTIONS)
def test_section(cpfls, study, section):
    printed = yaml.safe_load(cpfls("config", study, "--section", section).stdout)
    assert printed == {"seed": 1, section: cpfls.summary("config", study)[section]}


def test_single_key_and_several_sections(cpfls, study):
    words = ("config", study, "--section", "vehicle.mass_kg", "--section", "reduction", "--json")
    printed = json.loads(cpfls(*words).stdout)
    assert (printed["vehicle"], set(printed)) == ({"mass_kg": 6.0}, {"seed", "vehicle", "reduction"})


def test_unknown_section(refuse, study):
    (line,) = refuse("config", study, "--section", "vehicl")
    assert line.startswith("--section vehicl: no such section or key; the sections are vehicle, ")


def test_overrides_need_a_config(refuse):
    assert refuse("config", "--set", "seed=2") == ["--set seed=2: needs a CONFIG"]


def test_overrides_show(cpfls, study):
    words = ("config", study, "--set", "vehicle.rotors.0.spin=-1", "--set", "reduction.criterion=A", "--seed", 9)
    shown = cpfls.summary(*words)
    assert (shown["seed"], shown["reduction"]["criterion"]) == (9, "A")
    assert [rotor["spin"] for rotor in shown["vehicle"]["rotors"]] == [-1, -1, 1, -1]


@pytest.mark.parametrize("dry", [(), ("--dry-run",)], ids=["run", "dry-run"])
@pytest.mark.parametrize(
    ("size", "message"),
    [
        (550, "the training set has only 549 samples; keep fewer"),
        (37, "the training set has rank 113, which takes 38 samples or more"),
    ],
)
def test_size_that_does_not_suit_the_flight(refuse, pipeline, study, tmp_path, size, message, dry):
    assert refuse(
        "reduce", study, pipeline.flight, *("-o", tmp_path / "out.h5", "--set", f"reduction.size={size}", *dry)
    ) == [f"{pipeline.flight}: reduction.size = {size}: {message}"]


def test_all_samples_can_be_asked_for(cpfls, pipeline, study, tmp_path):
    words = ("-o", tmp_path / "out.h5", "--set", "reduction.size=549", "--dry-run")
    cpfls.done("reduce", study, pipeline.flight, *words)


@pytest.mark.decides
@pytest.mark.parametrize(
    ("size", "target", "words"),
    [
        ("60", 2.0, "reduction.size stopped the selection; raise it or set it to null"),
        ("null", 2.0, "all samples are in"),
        ("60", 1e9, None),
    ],
)
def test_a_condition_number_that_is_not_reached_is_said(cpfls, pipeline, study, tmp_path, size, target, words):
    options = ("--set", f"reduction.size={size}", "--set", f"reduction.condition_number={target}", "--json")
    faster = ("--set", "reduction.criterion=D", "--set", "identification.training_share=0.2")
    result = cpfls("reduce", study, pipeline.flight, "-o", tmp_path / "out.h5", *options, *faster)
    reached = json.loads(result.stdout)["condition_number"]
    note = f"the target reduction.condition_number = 2 is not reached, the selection has {number(reached, 5)}: {words}"
    assert (f"cpfls: note: {note}\n" in result.stderr) is bool(words)
    assert ("reduction.condition_number" in result.stderr) is bool(words)
