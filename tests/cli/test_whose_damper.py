"""Parameters hold for one damper: which one is always said, and never another one taken."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from damperfit.configuration.options import parameter_value
from damperfit.damper.valve_dampers import Monotube
from damperfit.errors import ConfigurationError
from damperfit.problem import Option
from damperfit.synthetic import SampleOptions, make_samples
from damperfit.tables.columns import SCHEMA_VERSION
from damperfit.units.quantities import parse_quantity, says_absolute_or_gauge

CONFIGS = Path(__file__).parents[2] / "configs"
SLIM = CONFIGS / "slim_race.toml"


@pytest.fixture(scope="module")
def slim(tmp_path_factory) -> Path:
    """Results of another damper, tested at 20 mm and 2 Hz."""
    folder = tmp_path_factory.mktemp("slim")
    configuration = load_configuration(SLIM)
    options = SampleOptions(
        settings=(1, 2), cycles=7.0, force_noise=1.0, displacement_noise=2e-6, amplitude=0.015,
        frequency=2.0, damper=configuration.damper,
    )  # fmt: skip
    make_samples(folder / "logs", options)
    out = str(folder / "results")
    code = main(
        ["identify", str(folder / "logs" / "setting_*.csv"), "--config", str(SLIM), "--out", out]
    )
    assert code in {0, 1}  # the configuration expects a third setting
    return folder / "results"


def test_results_of_one_damper_name_no_folders_beside_them(slim) -> None:
    record = json.loads((slim / "run.json").read_text(encoding="utf-8"))
    assert "folders_of_this_run" not in record
    assert record["held_out"] == []


@pytest.mark.parametrize("table", ["parameters.parquet", "parameters.csv"])
@pytest.mark.parametrize(("version", "is_known"), [(SCHEMA_VERSION, True), (99, False)])
def test_a_table_of_another_schema_is_said(run, slim, tmp_path, table, version, is_known) -> None:
    folder = Path(shutil.copytree(slim, tmp_path / "later"))
    record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    (folder / "run.json").write_text(json.dumps({**record, "schema_version": version}))
    known = pq.read_table(folder / "parameters.parquet")
    facts = {**json.loads(known.schema.metadata[b"damperfit"]), "schema_version": version}
    said = known.replace_schema_metadata({"damperfit": json.dumps(facts)})
    pq.write_table(said, folder / "parameters.parquet")
    for command in (
        ("simulate", "--setting", "1"),
        ("sweep", "--setting", "1", "--vary", "k_e=1,1.1"),
    ):
        ended = run(*command, "--parameters", folder / table, "--json")
        assert ended.code == 0, ended.err
        first = ended.err.splitlines()[0]
        assert ("schema version 99" in first and "update damperfit" in first) is not is_known


def _peak(ended) -> float:
    return json.loads(ended.out)["characteristics"]["peak_force_rebound"]


@pytest.mark.parametrize("table", ["parameters.parquet", "parameters.csv", ""])
def test_simulate_takes_damper_and_motion_from_the_results(run, slim, table) -> None:
    """It took the paper's geometry: 15 N for 661 N."""
    ended = run("simulate", "--setting", "1", "--parameters", slim / table, "--json")
    assert ended.code == 0, ended.err
    first = ended.err.splitlines()[0]
    assert first.startswith("damperfit: Damper: rod 12 mm, piston 36 mm")
    assert "that of " in first
    document = json.loads(ended.out)
    assert document["frequency_Hz"] == pytest.approx(2.0, rel=1e-3)
    assert document["characteristics"]["peak_speed_rebound"] == pytest.approx(0.1885, rel=1e-2)
    same = run(
        *("simulate", "--setting", "1", "--parameters", slim / table, "--json"),
        *("--config", SLIM, "--amplitude", "15mm", "--frequency", "2Hz"),
    )
    assert _peak(same) == pytest.approx(_peak(ended), rel=1e-3)
    paper = run("simulate", "--setting", "1", "--json", "--amplitude", "15mm", "--frequency", "2Hz")
    assert _peak(paper) != pytest.approx(_peak(ended), rel=0.1)


