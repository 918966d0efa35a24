"""``damperfit fleet`` as a user runs it: what is new is done, what ends a worker costs itself."""

import os
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import OutputError
from damperfit.fleets.parts import collect, parts_in
from damperfit.fleets.run import State, planned, run_fleet
from damperfit.workers import Died
from tests.fleet.conftest import Here, put, run, table_of
from tests.fleet.deadly import Poisoned

pytestmark = pytest.mark.usefixtures("here")
EMPTY = {"setting_05.csv": ("", "")}


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def failed(folder: Path) -> list[dict]:
    table = table_of(folder)
    texts = table[table["error"].notna()].select_dtypes(exclude="number")
    return texts.fillna("").to_dict("records")


def test_of_a_damper_tested_on_two_dates_the_last_is_shown(tmp_path, texts, out, capsys):
    for day in ("2026-03-08", "2026-03-01"):
        put(tmp_path / day, texts, "SN7")
        for log in (tmp_path / day).glob("*.csv"):
            log.write_text(f"# date: {day}\n{log.read_text()}")
            log.rename(tmp_path / f"{day.replace('-', '')}_{log.name}")
    assert run(tmp_path, "--out", out) == 0
    assert len(parts_in(out)) == 2
    for words in ("report", "settings"):
        assert main([words, str(out / "serial-SN7")]) == 0
        assert "the last is taken, of 2026-03-08" in capsys.readouterr().err
    assert main(["simulate", "--parameters", str(out / "serial-SN7"), "--setting", "1"]) == 0
    (told,) = [line for line in capsys.readouterr().err.splitlines() if "2026-03-08" in line]
    assert told.startswith("note: ")


def test_clicks_behind_the_date_in_a_name_are_no_time(tmp_path, texts, out):
    days, clicks = ("2026-03-01", "2026-03-08"), ("12-08", "10-06")
    for day, place, (head, rows) in zip(days, clicks, texts.values(), strict=True):
        kept = [line for line in head.splitlines(keepends=True) if "setting" not in line]
        log = tmp_path / "SN7" / f"{day}_{place}.csv"
        log.parent.mkdir(exist_ok=True)
        log.write_text(f"# date: {day}\n{''.join(kept)}{rows}")
    pattern = r"setting_pattern=_(?P<setting>\d+)-"
    assert run(tmp_path, "--rig", pattern, "--out", out) == 0
    assert len(parts_in(out)) == 1  # each setting was tested once


def test_every_damper_gets_a_part_and_all_one_table_and_what_is_new_is_done(three, out, capsys):
    assert run(three, "--out", out, "--collect") == 0
    assert capsys.readouterr().out == "3 dampers: 3 fitted now; 6 logs, 6 settings with a fit\n"
    found = table_of(out)
    assert found[["serial", "setting"]].to_numpy().tolist() == [
        [serial, setting] for serial in ("D1", "D2", "D10") for setting in ("1", "10")
    ]
    assert found["r_m1"].tolist() == pytest.approx(3 * [14000.0, 23945.0], rel=0.01)
    schema = pq.read_schema(out / "_fleet" / "fleet.parquet")
    assert schema.field("r_m1").metadata[b"symbol"] == b"R_m1"
    assert found["force_rebound_300_mm_per_s_N"].notna().all()
    assert (found["force_rebound_300_mm_per_s_se_N"] > 0.0).all()
    assert found["force_rebound_1050_mm_per_s_N"].isna().all()  # faster than the test
    log = three / "D2" / "setting_01.csv"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[:-2]))
    assert run(three, "--out", out, "--collect") == 0
    assert "1 fitted now, 2 done before" in capsys.readouterr().out
    assert len(table_of(out)) == 6


def test_a_bad_log_is_a_row_with_its_reason_and_not_tried_again(three, out, tmp_path, capsys):
    put(three / "D2", EMPTY)
    assert run(three, "--out", out, "--collect") == 1
    said = capsys.readouterr().err
    assert "D2: D2/setting_05.csv: empty file" in said
    assert str(tmp_path) not in said.replace(str(out), "")
    (bad,) = failed(out)
    assert (bad["serial"], bad["log"], bad["setting"]) == ("D2", "setting_05.csv", "5")
    assert bad["error_kind"] == "LogError"
    assert table_of(out)["r_m1"].notna().sum() == 6
    # It counts in the code, and is done all the same.
    assert run(three, "--out", out) == 1
    said = capsys.readouterr()
    assert "3 done before" in said.out
    assert "D2: D2/setting_05.csv: empty file" in said.err


