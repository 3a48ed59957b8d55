"""A body that cannot be: struck through where it is shown, in no export unless it is asked for, and then first."""

import pytest

from tests.builders.autopilots import STUDY, crossed, found_vehicle
from tests.builders.vehicle_models import write_vehicle

HEAVY = "Ixx 1.28 kg m^2"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("impossible")
    (folder / "study.yaml").write_text(STUDY)
    heavy = crossed(1.2, 0.16, (1.28, 0.012, 0.02), 1.0e-5, 1.6e-7, 900.0)
    write_vehicle(folder / "vehicle.h5", found_vehicle(heavy), STUDY)
    return folder


def report(cpfls, folder, form):
    page = folder / f"page.{form}"
    cpfls.done("report", folder / "study.yaml", folder / "vehicle.h5", "-o", page, "--format", form, "--force")
    return page.read_text()


def test_a_report_strikes_the_number_through_in_all_forms(cpfls, folder):
    assert "<s>Ixx 1.280</s> impossible" in report(cpfls, folder, "html")
    assert "~~Ixx 1.280~~ impossible" in report(cpfls, folder, "md")
    text = report(cpfls, folder, "json")
    assert "Ixx 1.280 impossible" in text
    assert "~~" not in text


@pytest.mark.parametrize(("command", "output"), [("export", "v.c"), ("export", "v.xml"), ("spread", "s.yaml")])
def test_no_export_holds_it_unless_it_is_asked_for(cpfls, folder, tmp_path, command, output):
    words = (command, folder / "vehicle.h5", "-o", tmp_path / output)
    refused = cpfls(*words, "--force")
    assert refused.exit_code == 2
    assert f"impossible numbers, which no such vehicle has: {HEAVY}" in refused.stderr
    assert "--anyway exports" in refused.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("output", ["v.c", "v.py", "v.xml", "v.sdf", "v.urdf", "v.toml"])
def test_who_asks_for_it_reads_it_first(cpfls, folder, tmp_path, output):
    form = ("--format", "jax") if output == "v.py" else ()
    result = cpfls.done("export", folder / "vehicle.h5", "-o", tmp_path / output, *form, "--anyway")
    assert f"IMPOSSIBLE NUMBERS, which no such vehicle has: {HEAVY}." in result.stdout
    written = (tmp_path / output).read_text()
    assert written.index("IMPOSSIBLE NUMBERS") < written.index("Vehicle: 1.2 kg")
    if output == "v.c":
        told = cpfls.told("export", folder / "vehicle.h5", "-o", tmp_path / output, "--anyway", "--force")
        assert told["impossible"] == HEAVY
