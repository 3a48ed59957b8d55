"""Whatever text and numbers a study holds, it comes back from its YAML unchanged."""

from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import parse_yaml, resolved_yaml, to_yaml
from tests.builders.studies import VEHICLE

printable = st.text(st.characters(exclude_categories=["Cs", "Cc", "Cn", "Co"]))
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | printable,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(printable, inner, max_size=4),
    max_leaves=12,
)
numbers = st.from_regex(r"[-+]?[0-9_.:xeE]{1,8}", fullmatch=True)


@given(plain)
def test_plain_data(data):
    assert parse_yaml(to_yaml(data), "file") == data


@given(numbers)
def test_text_like_numbers(text):
    assert parse_yaml(to_yaml([text]), "file") == [text]


@given(
    title=printable | numbers,
    mass=st.floats(3.0, 12.0),
    seed=st.integers(0, 2**63 - 1),
    sections=st.sets(st.sampled_from(["vehicle", "reduction", "import", "identification"])),
)
def test_study(title, mass, seed, sections):
    vehicle = parse_yaml(VEHICLE, "usual")["vehicle"] | {"mass_kg": mass}
    data = {"seed": seed, "vehicle": vehicle, "report": {"title": title}}
    study = validate(data | dict.fromkeys(sections - {"vehicle"}), "file")
    again = validate(parse_config(resolved_yaml(study), "file"), "file")
    assert again == study
    assert (again.seed, again.vehicle.mass_kg, again.report.title) == (seed, mass, title)