def test_a_motion_that_is_declared_goes_before_that_of_the_test(run, slim, tmp_path) -> None:
    (tmp_path / "m.toml").write_text('[rig]\nfrequency = "1Hz"\n')
    ended = run("simulate", "--setting", "1", "--parameters", slim, "--config", "m.toml")
    assert "sine of 15 mm at 1 Hz" in ended.out
    ended = run("simulate", "--setting", "1", "--parameters", slim, "--amplitude", "5mm")
    assert "sine of 5 mm at 2 Hz" in ended.out


@pytest.mark.parametrize("command", ["simulate", "sweep", "settings"])
def test_another_damper_is_refused(run, slim, tmp_path, command) -> None:
    asked = {
        "simulate": ("--setting", "1", "--parameters", slim),
        "sweep": ("--setting", "1", "--vary", "r_m1=1,2", "--parameters", slim),
        "settings": (slim,),
    }[command]
    ended = run(command, *asked, "--config", CONFIGS / "purdy2000.toml")
    assert ended.code == 2
    assert "damper.rod_diameter is 0.019 m" in ended.err
    assert "were fitted with 0.012 m" in ended.err
    assert len(ended.err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
    # What does not contradict is no other damper: the same value in another unit, other keys.
    (tmp_path / "same.toml").write_text('[damper]\ngas_pressure = "1.2MPaa"\n[rig]\nstrict = true')
    assert run(command, *asked, "--config", "same.toml").code == 0


def test_sweep_varies_about_the_results_own_damper(run, slim) -> None:
    ended = run("sweep", "--setting", "1", "--vary", "p_0=1,1.1", "--parameters", slim, "--json")
    assert "rod 12 mm" in ended.err.splitlines()[0]
    assert [row["value"] for row in json.loads(ended.out)["rows"]] == pytest.approx([12e5, 13.2e5])


def test_a_table_that_does_not_tell_its_damper_says_so(run, logs) -> None:
    ended = run("simulate", "--setting", "1", "--parameters", logs / "truth.csv")
    assert "truth.csv does not say whose parameters these are" in ended.err.splitlines()[0]
    assert "the paper's: [damper] is not declared" in ended.err.splitlines()[0]


def test_the_configured_folder_is_looked_into(run, logs, slim, tmp_path) -> None:
    shutil.copytree(slim, tmp_path / "mine")
    (tmp_path / "c.toml").write_text('[output]\nfolder = "mine"\n')
    for command in (("simulate",), ("sweep", "--vary", "r_m1=1,2")):
        ended = run(*command, "--setting", "2", "--config", "c.toml")
        assert f"setting 2 of {Path('mine') / 'parameters.parquet'}" in ended.err
        assert "reference set" in run(*command, "--setting", "2").err


def test_a_folder_without_parameters_is_no_results_folder(run, logs) -> None:
    ended = run("simulate", "--setting", "1", "--parameters", logs)
    assert ended.code == 2
    assert "no parameters.parquet in this folder" in ended.err


# Pa of each; a standard atmosphere is 101325 Pa.
PRESSURES = [
    ("12bara", 12e5),
    ("12barg", 13.01325e5),
    ("12 bar(g)", 13.01325e5),
    ("0barg", 1.01325e5),
    ("1.2MPaa", 12e5),
    ("1.2MPag", 1301325.0),
    ("1200kPag", 1301325.0),
    ("1200kPaa", 12e5),
    ("100psia", 689475.7293168361),
    ("100psig", 790800.7293168361),
    ("460000Paa", 4.6e5),
]


@pytest.mark.parametrize(("text", "pascal"), PRESSURES)
def test_absolute_and_gauge_pressures_are_understood(text, pascal) -> None:
    assert parse_quantity(text, "absolute pressure") == pytest.approx(pascal, rel=1e-14)
    assert says_absolute_or_gauge(text)
    loaded = load_configuration(overlay={"damper": {"gas_pressure": text}})
    assert loaded.damper.gas_pressure == pytest.approx(pascal, rel=1e-14)
    assert not any("absolute" in note for note in loaded.notes)


@pytest.mark.parametrize("text", ["1.99bar", "0.2bar", "0bar", "29psi", 199999.0, 1e5, "1e5"])
def test_a_low_pressure_that_does_not_say_which_is_asked_about(text) -> None:
    with pytest.raises(ConfigurationError, match=r"--x: is it absolute, or .* 'bara' or 'barg'"):
        load_configuration(
            overlay={"damper": {"gas_pressure": text}}, options={"damper.gas_pressure": Option("x")}
        )


@pytest.mark.parametrize(
    ("text", "has_note"), [("2bar", True), ("12bar", True), (2e5, False), ("2bara", False)]
)
def test_a_plausible_one_is_absolute_and_said_where_it_could_be_either(text, has_note) -> None:
    loaded = load_configuration(overlay={"damper": {"gas_pressure": text}})
    assert loaded.damper.gas_pressure in {2e5, 12e5}
    assert any("is taken as absolute" in note for note in loaded.notes) is has_note


@pytest.mark.parametrize("text", ["12Pa", 12.0, "2000bara", "1e9"])
def test_a_pressure_that_no_damper_has_is_refused_and_not_asked_about(text) -> None:
    with pytest.raises(ConfigurationError, match=r"expected 10000 to 1e\+08 Pa, found"):
        load_configuration(overlay={"damper": {"gas_pressure": text}})


@pytest.mark.parametrize(("text", "pascal"), PRESSURES)
def test_a_gas_pressure_that_is_held_takes_the_same_units(text, pascal) -> None:
    gas = Monotube().quantity("gas_pressure")
    assert parameter_value(gas, text) == pytest.approx(pascal, rel=1e-14)
    overlay = {"damper": {"model": "monotube"}, "identification": {"fix": {"gas_pressure": text}}}
    loaded = load_configuration(overlay=overlay)
    assert loaded.identification.fixed["gas_pressure"] == pytest.approx(pascal, rel=1e-14)


def test_no_modulus_counts_from_the_atmosphere(run) -> None:
    ended = run("simulate", "--setting", "1", "--set", "k_e=500barg")
    assert ended.code == 2
    assert "k_e = 500barg: expected a number in Pa" in ended.err


def test_settings_know_the_damper_without_run_json(run, slim, tmp_path) -> None:
    """The table says whose it is; the paper's damper was assumed."""
    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.copy(slim / "parameters.parquet", alone)
    asked = ("--amplitude", "15mm", "--frequency", "2Hz", "--json")
    ended, whole = run("settings", alone, *asked), run("settings", slim, *asked)
    assert "run.json is missing" in ended.err
    assert "the paper's is assumed" not in ended.err
    found, wanted = (json.loads(one.out)["forces"] for one in (ended, whole))
    assert len(found) == len(wanted) > 0
    for one, other in zip(found, wanted, strict=True):
        assert one["force_N"] == pytest.approx(other["force_N"], rel=1e-6)
    (tmp_path / "other.toml").write_text('[damper]\nrod_diameter = "13mm"\n')
    assert run("settings", alone, *asked, "--config", "other.toml").code == 2


@pytest.mark.parametrize("table", ["parameters.parquet", "parameters.csv", ""])
def test_samples_of_results_are_of_their_damper(run, slim, tmp_path, table) -> None:
    """They took the paper's geometry and motion: 828 N for 10117 N, with code 0."""
    noiseless = ("--cycles", "3", "--force-noise", "0N", "--displacement-noise", "0um")
    ended = run("samples", "s", "--settings", "2", "--parameters", slim / table, *noiseless)
    assert ended.code == 0, ended.err
    assert ended.err.startswith("damperfit: Damper: rod 12 mm, piston 36 mm")
    assert "Drive: sine, 15 mm, 2 Hz" in (tmp_path / "s" / "README.md").read_text()
    rows = (tmp_path / "s" / "setting_02.csv").read_text().splitlines()[4:]
    peak = max(float(row.split(",")[2]) for row in rows)
    simulated = run("simulate", "--setting", "2", "--parameters", slim, "--json")
    assert peak == pytest.approx(_peak(simulated), rel=2e-3)


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [
        ("--config", CONFIGS / "purdy2000.toml", "damper.rod_diameter is 0.019 m, but"),
        ("--model", "monotube", "--model: damper.model is monotube, but the parameters of"),
    ],
)
def test_samples_of_another_damper_are_refused(run, slim, tmp_path, option, value, says) -> None:
    ended = run("samples", "s", "--settings", "2", "--parameters", slim, option, value)
    assert ended.code == 2
    assert says in ended.err
    assert f"leave {option} out" in ended.err
    assert list(tmp_path.iterdir()) == []
