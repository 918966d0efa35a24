"""``damperfit fleet`` as a user runs it: what is new is done, what ends a worker costs itself."""

import os
import sys
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest

from damperfit.cli.main import main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import OutputError
from damperfit.fleets.parts import collect, parts_in
from damperfit.fleets.run import State, planned, run_fleet
from damperfit.workers import Died
from tests.fleet.conftest import Here, put
from tests.fleet.deadly import Poisoned


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr("damperfit.workers.Processes", Here)


def run(*arguments: str) -> int:
    return main(["fleet", *map(str, arguments)])


def table_of(folder: Path) -> pd.DataFrame:
    return pd.read_parquet(folder / "_fleet" / "fleet.parquet")


def test_every_damper_gets_a_part_and_all_one_table(three, tmp_path, here, capsys):
    out = tmp_path / "out"
    assert run(three, "--out", out, "--collect") == 0
    said = capsys.readouterr()
    assert said.out == "3 dampers: 3 fitted now; 6 logs, 6 settings with a fit\n"
    found = table_of(out)
    assert found[["serial", "setting"]].to_numpy().tolist() == [
        [serial, setting] for serial in ("D1", "D2", "D10") for setting in ("1", "10")
    ]
    assert found["r_m1"].tolist() == pytest.approx(3 * [14000.0, 23945.0], rel=0.01)
    assert (
        pq.read_schema(out / "_fleet" / "fleet.parquet").field("r_m1").metadata[b"symbol"]
        == b"R_m1"
    )
    assert found["force_rebound_300_mm_per_s_N"].notna().all()
    assert (found["force_rebound_300_mm_per_s_se_N"] > 0.0).all()
    assert found["force_rebound_1050_mm_per_s_N"].isna().all()  # faster than the test


def test_a_changed_log_makes_one_damper_new(three, tmp_path, here, capsys):
    out = tmp_path / "out"
    run(three, "--out", out)
    log = three / "D2" / "setting_01.csv"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[:-2]))
    capsys.readouterr()
    assert run(three, "--out", out, "--collect") == 0
    assert "1 fitted now, 2 done before" in capsys.readouterr().out
    assert len(table_of(out)) == 6


def test_a_bad_log_is_a_row_with_its_reason_and_not_tried_again(three, tmp_path, here, capsys):
    out = tmp_path / "out"
    (three / "D2" / "setting_05.csv").write_text("time_s,displacement_mm,force_N\n1,2\n")
    assert run(three, "--out", out, "--collect") == 1
    said = capsys.readouterr()
    assert "D2: setting_05.csv" in said.err
    found = table_of(out)
    (bad,) = found[found["error"].notna()].to_dict("records")
    assert (bad["serial"], bad["log"], bad["setting"]) == ("D2", "setting_05.csv", "5")
    assert bad["error_kind"] == "LogError"
    assert found["r_m1"].notna().sum() == 6
    # It counts in the code, and is done all the same.
    assert run(three, "--out", out) == 1
    assert "3 done before" in capsys.readouterr().out


def test_where_no_log_can_be_fitted_the_code_says_so(tmp_path, here):
    put(tmp_path / "logs", {"setting_01.csv": ("time_s,displacement_mm,force_N\n", "1,2\n")})
    assert run(tmp_path / "logs", "--out", tmp_path / "out") == 3


def test_a_missed_gate_ends_with_4(three, tmp_path, here, capsys):
    config = tmp_path / "gate.toml"
    config.write_text("[output]\nmax_mse_percent = 1e-6\n")
    out = tmp_path / "out"
    assert run(three, "--out", out, "--config", config) == 4
    assert "D1: " in capsys.readouterr().err
    assert run(three, "--out", out, "--config", config) == 4


def test_shares_together_are_the_whole(three, tmp_path, here):
    whole, shared = tmp_path / "whole", tmp_path / "shared"
    run(three, "--out", whole, "--collect")
    for k in (1, 2, 3):
        run(three, "--out", shared, "--part", f"{k}/3")
    run("--out", shared, "--collect")
    for name in ("_fleet/fleet.parquet", "_fleet/fleet.csv"):
        assert (whole / name).read_bytes() == (shared / name).read_bytes()


def test_the_fleet_s_own_folder_holds_no_logs(three, here, capsys):
    out = three / "out"
    run(three, "--out", out, "--collect")
    capsys.readouterr()
    assert run(three, "--out", out) == 0
    assert "3 done before; 6 logs" in capsys.readouterr().out


def poisoned(folder: Path, texts) -> None:
    for name in ("D1", "D2", "D3"):
        put(folder / name, texts)
    (folder / "D2" / "poison_setting_20.csv").write_text(texts["setting_10.csv"][0])


class Dying(Here):
    """As if every worker died of a log called poison."""

    def each(self, act, items, *, cancelled=None):  # noqa: ARG002
        for item in items:
            self.n_begun += 1
            dead = dict(item.dead)
            logs = [log for log in item.task.logs if log.place not in dead]
            is_deadly = any("poison" in log.file for log in logs)
            yield item, Died() if is_deadly else act(item)


