"""Parameters hold for one damper: which one is always said, and never another one taken."""

import html
import json
from pathlib import Path

import pytest

from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from damperfit.synthetic import SampleOptions, make_samples

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


@pytest.mark.parametrize("mark", [":", ";", ",", "\t"])
def test_whose_test_it_is_stands_on_the_page_however_the_preamble_writes_it(
    run, tmp_path, mark
) -> None:
    log = Path(__file__).parents[2] / "sample_runs" / "setting_01.csv"
    rows = [one for one in log.read_text().splitlines() if not one.startswith("#")]
    told = {"Operator": "J. Smith", "Customer": "Team <Blue>", "Date": "2026-03-04"}
    head = [f"{key}{mark}{value}" for key, value in told.items()]
    (tmp_path / "log.csv").write_text("\n".join([*head, *rows]) + "\n")
    out = tmp_path / "results"
    ended = run("identify", tmp_path / "log.csv", "--setting", "1", "--out", out)
    assert ended.code == 0, ended.err
    assert run("report", out).code == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    for key, value in told.items():
        assert f"<dt>{key.lower()}</dt><dd>{html.escape(value)}</dd>" in page
        assert f"{key.lower()}: {value}" in (out / "report.md").read_text().replace("\\", "")
