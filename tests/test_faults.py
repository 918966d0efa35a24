"""Faults by code: what is wrong, what is named, and that a bad log costs itself alone."""

import ast
import gzip
import io
import json
import pickle
import sys
import zipfile
from pathlib import Path

import pytest

import damperfit
from damperfit import compiled_core, errors
from damperfit.cli.main import main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, DamperfitError, LogError
from damperfit.problem import FilePlace, Option, Problem, Words, warning
from damperfit.synthetic import SampleOptions, make_samples

LIMIT = 4_000_000  # bytes, so that bombs can be small
QUICK = (
    *("--procedure", "plain", "--free", "r_m1,r_m2,k_e", "--fix", "r_m3=2.6e6"),
    *("--fix", "f_f=50N", "--quiet", "--rig", f"max_log_bytes={LIMIT}"),
)
TABLES = ("parameters.parquet", "parameters.csv", "mse.parquet", "mse.csv", "responses.parquet")
HEAD = "time_s,displacement_mm,force_N\n"
NO_CLOCK = "0,0,0\n" * 9


def zipped(*members: str) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w") as archive:
        for name in members:
            archive.writestr(name, b"")
    return sink.getvalue()


def bad_logs(good: str) -> dict[str, tuple[bytes, str]]:
    """Each kind once, with its code; all that a reader may refuse is in `io/`."""
    rows = [row.split(",") for row in good.splitlines() if row[:1].isdigit()]
    small = "".join(f"{t},{float(x) / 1000:.7f},{f}\n" for t, x, f, *_ in rows)
    return {
        "empty_s101.csv": (b"", "no-data"),
        "short_s102.csv": (f"{HEAD}0,1,2\n".encode(), "too-short"),
        "lacking_s103.csv": (b"time_s,displacement_mm\n0,1\n1,2\n", "no-column"),
        "still_s104.csv": (f"{HEAD}{NO_CLOCK}".encode(), "bad-clock"),
        "page_s105.csv": (b"<!DOCTYPE html><html>404</html>", "unknown-format"),
        "bomb_s106.csv.gz": (gzip.compress(b"0,1,2,3\n" * (LIMIT // 8 + 1)), "unreadable"),
        "pickle_s107.pkl": (pickle.dumps([1.0]), "unknown-format"),
        "noise_s108.tdms": (bytes(range(256)), "damaged"),
        "many_s109.xlsx": (zipped(*(f"xl/workbook{k}" for k in range(20_000))), "too-large"),
        "above_s110.zip": (zipped("../../log.csv"), "damaged"),
        "metres_s111.csv": (good.replace("_mm", "_m", 1).encode(), "implausible"),
        "small_s112.csv": (f"{HEAD}{small}".encode(), "too-small"),
        "kilo_s113.csv": (good.replace("force_N", "force_kN", 1).encode(), "implausible"),
    }


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A good log of setting 1."""
    folder = tmp_path_factory.mktemp("log")
    options = SampleOptions(settings=(1,), cycles=7.0, force_noise=1.0, displacement_noise=2e-6)
    return make_samples(folder, options)[0]


def test_bad_logs_have_their_codes_and_leave_the_results_of_a_good_one(
    log, tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    bad = bad_logs(log.read_text().partition("time_s")[1] + log.read_text().partition("time_s")[2])
    for name, (content, _) in bad.items():
        Path(name).write_bytes(content)
    assert main(["inspect", str(log), *bad, "--json", *QUICK[-2:]]) == 1
    failures = json.loads(capsys.readouterr().out)["failures"]
    assert {one["log"]: one["code"] for one in failures} == {k: v[1] for k, v in bad.items()}
    assert all(one["log"] in one["message"] and one["message"].isprintable() for one in failures)
    assert main(["identify", str(log), *QUICK, "--out", "alone"]) == 0
    half = [*bad][:6], [*bad][6:]
    assert main(["identify", *half[0], str(log), *half[1], *QUICK, "--out", "among"]) == 1
    for name in TABLES:
        assert Path("among", name).read_bytes() == Path("alone", name).read_bytes()
    told = json.loads(Path("among", "run.json").read_text())["failures"]
    assert [one["code"] for one in told] == [one["code"] for one in failures]
    assert {"path", "setting", "kind", "message"} <= set(told[0])


def test_a_core_that_does_not_load_is_one_sentence(log, monkeypatch, capsys) -> None:
    monkeypatch.setitem(sys.modules, "damperfit.damper._core", None)  # its import fails
    monkeypatch.setattr(compiled_core, "_installed_core", lambda: None)
    assert main(["identify", str(log)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install --force-reinstall damperfit" in line


@pytest.mark.parametrize("name", ["no/run--hot.csv", "a--check=3.csv", "{setting}.csv"])
def test_a_file_is_named_as_it_is(name) -> None:
    with pytest.raises(DamperfitError) as caught:
        damperfit.identify([name])
    assert caught.value.problem.subject == name
    assert name in str(caught.value)


def test_parameters_to_free_are_named(log) -> None:
    with pytest.raises(ConfigurationError) as caught:
        damperfit.identify([log], free=[])
    assert caught.value.problem.code == "nothing-named"


def test_a_wrong_value_is_blamed_on_its_own_line(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("two.toml").write_text(
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


def test_every_refusal_has_a_code_of_its_own() -> None:
    kinds = {name for name in vars(errors) if name.endswith("Error")}
    bare = [
        f"{path.name}:{node.lineno}"
        for name in ("io", "identification", "configuration", "errors.py", "arguments.py", "api.py")
        for place in [Path(damperfit.__file__).parent / name]
        for path in (place.rglob("*.py") if place.is_dir() else [place])
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in kinds
        if not any(one.arg in {"code", None} for one in node.keywords)
    ]
    assert bare == []