@pytest.mark.parametrize("kind", [Dying, pytest.param(Poisoned, marks=pytest.mark.slow)])
def test_a_log_that_ends_its_worker_costs_itself_alone(tmp_path, texts, kind):
    configuration = load_configuration(None)
    poisoned(tmp_path / "logs", texts)
    out = tmp_path / "out"
    tasks = planned(configuration, [str(tmp_path / "logs")], out)
    engine = kind(1)
    done = {one.owner: one for one in run_fleet(configuration, tasks, out, engine)}
    assert {owner: one.state for owner, one in done.items()} == dict.fromkeys(
        ("D1", "D2", "D3"), State.FITTED
    )
    assert {owner: one.n_settings for owner, one in done.items()} == {"D1": 2, "D2": 2, "D3": 2}
    found = collect(out).to_pandas()
    (bad,) = found[found["error"].notna()].to_dict("records")
    assert (bad["serial"], bad["log"]) == ("D2", "poison_setting_20.csv")
    assert bad["setting"] == "20"
    assert "killed its worker process twice; it is left out" in bad["error"]
    # It is not given to a worker again.
    n_begun = engine.n_begun
    list(run_fleet(configuration, tasks, out, engine))
    assert engine.n_begun == n_begun


def test_workers_that_die_with_no_log_alone_leave_the_damper_for_the_next_run(tmp_path, texts):
    class Together(Here):
        def each(self, act, items, *, cancelled=None):  # noqa: ARG002
            for item in items:
                n_living = len(item.task.logs) - len(item.dead)
                yield item, Died() if n_living > 1 else act(item)

    configuration = load_configuration(None)
    put(tmp_path / "logs" / "D1", texts)
    tasks = planned(configuration, [str(tmp_path / "logs")], tmp_path / "out")
    (done,) = run_fleet(configuration, tasks, tmp_path / "out", Together())
    assert (done.state, done.n_failures) == (State.LATER, 1)
    assert parts_in(tmp_path / "out") == []


def test_a_disk_that_is_full_leaves_the_damper_for_the_next_run(three, tmp_path, monkeypatch):
    def full(*_arguments):
        raise OutputError("out/part: cannot be written: No space left on device")

    configuration = load_configuration(None)
    tasks = planned(configuration, [str(three)], tmp_path / "out")
    with monkeypatch.context() as patch:
        patch.setattr("damperfit.fleets.run.write_part", full)
        done = list(run_fleet(configuration, tasks, tmp_path / "out", Here()))
    assert {one.state for one in done} == {State.LATER}
    assert {one.failures for one in done} == {
        ("out/part: cannot be written: No space left on device",)
    }
    done = list(run_fleet(configuration, tasks, tmp_path / "out", Here()))
    assert {one.state for one in done} == {State.FITTED}


def test_the_wish_to_stop_leaves_the_rest_for_the_next_run(three, tmp_path):
    configuration = load_configuration(None)
    tasks = planned(configuration, [str(three)], tmp_path / "out")
    done: list = []
    fleet = run_fleet(
        configuration, tasks, tmp_path / "out", Here(), cancelled=lambda: len(done) == 1
    )
    for one in fleet:
        done.append(one)  # noqa: PERF402 - it is looked at meanwhile
    assert len(done) == len(parts_in(tmp_path / "out")) == 1


def test_a_model_with_other_columns_has_parts_too(three, tmp_path, here):
    out = tmp_path / "out"
    assert run(three, "--out", out, "--collect", "--model", "bilinear") == 0
    found = table_of(out)
    assert len(found) == 6
    assert found["error"].isna().all()
    assert found["c_r"].dtype == float


def test_labels_of_several_adjusters_have_a_column_each(tmp_path, texts, here):
    folder = tmp_path / "logs" / "D1"
    folder.mkdir(parents=True)
    head, rows = texts["setting_10.csv"]
    (folder / "a.csv").write_text(head.replace("# setting: 10", "# setting: R12 C8") + rows)
    config = tmp_path / "two.toml"
    both = 'rebound = "from open"\ncompression = "from open"\n'
    config.write_text(f"[adjusters]\n{both}")
    out = tmp_path / "out"
    options = ("--config", config, "--model", "bilinear", "--collect")
    assert run(tmp_path / "logs", "--out", out, *options) == 0
    (row,) = table_of(out).to_dict("records")
    assert (row["setting"], row["rebound"], row["compression"]) == ("R12 C8", "12", "8")


