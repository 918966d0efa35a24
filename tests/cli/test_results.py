"""What is asked of results: report, settings, simulate, sweep, export; whose damper they are of."""

import csv
import json
import shutil
from pathlib import Path

import pytest

from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import reference_parameters
from damperfit.exporting.targets import TARGETS
from damperfit.synthetic import SampleOptions, make_samples
from tests.fakes import values_in
from tests.report_folder import make_results

ROOT = Path(__file__).parents[2]
SLIM, PAPER = (ROOT / "configs" / f"{name}.toml" for name in ("slim_race", "purdy2000"))


@pytest.fixture
def folder(results, tmp_path) -> Path:
    """A copy to be spoilt."""
    return Path(shutil.copytree(results, tmp_path / "results"))


def record_of(folder: Path) -> dict:
    return json.loads((folder / "run.json").read_text())


# report


def test_a_page_is_written_and_what_is_damaged_is_said(undrawn, run, tmp_path) -> None:
    results = make_results(tmp_path / "results")
    before = {path.name for path in results.iterdir()}
    ended = run("report", results)
    assert (ended.code, ended.out) == (0, "")
    assert {path.name for path in results.iterdir()} - before == {"report.html"}
    assert (results / "report.html").stat().st_size < 8e6
    ended = run("report", results, "--figures", "svg", "--out", tmp_path / "there", "--json")
    assert ended.code == 0
    files = [Path(name) for name in json.loads(ended.out)["files"]]
    assert tmp_path / "there" / "figures" / "fan.svg" in files
    assert all(path.is_file() for path in files)
    (results / "mse.parquet").unlink()
    ended = run("report", results)
    assert ended.code == 1
    assert "mse.parquet is missing" in ended.err


def test_identify_writes_page_figures_and_the_summary_of_a_job(
    run, undrawn, logs, monkeypatch
) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    Path("summary.md").write_text("before\n", encoding="utf-8")
    more = ("--report", "--plots", "png", "--github-summary")
    ended = run("identify", logs / "setting_01.csv", *more)
    assert ended.code == 0, ended.err
    assert Path("results/figures/fan.png").exists()
    report = Path("results/report.md").read_text(encoding="utf-8")
    assert Path("summary.md").read_text(encoding="utf-8") == f"before\n{report}"


# settings, and the checks and trends that identify tells


@pytest.fixture(scope="module")
def samples(sample_results) -> Path:
    """Results of the twenty sample runs."""
    return sample_results / "results"


def test_the_sample_runs_get_what_the_paper_found_by_hand(samples) -> None:
    record = record_of(samples)
    failed = [check for check in record["checks"] if check["passed"] is False]
    assert [check["name"] for check in failed] == ["no_outlier_setting"]
    assert "setting 20 (R_m1 +12." in failed[0]["reason"]
    trends = {trend["parameter"]: trend for trend in record["trends"]}
    outliers = {name: [o["setting"] for o in one["outliers"]] for name, one in trends.items()}
    assert (outliers["r_m1"], outliers["r_m2"], outliers["k_e"]) == ([20], [20], [])
    assert trends["k_e"]["is_erratic"]
    assert all(trend["monotone"] and trend["direction"] == "rising" for trend in trends.values())


def test_a_speed_beyond_the_tests_is_answered_with_a_note(run, results) -> None:
    told = {"0.5m/s": ("no", "never tested at settings 1-3"), "0.2": ("yes", "")}
    for speed, (tested, note) in told.items():
        ended = run("settings", results, "--velocity", speed, "--json")
        assert (ended.code, note in ended.err, bool(ended.err)) == (0, True, bool(note))
        rows = json.loads(ended.out)["forces"]  # the first setting, too, has what a click changes
        assert {(row["tested"], "change_N" in row) for row in rows} == {(tested, True)}


