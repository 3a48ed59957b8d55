"""Every key of a config is documented, and the commented default shows it."""

from cpfls_cli.config.keys import keys_of, known_keys
from cpfls_cli.config.resolved import commented_default
from cpfls_cli.config.study import SECTIONS, Study


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