def test_a_log_that_cannot_be_read_has_the_setting_that_is_told_from_outside(tmp_path, texts, here):
    logs, out = tmp_path / "logs", tmp_path / "out"
    put(logs / "D1", texts)
    (logs / "D1" / "clicks_7.csv").write_text("")
    (logs / "D1" / "bad.csv").write_text("")
    run(logs, "--out", out, "--collect")
    table = table_of(out)
    bad = dict(table[table["error"].notna()][["log", "setting"]].fillna("").to_numpy())
    assert bad == {"clicks_7.csv": "7", "bad.csv": ""}
    names = ("setting_01.csv", "setting_10.csv", "clicks_7.csv", "bad.csv")
    rows = "".join(f"{name},{k}\n" for name, k in zip(names, (1, 10, 8, 9), strict=True))
    (logs / "D1" / "tests.csv").write_text("file,setting\n" + rows)
    run(logs, "--out", out, "--collect")
    table = table_of(out)
    bad = dict(table[table["error"].notna()][["log", "setting"]].fillna("").to_numpy())
    assert bad == {"clicks_7.csv": "8", "bad.csv": "9"}


@pytest.mark.skipif(sys.platform != "linux", reason="names that are no Unicode")
def test_a_folder_whose_name_is_no_unicode_is_a_damper_like_the_others(tmp_path, texts, here):
    logs, out = tmp_path / "logs", tmp_path / "out"
    put(logs / os.fsdecode(b"latin\xe4"), texts)
    (logs / os.fsdecode(b"latin\xe4") / os.fsdecode(b"b\xe4d_s3.csv")).write_text("")
    assert run(logs, "--out", out, "--report") == 1
    table = table_of(out)
    assert set(table["serial"]) == {"latin\\xe4"}
    (bad,) = table[table["error"].notna()].to_dict("records")
    assert (bad["log"], bad["setting"]) == ("b\\xe4d_s3.csv", "3")
    assert "latin\\xe4/b\\xe4d_s3.csv: empty file" in bad["error"]
    assert run(logs, "--out", out) == 1


def test_failures_of_an_earlier_run_are_counted_aloud(three, tmp_path, here, capsys):
    (three / "D2" / "setting_05.csv").write_text("")
    run(three, "--out", tmp_path / "out")
    said = capsys.readouterr().err
    assert "D2: D2/setting_05.csv: empty file" in said
    assert str(tmp_path) not in said.replace(f"parts in {tmp_path / 'out'}", "")
    assert run(three, "--out", tmp_path / "out") == 1
    assert "1 failure of an earlier run counts too; the parts hold it" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
class TestNothingIsLostOrDoubled:
    """Found in review: each lost a result, doubled one, or gave a log to another damper."""

    def test_two_batches_with_the_same_table_of_tests(self, tmp_path, texts):
        logs, out = tmp_path / "logs", tmp_path / "out"
        for day, name in (("monday", "setting_01.csv"), ("tuesday", "setting_10.csv")):
            put(logs / day, {"log.csv": (texts[name][0], texts[name][1])})
            (logs / day / "tests.csv").write_text("file,serial\nlog.csv,SN7\n")
            assert run(logs / day, "--out", out) == 0
        assert len(parts_in(out)) == 2

    def test_a_log_whose_owner_changes_has_one_part(self, tmp_path, texts):
        logs, out = tmp_path / "logs", tmp_path / "out"
        put(logs / "box", texts)
        run(logs, "--out", out)
        table = "file,serial\nsetting_01.csv,D007\nsetting_10.csv,D007\n"
        (logs / "box" / "tests.csv").write_text(table)
        run(logs, "--out", out, "--collect")
        assert set(table_of(out)["serial"]) == {"D007"}

    def test_tables_of_two_folders_speak_for_their_own_logs(self, tmp_path, texts):
        logs, out = tmp_path / "logs", tmp_path / "out"
        for day, name, setting in (("mon", "setting_01.csv", 3), ("tue", "setting_10.csv", 4)):
            head, rows = texts[name]
            head = "".join(line for line in head.splitlines(True) if "setting" not in line)
            put(logs / day, {"log.csv": (head, rows)})
            (logs / day / "tests.csv").write_text(f"file,serial,setting\nlog.csv,SN7,{setting}\n")
        assert run(logs, "--out", out, "--collect") == 0
        assert table_of(out)["setting"].tolist() == ["3", "4"]

    def test_trouble_of_the_machine_is_tried_again(self, three, tmp_path, monkeypatch):
        def short(*_arguments):
            raise MemoryError

        configuration = load_configuration(None)
        tasks = planned(configuration, [str(three)], tmp_path / "out")
        monkeypatch.setattr("damperfit.fleets.run._results", short)
        done = list(run_fleet(configuration, tasks, tmp_path / "out", Here()))
        assert {one.state for one in done} == {State.LATER}
        assert parts_in(tmp_path / "out") == []

    def test_a_damaged_part_does_not_hide_what_was_done(self, three, tmp_path, capsys):
        out = tmp_path / "out"
        run(three, "--out", out)
        part = parts_in(out)[0]
        part.write_bytes(part.read_bytes()[:-7])
        (three / "D1" / "setting_01.csv").unlink()
        (three / "D2" / "setting_05.csv").write_text("")
        assert run(three, "--out", out, "--collect") in {1, 2}
        assert "setting_05.csv: empty file" in capsys.readouterr().err