def test_forces_without_gas_are_those_with_it_less_the_gas_force(run, results) -> None:
    asked = ("settings", results, "--velocity", "0.2m/s", "--json", "--force")
    whole = json.loads(run(*asked, "320N").out)
    gas = whole["forces"][0]["gas_N"]
    bare = json.loads(run(*asked, f"{320.0 - gas}N", "--without-gas").out)
    for name in ("force_N", "measured_N", "model_N"):
        left = [row[name] - gas for row in whole["forces"]]
        assert [row[name] for row in bare["forces"]] == pytest.approx(left)
    (answer,), (expected,) = bare["answers"], whole["answers"]
    assert answer["position"] == pytest.approx(expected["position"])
    assert answer["force_below"] == pytest.approx(expected["force_below"] - gas)


@pytest.mark.parametrize(
    ("checks", "code"),
    [("no_cavitation,mse_below_1_percent", 0), ("purdy2000", 4), ("trend_monotone", 4)],
)
def test_a_check_asked_for_is_a_gate(run, logs, checks, code) -> None:
    more = ("--check", "fits_converged", "--check", checks)
    ended = run("identify", logs / "setting_*.csv", "--out", "r", *more)
    assert ended.code == code, ended.err
    assert ("check not evaluated: trend_monotone: " in ended.err) is (code == 4)
    assert bool(record_of(Path("r"))["gates_missed"]) is (code == 4)


# Curves without time: shown, asked, and refused where time is needed.


@pytest.fixture
def curves(tmp_path) -> Path:
    path = tmp_path / "curves.csv"
    rows = "50,100,50,200,50,80,50,150 100,180,100,420,100,150,100,330 "
    rows += "200,300,200,900,200,260,200,700 400,500,400,1600,400,450,400,1300"
    names = "(25-4.3) V-C,C,V-R,R,(12-4.3) V-C,C,V-R,R\nmm/s,N,mm/s,N,mm/s,N,mm/s,N"
    path.write_text("\n".join([names, *rows.split()]) + "\n")
    return path


def test_curves_are_shown_asked_and_not_fitted(run, curves) -> None:
    told = run("inspect", curves)
    assert (told.code, told.err) == (0, "")
    rows = [" ".join(line.split()) for line in told.out.splitlines()]
    assert "25-4.3 rebound 4 0.400 1600 200.0 420.0 564.0 1110 -" in rows
    assert "compression 4 0.400 -450.0 -80.00 -150.0 -183.0 -317.0 -" in rows
    assert max(map(len, told.out.splitlines())) <= 80
    told = run("identify", curves, "--out", "out")
    assert told.code == 3
    assert "damperfit settings curves.csv finds a force among them" in told.err
    (failure,) = record_of(Path("out"))["failures"]
    assert failure["kind"] == "TimelessError"
    assert not run("settings", curves).out.startswith("\n")


@pytest.mark.parametrize(
    ("force", "says"),
    [
        ("900N", "between 12-4.3 with 760 N and 25-4.3 with 970 N; nearest is 25-4.3"),
        ("-350N", "no curve gives it; the nearest is 25-4.3 with -320 N"),
        ("760N", "12-4.3 gives it"),
    ],
)
def test_a_force_is_found_among_curves(run, curves, force, says) -> None:
    told = run("settings", curves, "--force", force, "--velocity", "0.22m/s", "--quiet")
    assert told.code == 0
    assert says in " ".join(told.out.split())


# simulate and sweep

SET_M = "r_m1=1.8e4,r_m2=3.527e6,r_m3=2.597e6,k_e=365MPa,f_f=50N"


def sets(assignments: str) -> list[str]:
    return [word for one in assignments.split(",") for word in ("--set", one)]


def test_whose_parameters_are_taken_is_told(run, logs, folder) -> None:
    """Results beside it come before the reference set; a table and replacements before both."""
    ended = run("simulate", "--setting", "2", "--json")
    assert "parameters: setting 2 of results" in ended.err
    found = values_in(folder / "parameters.parquet")[2]
    assert json.loads(ended.out)["parameters"]["r_m1"] == found.r_m1
    missing = run("simulate", "--setting", "9")
    assert missing.code == 2
    assert "no parameters of setting 9; there are 1, 2, 3" in missing.err
    table = ("--parameters", logs / "truth.csv", "--set", "f_f=0")
    ended = run("simulate", "--setting", "3", *table, "--json")
    assert "replaced: f_f" in ended.err
    parameters = json.loads(ended.out)["parameters"]
    assert (parameters["f_f"], parameters["r_m2"]) == (0.0, reference_parameters(3).r_m2)


