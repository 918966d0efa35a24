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


def owners(folder: Path, configuration=CONFIGURATION) -> dict[str, list[str]]:
    tasks = tasks_by_damper(find_sources([str(folder)]), configuration)
    return {task.owner: [log.name for log in task.logs] for task in tasks}


def test_a_folder_is_a_damper_where_nothing_else_says_whose_its_logs_are(three):
    found = owners(three)
    assert list(found) == ["D1", "D2", "D10"]  # by number, not by letter
    assert found["D2"] == ["D2/setting_01.csv", "D2/setting_10.csv"]


def test_files_that_a_shell_made_of_a_pattern_are_parted_like_their_folder(three):
    files = sorted(map(str, three.glob("*/*.csv")), reverse=True)
    assert tasks_by_damper(find_sources(files), CONFIGURATION) == tasks_by_damper(
        find_sources([str(three)]), CONFIGURATION
    )
    assert tasks_by_damper(
        find_sources([str(three / "*" / "*.csv")]), CONFIGURATION
    ) == tasks_by_damper(find_sources([str(three)]), CONFIGURATION)


def test_the_serial_in_a_log_goes_before_its_folder(tmp_path, texts):
    put(tmp_path / "monday", texts, "SN7")
    put(tmp_path / "tuesday", texts, "SN7")
    assert {owner: len(logs) for owner, logs in owners(tmp_path).items()} == {"SN7": 4}


def test_the_table_of_tests_goes_before_the_log(tmp_path, texts):
    put(tmp_path, texts, "SN7")
    table = "file,serial\nsetting_01.csv,A\nsetting_10.csv,B\n"
    (tmp_path / "tests.csv").write_text(table)
    assert owners(tmp_path) == {"A": ["setting_01.csv"], "B": ["setting_10.csv"]}


def test_a_table_beside_logs_goes_with_them_to_the_worker(tmp_path, texts):
    put(tmp_path, texts)
    (tmp_path / "tests.csv").write_text("file,serial\nsetting_01.csv,A\nsetting_10.csv,A\n")
    (task,) = tasks_by_damper(find_sources([str(tmp_path)]), CONFIGURATION)
    assert [one.name for one in task.tables] == ["tests.csv"]


def test_a_declared_table_of_tests_says_whose_the_logs_are(tmp_path, texts):
    put(tmp_path / "logs", texts)
    table = tmp_path / "mine.csv"
    table.write_text("file,serial\nsetting_01.csv,A\nsetting_10.csv,B\n")
    configuration = replace(CONFIGURATION, test=CONFIGURATION.test.but(table=table))
    assert set(owners(tmp_path / "logs", configuration)) == {"A", "B"}


def test_only_logs_are_taken_from_a_folder_and_none_from_hidden_ones(tmp_path, texts):
    put(tmp_path / "D7", texts)
    put(tmp_path / "D7" / ".old", texts)
    (tmp_path / "D7" / "README.md").write_text("not a log")
    (tmp_path / "D7" / ".setting_11.csv").write_text("hidden")
    assert owners(tmp_path / "D7") == {"D7": ["setting_01.csv", "setting_10.csv"]}


OWN = "setting,r_m1,r_m2\n1,2,3\n"


def test_what_damperfit_wrote_is_no_log_whatever_it_is_called_and_however_it_is_named(
    tmp_path, texts
):
    folder = tmp_path / "D7"
    put(folder, texts)
    (folder / "kept.csv").write_text(OWN)  # no run.json beside it
    for wanted in (folder, folder / "*.csv"):
        names = [one.name for one in find_sources([str(wanted)])]
        assert names == ["setting_01.csv", "setting_10.csv"]
    names = [one.name for one in find_sources(sorted(map(str, folder.glob("*.csv"))))]
    assert names == ["setting_01.csv", "setting_10.csv"]


def test_a_log_called_like_a_result_is_a_log(tmp_path, texts):
    (tmp_path / "run.json").write_text("{}")
    (tmp_path / "mse.csv").write_text("".join(texts["setting_01.csv"]))
    assert "mse.csv" in {one.name for one in find_sources([str(tmp_path)])}


def test_results_alone_are_refused(tmp_path):
    (tmp_path / "kept.csv").write_text(OWN)
    with pytest.raises(ConfigurationError, match="no log there, but results of damperfit"):
        find_sources([str(tmp_path / "kept.csv")])
    with pytest.raises(ConfigurationError, match="no log in it"):
        find_sources([str(tmp_path)])


def test_a_log_named_twice_is_taken_once(three):
    sources = find_sources([str(three), str(three / "D1" / "*.csv")])
    assert len(sources) == 6


def test_every_task_is_of_one_share_whatever_other_tasks_there_are():
    tasks = [DamperTask(f"D{k}", (FleetLog(f"/{k}.csv", f"{k}.csv"),)) for k in range(200)]
    taken = [[k for k in range(1, 8) if Share(k, 7).takes(task)] for task in tasks]
    assert all(len(shares) == 1 for shares in taken)
    assert {k for (k,) in taken} == set(range(1, 8))


@pytest.mark.parametrize("text", ["0/3", "4/3", "3", "a/b", "1/0", "-1/3", "", "1/3", " 3 / 3 "])
def test_a_share_is_one_of_so_many(text):
    if text.strip() in {"1/3", "3 / 3"}:
        assert share_of(text).of == 3
        return
    with pytest.raises(ConfigurationError, match="expected I/N"):
        share_of(text)