def test_where_no_log_can_be_fitted_or_a_gate_is_missed_the_code_says_so(three, tmp_path, out):
    put(tmp_path / "bad", EMPTY)
    assert run(tmp_path / "bad", "--out", tmp_path / "none") == 3
    config = tmp_path / "gate.toml"
    config.write_text("[output]\nmax_mse_percent = 1e-6\n")
    for _ in range(2):  # also where it was done before
        assert run(three, "--out", out, "--config", config) == 4


@pytest.mark.slow
def test_shares_together_are_the_whole_and_their_folder_holds_no_logs(three, out, capsys):
    shared = three / "shared"
    run(three, "--out", out, "--collect")
    for k in (1, 2, 3):
        run(three, "--out", shared, "--part", f"{k}/3")
    run("--out", shared, "--collect")
    for name in ("_fleet/fleet.parquet", "_fleet/fleet.csv"):
        assert (out / name).read_bytes() == (shared / name).read_bytes()
    capsys.readouterr()
    assert run(three, "--out", shared) == 0
    assert "3 done before; 6 logs" in capsys.readouterr().out


class Dying(Here):
    """As if every worker died of a log called poison."""

    def result(self, act, item):
        dead = dict(item.dead)
        logs = [log for log in item.logs if log.place not in dead]
        return Died() if any("poison" in log.file for log in logs) else act(item)


class Together(Here):
    """As if workers died of two logs together."""

    def result(self, act, item):
        return Died() if len(item.logs) - len(item.dead) > 1 else act(item)


@pytest.mark.parametrize("kind", [Dying, pytest.param(Poisoned, marks=pytest.mark.slow)])
def test_a_log_that_ends_its_worker_costs_itself_alone(tmp_path, texts, out, kind):
    configuration, names = load_configuration(None), ("D1", "D2", "D3")
    for name in names:
        put(tmp_path / "logs" / name, texts)
    poison = tmp_path / "logs" / "D2" / "poison_setting_20.csv"
    poison.write_text(texts["setting_10.csv"][0])
    tasks, engine = planned(configuration, [str(tmp_path / "logs")], out), kind(1)
    done = {one.owner: one for one in run_fleet(configuration, tasks, out, engine)}
    told = {owner: (one.state, one.n_settings) for owner, one in done.items()}
    assert told == dict.fromkeys(names, (State.FITTED, 2))
    found = collect(out).to_pandas()
    (bad,) = found[found["error"].notna()].to_dict("records")
    assert (bad["serial"], bad["log"], bad["setting"]) == ("D2", poison.name, "20")
    assert "killed its worker process twice; it is left out" in bad["error"]
    # It is not given to a worker again.
    n_begun = engine.n_begun
    list(run_fleet(configuration, tasks, out, engine))
    assert engine.n_begun == n_begun


def full(*_):
    raise OutputError("out/part: cannot be written: No space left on device")


def short(*_, **__):
    raise MemoryError


@pytest.mark.parametrize(
    ("name", "breaks", "engine", "says"),
    [
        ("write_part", full, Here, "out/part: cannot be written: No space left on device"),
        ("identified", short, Here, ""),
        ("", None, Together, ""),
    ],
)
def test_trouble_of_the_machine_leaves_the_damper_for_the_next_run(
    three, out, monkeypatch, name, breaks, engine, says
):
    configuration = load_configuration(None)
    tasks = planned(configuration, [str(three)], out)
    with monkeypatch.context() as patch:
        if name:
            patch.setattr(f"damperfit.fleets.run.{name}", breaks)
        done = list(run_fleet(configuration, tasks, out, engine()))
    assert {(one.state, len(one.failures)) for one in done} == {(State.LATER, 1)}
    assert all(says in str(one.failures[0]) for one in done)
    assert parts_in(out) == []
    stopping: list = []
    cancelled = lambda: len(stopping) == 1  # noqa: E731
    for one in run_fleet(configuration, tasks, out, Here(), cancelled=cancelled):
        stopping.append(one)  # noqa: PERF402 - it is looked at meanwhile
    assert [one.state for one in stopping] == [State.FITTED]
    assert len(parts_in(out)) == 1


