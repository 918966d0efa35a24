"""Faults by code and exit status: what is given, what is wrong, what is named."""

import ast
import json
import pickle
from pathlib import Path

import pytest

import damperfit
from damperfit import errors
from damperfit.cli.main import app, main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, DamperfitError, LogError
from damperfit.problem import FilePlace, Option, Problem, Words, warning
from damperfit.synthetic import SampleOptions, make_samples

# The command; its exit status, the code of the problem, and what its sentence begins with.
COMMANDS = [
    ("identify nothing.csv", 2, "no-such-file", "nothing.csv"),
    ("inspect --config nothing.toml LOG", 2, "unreadable", "--config nothing.toml"),
    ("identify LOG --config bad.toml", 2, "out-of-range", "--config bad.toml:2: rig.skew"),
    ("identify LOG --config unknown.toml", 2, "unknown-key", "--config unknown.toml:2"),
    ("identify LOG --procedure x", 2, "unknown-procedure", "--procedure"),
    ("identify LOG --free x", 2, "unknown-quantity", "--free"),
    ("identify LOG --fix k_e=x", 2, "not-a-number", "--fix"),
    ("identify LOG --start k_e=1", 2, "implausible", "--start"),
    ("identify LOG --check x", 2, "unknown-check", "--check"),
    ("identify LOG --rig skip_lines=a", 2, "wrong-value", "--rig skip_lines"),
    ("identify LOG --hold-out x*", 2, "no-such-file", "--hold-out x*"),
    ("identify LOG --setting 9", 2, "other-setting", "--setting 9"),
    ("identify LOG --tests nothing.csv", 2, "bad-table-of-tests", "--tests nothing.csv"),
    ("identify LOG --out a_file", 2, "not-a-folder", "--out a_file"),
    ("identify LOG --out a_file/x", 2, "not-a-folder", "--out a_file/x"),
    ("identify LOG --out s3://b/x", 2, "no-address", "--out s3://b/x"),
    ("simulate --setting 5 --out a_file/x.csv", 2, "not-a-folder", "--out a_file/x.csv"),
    ("settings nothing", 2, "no-folder", "nothing"),
    ("compare a_file a_file", 2, "no-results", "a_file"),
    ("export nothing --to csv", 2, "no-folder", "nothing"),
    ("config surplus", 2, "unexpected-argument", "config: unexpected argument surplus"),
    ("samples runs --force-noise -1N", 2, "out-of-range", "--force-noise -1"),
    ("sweep --setting 5 --vary x=1", 2, "unknown-name", "--vary x=1"),
]
# The log; the exit status of `identify`, and the code in run.json beside a good log.
LOGS = [
    ("", 1, "no-data"),
    ("time_s,displacement_mm,force_N\n0,1,2\n", 1, "too-short"),
    ("time_s,displacement_mm\n0,1\n1,2\n", 1, "no-column"),
    ("# setting: 2\ntime_s,displacement_mm,force_N\n" + "0,0,0\n" * 9, 1, "bad-clock"),
]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A good log of setting 1."""
    folder = tmp_path_factory.mktemp("log")
    options = SampleOptions(settings=(1,), cycles=7.0, force_noise=1.0, displacement_noise=2e-6)
    return make_samples(folder, options)[0]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a_file").write_text("kept")
    (tmp_path / "bad.toml").write_text("[rig]\nskew = 3\n")
    (tmp_path / "unknown.toml").write_text("[rig]\nskeww = 3\n")
    return tmp_path


@pytest.mark.parametrize(("words", "status", "code", "begins"), COMMANDS)
def test_a_command_that_cannot_be(here, log, capsys, words, status, code, begins) -> None:
    argv = [str(log) if word == "LOG" else word for word in words.split()]
    assert main(argv) == status
    seen = capsys.readouterr()
    assert seen.out == ""
    (line,) = seen.err.splitlines()
    assert line.startswith(f"damperfit: {begins}"), line
    with pytest.raises(DamperfitError) as caught:
        app(argv, standalone_mode=False, prog_name="damperfit")
    assert caught.value.problem.code == code
    assert sorted(one.name for one in here.iterdir()) == ["a_file", "bad.toml", "unknown.toml"]


@pytest.mark.parametrize(("text", "status", "code"), LOGS)
def test_a_log_that_cannot_be_costs_itself_alone(here, log, capsys, text, status, code) -> None:
    (here / "bad.csv").write_text(text)
    assert main(["identify", str(log), "bad.csv", "--out", "out", "--quiet"]) == status
    (failure,) = json.loads((here / "out" / "run.json").read_text())["failures"]
    assert failure["log"] == "bad.csv"
    assert failure["code"] == code
    assert {"path", "setting", "kind", "message"} <= set(failure)


@pytest.mark.parametrize("name", ["no/run--hot.csv", "a--check=3.csv", "{setting}.csv"])
def test_a_file_is_named_as_it_is(here, name) -> None:
    with pytest.raises(DamperfitError) as caught:
        damperfit.identify([name])
    assert caught.value.problem.subject == name
    assert name in str(caught.value)


def test_a_wrong_value_is_blamed_on_its_own_line(here) -> None:
    (here / "two.toml").write_text(
        "[test]\nserial = 'papr'\n[identification]\nprocedure = 'papr'\n[rig]\nprofile = ''\n"
    )
    with pytest.raises(ConfigurationError) as caught:
        load_configuration("two.toml")
    assert caught.value.problem.where == FilePlace("two.toml", 4, Option("config"))
    assert caught.value.problem.subject == "identification.procedure"


def test_each_outlet_words_a_problem_for_itself(log) -> None:
    with pytest.raises(ConfigurationError) as typed:
        load_configuration(
            overlay={"identification": {"procedure": "x"}},
            options={"identification.procedure": Option("procedure")},
        )
    assert str(typed.value).startswith("--procedure: ")
    with pytest.raises(ConfigurationError) as called:
        damperfit.identify([log], procedure="x")
    assert str(called.value).startswith("damperfit.identify(procedure=...): ")
    assert called.value.problem.message() == typed.value.problem.message()


def test_a_problem_survives_the_way_from_a_worker() -> None:
    error = LogError("give {how}", code="no-setting", subject="a.csv", how=Option("setting", "N"))
    error.words = Words("damperfit.identify")
    sent = pickle.loads(pickle.dumps(error))  # noqa: S301 - our own
    assert sent.problem == error.problem
    assert str(sent) == "a.csv: give --setting N"
    assert str(error) == "a.csv: give setting=N"


def test_a_problem_is_read_back_from_its_record_and_worded_again() -> None:
    known = warning("skew", "{n} ms late: give {how}", "a.csv", n=3, how=Option("skew", "auto"))
    problem = Problem.of_record(json.loads(json.dumps(known.record())))
    assert problem.record() == known.record()
    assert str(problem) == "a.csv: 3 ms late: give --skew auto"
    assert problem.sentence(Words("damperfit.identify")).endswith("give skew='auto'")


def test_advice_reaches_a_python_user_in_his_words(log, tmp_path) -> None:
    lines = log.read_text().splitlines()
    (tmp_path / "x_1.csv").write_text("\n".join(one for one in lines if "setting" not in one))
    with pytest.raises(DamperfitError) as caught:
        damperfit.identify([tmp_path / "x_1.csv"])
    assert "rig={'setting_pattern': " in str(caught.value)
    assert "--" not in str(caught.value)


def test_a_template_does_not_touch_braces_of_values() -> None:
    error = LogError("column {name}; give {how}", name="{force}", how=Option("rig", "N", "x"))
    assert str(error) == "column {force}; give --rig x=N"


@pytest.mark.parametrize(
    "package", ["io", "identification", "configuration", "errors", "arguments", "api"]
)
def test_every_refusal_has_a_code_of_its_own(package) -> None:
    place = Path(damperfit.__file__).parent / package
    kinds = {name for name in vars(errors) if name.endswith("Error")}
    bare = [
        f"{path.name}:{node.lineno}"
        for path in (place.rglob("*.py") if place.is_dir() else [place.with_suffix(".py")])
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in kinds
        if not any(one.arg in {"code", None} for one in node.keywords)
    ]
    assert bare == []