def test_where_there_is_no_log_it_is_said(tmp_path):
    with pytest.raises(ConfigurationError, match="no log in it; expected files such as"):
        find_sources([str(tmp_path)])
    (tmp_path / "tests.csv").write_text("file,serial\na.csv,A\n")
    with pytest.raises(ConfigurationError, match="all tables of tests"):
        tasks_by_damper(find_sources([str(tmp_path)]), CONFIGURATION)


class TestKey:
    """What makes a result another one, and what does not."""

    @pytest.fixture
    def logs(self, tmp_path, texts):
        put(tmp_path / "a", texts)
        return sorted((tmp_path / "a").iterdir())

    def key(self, logs, configuration=CONFIGURATION):
        return content_key([(path, hash_of(path)) for path in logs], configuration)

    def test_it_is_the_same_in_another_folder_and_order(self, logs, tmp_path, texts):
        put(tmp_path / "b", texts)
        there = sorted((tmp_path / "b").iterdir(), reverse=True)
        assert self.key(logs) == self.key(there)

    def test_one_byte_of_a_log_changes_it(self, logs):
        before = self.key(logs)
        logs[0].write_bytes(logs[0].read_bytes() + b"\n")
        assert self.key(logs) != before

    def test_a_name_changes_it_as_it_may_say_the_setting(self, logs):
        before = self.key(logs)
        renamed = logs[0].rename(logs[0].with_name("setting_02.csv"))
        assert self.key([renamed, logs[1]]) != before

    def test_which_table_stands_beside_which_log_changes_it(self, tmp_path):
        for name, log, table in (("a", "1", "x"), ("b", "2", "y")):
            (tmp_path / name).mkdir()
            (tmp_path / name / "log.csv").write_text(log)
            (tmp_path / name / "tests.csv").write_text(table)
        files = sorted(tmp_path.rglob("*.csv"))
        before = self.key(files)
        (tmp_path / "a" / "log.csv").write_text("2")
        (tmp_path / "b" / "log.csv").write_text("1")
        assert self.key(files) != before

    @pytest.mark.parametrize(
        "overlay",
        [
            {"damper": {"gas_pressure": "5bara"}},
            {"identification": {"procedure": "plain"}},
            {"rig": {"strict": True}},
            {"output": {"max_mse_percent": 3.0}},
        ],
    )
    def test_what_changes_a_result_changes_it(self, logs, overlay):
        assert self.key(logs) != self.key(logs, load_configuration(None, overlay=overlay))

    def test_the_folder_of_results_does_not(self, logs):
        other = load_configuration(None, overlay={"output": {"folder": "elsewhere"}})
        assert self.key(logs) == self.key(logs, other)

    def test_the_version_does(self, logs, monkeypatch):
        before = self.key(logs)
        monkeypatch.setattr("damperfit.fleets.run.__version__", "99.0")
        assert self.key(logs) != before

    def test_the_table_of_tests_does(self, logs, tmp_path):
        table = tmp_path / "mine.csv"
        table.write_text("file,serial\nsetting_01.csv,A\n")
        configuration = replace(CONFIGURATION, test=CONFIGURATION.test.but(table=table))
        before = self.key(logs, configuration)
        table.write_text("file,serial\nsetting_01.csv,B\n")
        assert self.key(logs, configuration) != before


def test_the_declared_table_speaks_alone(tmp_path, texts):
    put(tmp_path / "logs", texts)
    rows = "setting_01.csv,{0}\nsetting_10.csv,{0}\n"
    (tmp_path / "logs" / "tests.csv").write_text("file,serial\n" + rows.format("BESIDE"))
    table = tmp_path / "given.csv"
    table.write_text("file,serial\n" + rows.format("GIVEN"))
    configuration = replace(CONFIGURATION, test=CONFIGURATION.test.but(table=table))
    assert list(owners(tmp_path / "logs", configuration)) == ["GIVEN"]


def test_folders_of_one_name_below_two_roots_are_two_dampers(tmp_path, texts):
    for root in ("a", "b"):
        put(tmp_path / root / "D1", texts)
    roots = [str(tmp_path / root) for root in ("a", "b")]
    tasks = tasks_by_damper(find_sources(roots), CONFIGURATION)
    assert [task.owner for task in tasks] == ["a/D1", "b/D1"]


def test_places_of_windows_have_folders():
    logs = [
        FleetLog("C:\\runs\\A\\log_1.csv", "A/log_1.csv"),
        FleetLog("C:\\runs\\B\\log_1.csv", "B/log_1.csv"),
    ]
    assert [task.owner for task in tasks_by_damper(logs, CONFIGURATION)] == ["A", "B"]


def test_a_folder_that_cannot_be_read_is_told(tmp_path, texts, monkeypatch):
    put(tmp_path / "logs", texts)

    def closed(top, onerror):
        onerror(PermissionError(13, "Permission denied", str(top)))
        return iter(())

    monkeypatch.setattr("damperfit.fleets.sources.os.walk", closed)
    with pytest.raises(ConfigurationError, match="logs: cannot be read: Permission denied"):
        find_sources([str(tmp_path / "logs")])