def test_other_models_and_labels_of_several_adjusters_have_columns_too(tmp_path, texts, out):
    head, rows = texts["setting_10.csv"]
    labelled = head.replace("# setting: 10", "# setting: R12 C8")
    put(tmp_path / "logs" / "D1", {"a.csv": (labelled, rows)})
    config = tmp_path / "two.toml"
    config.write_text('[adjusters]\nrebound = "from open"\ncompression = "from open"\n')
    options = ("--config", config, "--model", "bilinear", "--collect")
    assert run(tmp_path / "logs", "--out", out, *options) == 0
    (row,) = table_of(out).to_dict("records")
    assert (row["setting"], row["rebound"], row["compression"]) == ("R12 C8", "12", "8")
    assert isinstance(row["c_r"], float)


def test_a_log_that_cannot_be_read_has_the_setting_that_is_told_from_outside(tmp_path, texts, out):
    logs = tmp_path / "logs" / "D1"
    put(logs, texts | {"clicks_7.csv": ("", ""), "bad.csv": ("", "")})
    run(logs, "--out", out, "--collect")
    assert {bad["log"]: bad["setting"] for bad in failed(out)} == {
        "clicks_7.csv": "7",
        "bad.csv": "",
    }
    names = ("setting_01.csv", "setting_10.csv", "clicks_7.csv", "bad.csv")
    rows = "".join(f"{name},{k}\n" for name, k in zip(names, (1, 10, 8, 9), strict=True))
    (logs / "tests.csv").write_text("file,setting\n" + rows)
    run(logs, "--out", out, "--collect")
    assert {bad["log"]: bad["setting"] for bad in failed(out)} == {
        "clicks_7.csv": "8", "bad.csv": "9",
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="names that are no Unicode")
def test_a_folder_whose_name_is_no_unicode_is_a_damper_like_the_others(tmp_path, texts, out):
    logs = tmp_path / "logs"
    name, log = os.fsdecode(b"latin\xe4"), os.fsdecode(b"b\xe4d_s3.csv")
    put(logs / name, texts | {log: ("", "")})
    assert run(logs, "--out", out, "--report") == 1
    assert set(table_of(out)["serial"]) == {"latin\\xe4"}
    (bad,) = failed(out)
    assert (bad["log"], bad["setting"]) == ("b\\xe4d_s3.csv", "3")
    assert "latin\\xe4/b\\xe4d_s3.csv: empty file" in bad["error"]
    assert run(logs, "--out", out) == 1


# Found in review: each lost a result, doubled one, or gave a log to another damper.


def test_two_batches_with_the_same_table_of_tests_are_two_parts(tmp_path, texts, out):
    for day, name in (("monday", "setting_01.csv"), ("tuesday", "setting_10.csv")):
        put(tmp_path / day, {"log.csv": texts[name]})
        (tmp_path / day / "tests.csv").write_text("file,serial\nlog.csv,SN7\n")
        assert run(tmp_path / day, "--out", out) == 0
    assert len(parts_in(out)) == 2


def test_a_log_whose_owner_changes_has_one_part(tmp_path, texts, out):
    logs = tmp_path / "logs"
    put(logs / "box", texts)
    run(logs, "--out", out)
    table = "file,serial\nsetting_01.csv,D007\nsetting_10.csv,D007\n"
    (logs / "box" / "tests.csv").write_text(table)
    run(logs, "--out", out, "--collect")
    assert set(table_of(out)["serial"]) == {"D007"}


def test_tables_of_two_folders_speak_for_their_own_logs(tmp_path, texts, out):
    logs = tmp_path / "logs"
    for day, name, setting in (("mon", "setting_01.csv", 3), ("tue", "setting_10.csv", 4)):
        head, rows = texts[name]
        head = "".join(line for line in head.splitlines(True) if "setting" not in line)
        put(logs / day, {"log.csv": (head, rows)})
        (logs / day / "tests.csv").write_text(f"file,serial,setting\nlog.csv,SN7,{setting}\n")
    assert run(logs, "--out", out, "--collect") == 0
    assert table_of(out)["setting"].tolist() == ["3", "4"]


def test_a_damaged_part_does_not_hide_what_was_done(three, out, capsys):
    run(three, "--out", out)
    part = parts_in(out)[0]
    part.write_bytes(part.read_bytes()[:-7])
    (three / "D1" / "setting_01.csv").unlink()
    put(three / "D2", EMPTY)
    assert run(three, "--out", out, "--collect") in {1, 2}
    assert "setting_05.csv: empty file" in capsys.readouterr().err