def test_a_family_is_table_figure_and_sentence(run) -> None:
    ended = run("sweep", "--setting", "10", "--vary", "R_m1=0.8,1,1.2", "--figures", "svg")
    assert ended.code == 0, ended.err
    assert "0.8 to 1.2 × R_m1: peak rebound " in ended.out
    assert {path.name for path in Path("sweep").iterdir()} == {"sweep.csv", "sweep_r_m1.svg"}
    with Path("sweep/sweep.csv").open(encoding="utf-8", newline="") as file:
        assert [row["factor"] for row in csv.DictReader(file)] == ["0.8", "1.0", "1.2"]
    assert "0.8 × R_m1" in Path("sweep/sweep_r_m1.svg").read_text(encoding="utf-8")


def test_the_papers_figures_at_once(run, undrawn) -> None:
    ended = run("sweep", "--paper", "--out", "paper", "--json")
    assert (ended.code, len(json.loads(ended.out)["rows"])) == (0, 15), ended.err
    figures = sorted(path.name[:8] for path in Path("paper").glob("*.png"))
    assert figures == [f"figure_{number}" for number in range(4, 10)]


def test_the_work_is_estimated_before_it_is_done(run) -> None:
    """0.0001 Hz ran for 29 s, unasked."""
    given = sets(SET_M)
    ended = run("simulate", *given, "--frequency", "0.0001Hz")
    assert ended.code == 2
    for words in ("4e+07 samples", "expected at most 5000000", "--max-steps 44000000"):
        assert words in ended.err
    # 4 cycles of 25 samples: the integrator takes more steps than that.
    few = ("simulate", *given, "--sample-rate", "37.5Hz", "--max-steps")
    steps = int(run(*few, "100").err.split("--max-steps ")[1])
    assert 500 < steps < 10_000
    # The samples alone: 4 cycles of 1000.
    many = ("simulate", *given, "--frequency", "1Hz", "--sample-rate", "100kHz", "--max-steps")
    for words, code in (
        ((*few, str(steps)), 0), ((*few, str(int(steps / 1.2))), 2), ((*many, "400000"), 0),
        ((*many, "399999"), 2), (("sweep", "--paper", "--max-steps", "100"), 2),
    ):  # fmt: skip
        assert run(*words).code == code


# export, and what stands where export, simulate and sweep write

SIMULATE = "simulate --setting 10 --cycles 1 -q"
WRITES = {
    **{name: f"export RESULTS --to {name} --out there -q" for name in sorted(TARGETS)},
    "sweep": "sweep --setting 10 --vary f_f=1,2 -q --out there",
    **{kind: f"{SIMULATE} --out there/a.{kind}" for kind in ("csv ", "parquet")},
    **{kind: f"{SIMULATE} --plot there/a.{kind}" for kind in ("png", "svg", "pdf")},
}


@pytest.fixture(scope="module")
def exported(tmp_path_factory) -> Path:
    return make_results(tmp_path_factory.mktemp("over") / "results")


@pytest.mark.parametrize("name", WRITES)
def test_what_was_written_before_is_replaced_and_another_file_is_not(run, exported, name) -> None:
    Path("there").mkdir()
    words = [str(exported) if word == "RESULTS" else word for word in WRITES[name].split()]
    assert run(*words).code in (0, 1)
    assert run(*words).code in (0, 1)
    for path in (one for one in Path("there").iterdir() if not one.name.startswith(".")):
        path.write_text("kept by hand\n")
        ended = run(*words)
        assert ended.code == 2
        assert f"{path.name}: is there already" in ended.err
        assert path.read_text() == "kept by hand\n"
        assert run(*words, "--overwrite").code in (0, 1)
        assert path.read_bytes() != b"kept by hand\n"


def test_of_two_files_none_is_written_where_one_of_them_is_another_s(run) -> None:
    Path("first").mkdir()
    Path("first/a.png").write_text("kept by hand\n")
    assert run(*SIMULATE.split(), "--out", "second/a.csv", "--plot", "first/a.png").code == 2
    assert not Path("second/a.csv").exists()


