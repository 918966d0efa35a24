"""Logs to dampers: whose a log is, which share takes it, and what its result depends on."""

from dataclasses import replace
from pathlib import Path

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.fleets.run import (
    DamperTask,
    Share,
    content_key,
    hash_of,
    share_of,
    tasks_by_damper,
)
from damperfit.fleets.sources import FleetLog, find_sources
from tests.fleet.conftest import put

CONFIGURATION = load_configuration(None)
ROWS = "file,serial\nsetting_01.csv,{}\nsetting_10.csv,{}\n"
OWN = "setting,r_m1,r_m2\n1,2,3\n"  # as damperfit writes it


def with_table(path: Path, one: str, other: str):
    path.write_text(ROWS.format(one, other))
    return replace(CONFIGURATION, test=CONFIGURATION.test.but(table=path))


def owners(*places: Path, configuration=CONFIGURATION) -> dict[str, list[str]]:
    tasks = tasks_by_damper(find_sources([str(one) for one in places]), configuration)
    return {task.owner: [log.name for log in task.logs] for task in tasks}


def test_a_folder_is_a_damper_where_nothing_else_says_whose_its_logs_are(three):
    found = owners(three)
    assert list(found) == ["D1", "D2", "D10"]  # by number, not by letter
    assert found["D2"] == ["D2/setting_01.csv", "D2/setting_10.csv"]
    assert owners(three / "*" / "*.csv") == found
    assert owners(*sorted(three.glob("*/*.csv"), reverse=True)) == found  # as a shell gives them
    log = three / "D1" / "setting_01.csv"
    assert owners(log, log, three) == found  # named three times, taken once


def test_who_says_whose_a_log_is(tmp_path, texts):
    """A declared table, a table beside the logs, the log, its folder: the first that says it."""
    for day in ("monday", "tuesday"):
        put(tmp_path / day, texts, "SN7")
    assert {owner: len(logs) for owner, logs in owners(tmp_path).items()} == {"SN7": 4}
    with_table(tmp_path / "monday" / "tests.csv", "A", "B")
    monday = {"A": ["setting_01.csv"], "B": ["setting_10.csv"]}
    assert owners(tmp_path / "monday") == monday
    for task in tasks_by_damper(find_sources([str(tmp_path / "monday")]), CONFIGURATION):
        assert [one.name for one in task.tables] == ["tests.csv"]  # it goes to the worker
    declared = with_table(tmp_path / "mine.csv", "GIVEN", "GIVEN")
    assert list(owners(tmp_path / "monday", configuration=declared)) == ["GIVEN"]


def test_folders_of_one_name_below_two_roots_are_two_dampers(tmp_path, texts):
    for root in ("a", "b"):
        put(tmp_path / root / "D1", texts)
    assert list(owners(tmp_path / "a", tmp_path / "b")) == ["a/D1", "b/D1"]
    windows = [FleetLog(f"C:\\runs\\{k}\\log_1.csv", f"{k}/log_1.csv") for k in "AB"]
    assert [task.owner for task in tasks_by_damper(windows, CONFIGURATION)] == ["A", "B"]


def test_only_logs_are_taken_from_a_folder_whatever_else_is_in_it(tmp_path, texts):
    """Nothing hidden, and nothing that damperfit wrote, whatever it is called."""
    folder = tmp_path / "D7"
    put(folder, texts)
    put(folder / ".old", texts)
    (folder / "README.md").write_text("not a log")
    (folder / ".setting_11.csv").write_text("hidden")
    (folder / "kept.csv").write_text(OWN)  # no run.json beside it
    for wanted in ([folder], [folder / "*.csv"], sorted(folder.glob("[!.]*.csv"))):
        assert owners(*wanted) == {"D7": ["setting_01.csv", "setting_10.csv"]}
    (folder / "run.json").write_text("{}")
    (folder / "mse.csv").write_text("".join(texts["setting_01.csv"]))  # a log called like a result
    assert "mse.csv" in {one.name for one in find_sources([str(folder)])}


