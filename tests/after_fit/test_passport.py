"""The passport of a damper, and a folder that is watched."""

import json
import shutil
import threading
import time

import pytest

import damperfit
from damperfit.cli import main
from damperfit.errors import DamperfitError
from tests.fleet.conftest import Here


def test_a_passport_is_a_page_and_a_baseline(short, tmp_path, capsys) -> None:
    results = short / "results"
    assert main(["passport", str(results), "--out", str(tmp_path), "--json"]) == 0
    page, record = json.loads(capsys.readouterr().out)["files"]
    text = (tmp_path / page).read_text(encoding="utf-8")
    run = damperfit.load(results)
    assert len(text) < 300_000
    assert "<script" not in text
    known = json.loads((tmp_path / record).read_text(encoding="utf-8"))["passport"]
    for log in run.logs:
        assert known["logs"][log.name] == log.facts["sha256"]
        assert log.facts["sha256"] in text
    assert len(known["clicks"]) == len(run.forces)
    (comparison,) = damperfit.compare(tmp_path / record, results).document()["comparisons"]
    changes = [line for line in comparison["lines"] if "different" in line["verdict"]]
    assert changes == []


@pytest.mark.parametrize("words", ["report", "settings", "advise --for k_e", "export --to csv"])
def test_a_passport_in_place_of_results_is_named_so(short, tmp_path, capsys, words) -> None:
    _, record = damperfit.passport(short / "results", out=tmp_path)
    name, *more = words.split()
    assert main([name, str(record), *more]) == 2
    assert "a baseline or passport" in capsys.readouterr().err
    assert main(["compare", str(tmp_path), str(short / "results")]) == 2
    assert str(record) in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "code", "edited_to"), [("report", 1, "0"), ("valves", 0, "-5")]
)
def test_an_edited_resistance_that_no_hole_has_is_left_out(
    edited, capsys, command, code, edited_to
) -> None:
    for name in ("parameters.parquet", "valve_parts.parquet", "valve_parts.csv"):
        (edited / name).unlink()
    table = edited / "parameters.csv"
    head, first, *others = table.read_text(encoding="utf-8").splitlines()
    cells = first.split(",")
    cells[head.split(",").index("r_m1")] = edited_to
    table.write_text("\n".join([head, ",".join(cells), *others]), encoding="utf-8")
    assert main([command, str(edited)]) == code
    page = edited / "report.html"
    shown = page.read_text(encoding="utf-8") if page.exists() else str(capsys.readouterr())
    assert f"R_m1 of setting 1: {edited_to}, expected above 0; left out" in shown


def test_what_a_log_says_is_escaped_on_the_page(short, tmp_path) -> None:
    text = (short / "setting_01.csv").read_text(encoding="utf-8")
    (tmp_path / "x_s1.csv").write_text(f"# serial: <b>7\n{text}", encoding="utf-8")
    run = damperfit.identify([tmp_path / "x_s1.csv"])
    page, _ = damperfit.passport(run, out=tmp_path)
    assert page.name == "passport__b_7.html"
    assert "<b>7" not in page.read_text(encoding="utf-8")


@pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("watchfiles"), reason="needs watchfiles"
)
def test_a_watched_folder_answers_complete_logs_once_and_keeps_the_results(
    sample_results, results, tmp_path
) -> None:
    runs, out = tmp_path / "runs", tmp_path / "out"
    runs.mkdir()
    logs = sample_results / "sample_runs"
    shutil.copy(logs / "setting_01.csv", runs)  # there before
    stop, seen = threading.Event(), []

    def rig() -> None:
        text = (logs / "setting_02.csv").read_text(encoding="utf-8")
        with (runs / "setting_02.csv").open("w", encoding="utf-8") as file:
            for k in range(4):  # written in four parts
                file.write(text[k * len(text) // 4 : (k + 1) * len(text) // 4])
                file.flush()
                time.sleep(0.1)
        (runs / "bad_s3.csv").write_text("x,y\n1,2\n", encoding="utf-8")
        shutil.copy(runs / "setting_01.csv", runs / "copy_01.csv")

    threading.Thread(target=rig).start()
    for arrival in damperfit.watch(runs, out=out, reference=results, stop=stop):
        seen.append(arrival)
        if len(seen) == 4:
            stop.set()
    by_name = {arrival.path.name: arrival for arrival in seen}
    assert set(by_name) == {"setting_01.csv", "setting_02.csv", "bad_s3.csv", "copy_01.csv"}
    assert by_name["bad_s3.csv"].run is None
    assert "the same log as setting_01.csv" in by_name["copy_01.csv"].verdict
    document = by_name["setting_01.csv"].document()
    assert document["setting"] == 1
    assert {one["stroke"] for one in document["forces"]} == {"rebound", "bump"}
    assert abs(document["forces"][0]["change_percent"]) < 1.0
    assert "good" in by_name["setting_01.csv"].sentence
    whole = damperfit.identify([logs / "setting_02.csv"])
    found = by_name["setting_02.csv"].run
    assert found.setting(2).values["k_e"] == whole.setting(2).values["k_e"]  # no part was fitted
    assert [setting.label for setting in damperfit.load(out).settings] == ["1", "2"]
    assert (out / "report.html").exists()


@pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("watchfiles"), reason="needs watchfiles"
)
def test_a_folder_that_goes_ends_the_watch(tmp_path) -> None:
    runs = tmp_path / "runs"
    runs.mkdir()
    threading.Timer(0.5, runs.rmdir).start()
    with pytest.raises(DamperfitError, match="is gone"):
        list(damperfit.watch(runs))


def test_a_reference_of_another_model_is_refused(short, tmp_path, capsys) -> None:
    log = short / "setting_01.csv"
    damperfit.identify([log], model="bilinear", out=tmp_path / "other")
    for words in (["watch", str(tmp_path)], ["valves", str(short / "results")]):
        assert main([*words, "--reference", str(tmp_path / "other")]) == 2
        assert "bilinear" in capsys.readouterr().err
    other = damperfit.identify([log], damper={"rod_diameter": "18mm"})
    found = damperfit.load(short / "results").valves(reference=other)
    assert any("declared otherwise" in remark for remark in found.remarks)


def test_a_part_of_a_fleet_is_not_enough_and_is_not_offered(
    short, tmp_path, capsys, monkeypatch
) -> None:
    monkeypatch.setattr("damperfit.workers.Processes", Here)
    log = short / "setting_01.csv"
    assert main(["fleet", str(log), "--out", str(tmp_path), "--quiet"]) == 0
    (part,) = tmp_path.glob("serial-*")
    for words in (f"advise {part} --for k_e", f"passport {part} --out {part}"):
        assert main(words.split()) == 2
        assert "part of a fleet" in capsys.readouterr().err
        assert main([words.split()[0], "--help"]) == 0
        assert "serial-" not in capsys.readouterr().out