def test_an_export_is_a_folder_or_a_file_and_tells_what_it_loses(run, exported, tmp_path) -> None:
    for out, expected in (("new/folder", "new/folder/damper.csv"), ("front.csv", "front.csv")):
        ended = run("export", exported, "--to", "csv", "--out", tmp_path / out, "--json")
        assert ended.code == 1
        assert "the damper of the run is not known" in ended.err
        assert json.loads(ended.out)["files"][0] == str(tmp_path / expected)
        assert (tmp_path / expected).read_text().startswith("setting,")
    ended = run("export", exported, "--to", "carsim", "--out", "there", "--extend", "0.4")
    assert "on a class B road" in ended.err
    assert "the tables are untested" in ended.err
    assert ended.err.splitlines()[-1].startswith("note: tested to")


# Parameters hold for one damper: which one is always said, and never another one taken.


@pytest.fixture(scope="module")
def slim(tmp_path_factory) -> Path:
    """Results of another damper, tested at 15 mm and 2 Hz."""
    folder = tmp_path_factory.mktemp("slim")
    options = SampleOptions(
        settings=(1, 2), cycles=7.0, force_noise=1.0, displacement_noise=2e-6, amplitude=0.015,
        frequency=2.0, damper=load_configuration(SLIM).damper,
    )  # fmt: skip
    make_samples(folder / "logs", options)
    logs, out = str(folder / "logs" / "setting_*.csv"), str(folder / "results")
    code = main(["identify", logs, "--config", str(SLIM), "--out", out])
    assert code in {0, 1}  # the configuration expects a third setting
    return folder / "results"


def peak_of(ended) -> float:
    return json.loads(ended.out)["characteristics"]["peak_force_rebound"]


@pytest.mark.parametrize("table", ["parameters.csv", ""])
def test_simulate_and_samples_take_damper_and_motion_from_the_results(run, slim, table) -> None:
    """They took the paper's geometry: 15 N for 661 N, and 828 N for 10117 N."""
    asked = ("simulate", "--setting", "1", "--parameters", slim / table, "--json")
    ended = run(*asked)
    assert ended.code == 0, ended.err
    first = ended.err.splitlines()[0]
    assert first.startswith("damperfit: Damper: rod 12 mm, piston 36 mm")
    assert "that of " in first
    document = json.loads(ended.out)
    assert document["frequency_Hz"] == pytest.approx(2.0, rel=1e-3)
    assert document["characteristics"]["peak_speed_rebound"] == pytest.approx(0.1885, rel=1e-2)
    motion = ("--amplitude", "15mm", "--frequency", "2Hz")
    same = run(*asked, "--config", SLIM, *motion)
    assert peak_of(same) == pytest.approx(peak_of(ended), rel=1e-3)
    quiet = ("--cycles", "3", "--force-noise", "0N", "--displacement-noise", "0um")
    made = run("samples", "s", "--settings", "1", "--parameters", slim / table, *quiet)
    assert made.code == 0, made.err
    assert made.err.startswith("damperfit: Damper: rod 12 mm, piston 36 mm")
    rows = Path("s/setting_01.csv").read_text().splitlines()[4:]
    assert max(float(row.split(",")[2]) for row in rows) == pytest.approx(peak_of(ended), rel=2e-3)


@pytest.mark.parametrize(
    "words",
    ["simulate --setting 1 --parameters", "sweep --setting 1 --vary r_m1=1,2 --parameters",
     "settings"],
)  # fmt: skip
def test_another_damper_is_refused(run, slim, tmp_path, words) -> None:
    asked = (*words.split(), slim)
    ended = run(*asked, "--config", PAPER)
    assert ended.code == 2
    (line,) = ended.err.splitlines()
    assert "damper.rod_diameter is 0.019 m" in line
    assert "were fitted with 0.012 m" in line
    assert list(tmp_path.iterdir()) == []
    # What does not contradict is no other damper: the same value in another unit, other keys.
    Path("same.toml").write_text('[damper]\ngas_pressure = "1.2MPaa"\n[rig]\nstrict = true')
    assert run(*asked, "--config", "same.toml").code == 0