def test_where_there_is_no_log_it_is_said(tmp_path, texts, monkeypatch):
    def refused(place: Path, says: str) -> None:
        with pytest.raises(ConfigurationError, match=says):
            tasks_by_damper(find_sources([str(place)]), CONFIGURATION)

    refused(tmp_path, "no log in it; expected files such as")
    (tmp_path / "kept.csv").write_text(OWN)
    refused(tmp_path / "kept.csv", "no log there, but results of damperfit")
    refused(tmp_path, "no log in it")
    (tmp_path / "kept.csv").unlink()
    (tmp_path / "tests.csv").write_text("file,serial\na.csv,A\n")
    refused(tmp_path, "all tables of tests")

    def closed(top, onerror):
        onerror(PermissionError(13, "Permission denied", str(top)))
        return iter(())

    put(tmp_path / "logs", texts)
    monkeypatch.setattr("damperfit.fleets.sources.os.walk", closed)
    refused(tmp_path / "logs", "logs: cannot be read: Permission denied")


def test_every_task_is_of_one_share_whatever_other_tasks_there_are():
    tasks = [DamperTask(f"D{k}", (FleetLog(f"/{k}.csv", f"{k}.csv"),)) for k in range(200)]
    taken = [[k for k in range(1, 8) if Share(k, 7).takes(task)] for task in tasks]
    assert all(len(shares) == 1 for shares in taken)
    assert {k for (k,) in taken} == set(range(1, 8))


@pytest.mark.parametrize("text", ["1/3", "3 / 3", "0/3", "4/3", "1", "a/b", "1/0", "-1/3"])
def test_a_share_is_one_of_so_many(text):
    if text in {"1/3", "3 / 3"}:
        assert share_of(text).of == 3
        return
    with pytest.raises(ConfigurationError, match="expected I/N"):
        share_of(text)


def test_what_makes_a_result_another_one_and_what_does_not(tmp_path, texts, monkeypatch):
    def key(logs, configuration=CONFIGURATION):
        return content_key([(path, hash_of(path)) for path in logs], configuration)

    for name in ("a", "b"):
        put(tmp_path / name, texts)
    logs, there = (sorted((tmp_path / name).iterdir()) for name in ("a", "b"))
    whole = key(logs)
    assert key(there[::-1]) == whole  # another folder and order
    elsewhere = load_configuration(None, overlay={"output": {"folder": "elsewhere"}})
    assert key(logs, elsewhere) == whole
    for overlay in (
        {"damper": {"gas_pressure": "5bara"}},
        {"identification": {"procedure": "plain"}},
        {"rig": {"strict": True}},
        {"output": {"max_mse_percent": 3.0}},
    ):
        assert key(logs, load_configuration(None, overlay=overlay)) != whole, overlay
    told = [key(logs, with_table(tmp_path / "mine.csv", serial, serial)) for serial in "AB"]
    assert len({whole, *told}) == 3
    with monkeypatch.context() as patch:
        patch.setattr("damperfit.fleets.run.__version__", "99.0")
        assert key(logs) != whole
    logs[1].write_bytes(logs[1].read_bytes() + b"\n")
    assert key(logs) != whole
    # A name may say the setting.
    assert key([there[0].rename(there[0].with_name("setting_02.csv")), there[1]]) != whole


def test_which_table_stands_beside_which_log_makes_another_result(tmp_path):
    def key():
        return content_key(
            [(p, hash_of(p)) for p in sorted(tmp_path.rglob("*.csv"))], CONFIGURATION
        )

    found = set()
    for logs in ("12", "21"):
        for name, log in zip("ab", logs, strict=True):
            (tmp_path / name).mkdir(exist_ok=True)
            (tmp_path / name / "log.csv").write_text(log)
            (tmp_path / name / "tests.csv").write_text(name)
        found.add(key())
    assert len(found) == 2
