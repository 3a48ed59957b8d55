"""Overrides change the key that they name and nothing else; the settings of a sweep are studies of their own."""

import pytest

from cpfls_cli.config.load import load_study, validate
from cpfls_cli.config.overrides import apply_override, variants
from cpfls_cli.config.study import Study, resolved
from cpfls_cli.errors import ConfigError
from tests.builders.studies import VEHICLE


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


def swept(settings, **sweep):
    return {"identification": {"population": 20}, "sweep": {"settings": settings, **sweep}}


def errors(data):
    with pytest.raises(ConfigError) as raised:
        validate(data, "FILE", sweep=True)
    return str(raised.value).splitlines()


def test_a_setting_is_the_study_that_its_overrides_make(tmp_path):
    settings = [{"name": "a", "set": {"reduction.size": 99, "identification.local_search.enabled": False}}]
    config = tmp_path / "study.yaml"
    config.write_text("identification: {population: 20}\n" + VEHICLE)
    (variant,) = variants(
        validate(swept(settings, set={"identification.structure": "fls", "identification.consequents": "seesaw"}), "x")
    )
    assert resolved(variant.study) == resolved(load_study(config, variant.overrides))
    assert (variant.study.reduction.size, variant.study.identification.structure) == (99, "fls")
    assert variant.reduced


def test_a_setting_goes_before_what_all_have():
    data = swept([{"name": "a"}, {"name": "b", "set": {"reduction.size": 7}}], set={"reduction.size": 5})
    assert [variant.study.reduction.size for variant in variants(validate(data, "x"))] == [5, 7]


@pytest.mark.parametrize(
    ("overrides", "reduced"),
    [
        ({}, True),
        ({"reduction.size": None}, False),
        ({"reduction.size": None, "reduction.condition_number": 10.0}, True),
        ({"reduction.size": 3}, True),
    ],
)
def test_a_reduction_that_nothing_stops_is_none(overrides, reduced):
    (variant,) = variants(validate(swept([{"name": "a", "set": overrides}]), "x"))
    assert variant.reduced == reduced


def test_without_settings_there_is_one():
    (variant,) = variants(validate({}, "x"))
    assert (variant.name, variant.overrides) == ("as configured", ())


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"reduction.sise": 3}, "reduction.sise = 3: unknown key (did you mean 'size'?)"),
        ({"identification.population": "x"}, 'identification.population = "x": must be a whole number'),
        (
            {"identification.subpopulations": 50},
            "identification.population = 20: 20 individuals cannot fill 50 subpopulations with two each; use at least "
            "100, or fewer subpopulations",
        ),
        (
            {"vehicle.mass_kg": 3},
            "vehicle.mass_kg = 3: a setting of a sweep overrides keys of reduction and identification only",
        ),
        (
            {"sweep.seeds": 3},
            "sweep.seeds = 3: a setting of a sweep overrides keys of reduction and identification only",
        ),
        (
            {"identification.preset": "paper"},
            'identification.preset = "paper": stands for keys that the config leaves out; name the keys that differ',
        ),
        (
            {"reduction": {"size": 3}},
            'reduction = {"size": 3}: is a section; name its keys one by one, with a dot: reduction.KEY',
        ),
        ({"reduction..size": 3}, "reduction..size = 3: write section.key=value"),
        (
            {"identification.population.x": 3},
            "identification.population.x = 3: 'identification.population' is a single value and has no keys",
        ),
    ],
)
def test_wrong_overrides_are_told_where_they_stand(overrides, said):
    assert errors(swept([{"name": "a"}, {"name": "b", "set": overrides}])) == [f"FILE: sweep.settings.1.set: {said}"]
    assert errors(swept([{"name": "a"}, {"name": "b"}], set=overrides)) == [f"FILE: sweep.set: {said}"]
    assert errors(swept([], set=overrides)) == [f"FILE: sweep.set: {said}"]


def test_all_errors_come_together_and_once():
    data = swept([{"name": "a", "set": {"reduction.sise": 1}}, {"name": "b", "set": {"reduction.sise": 1}}, {}], sees=2)
    data["identification"]["population"] = "x"
    assert errors(data) == [
        'FILE: identification.population = "x": must be a whole number',
        "FILE: sweep.settings.2.name: is missing",
        "FILE: sweep.sees = 2: unknown key (did you mean 'seeds'?)",
        "FILE: sweep.settings.0.set: reduction.sise = 1: unknown key (did you mean 'size'?)",
        "FILE: sweep.settings.1.set: reduction.sise = 1: unknown key (did you mean 'size'?)",
    ]


def test_equal_names():
    (first,) = errors(swept([{"name": "a"}, {"name": "b"}, {"name": "a"}, {"name": "a"}]))
    assert first == 'FILE: sweep.settings.0.name = "a": appears more than once; give each setting its own name'


@pytest.mark.parametrize("sweep", [3, [], {"settings": 3}, {"settings": [3]}, {"settings": [{"name": "a", "set": 3}]}])
def test_what_is_no_sweep_is_told_once(sweep):
    (line,) = errors({"sweep": sweep})
    assert line.startswith("FILE: sweep")
