"""Logs to dampers and dampers to parts: whose a log is, what is whole, new, or in its place."""

import json
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

from damperfit import __version__
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, OutputError
from damperfit.fleets import sources
from damperfit.fleets.parts import (
    collect,
    forget_earlier,
    part_path,
    parts_in,
    read_facts_of,
    tidy,
    write_part,
)
from damperfit.fleets.run import DamperTask, content_key, hash_of, share_of, tasks_by_damper
from damperfit.fleets.sources import FleetLog, KnownObject, find_sources
from damperfit.store import file_set
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
    for log in tmp_path.glob("*/*.csv"):  # the same logs on two dates are two tests
        log.write_text(f"# date: 2026-01-0{len(log.parent.name)}\n{log.read_text()}")
    tests = tasks_by_damper(find_sources([str(tmp_path)]), CONFIGURATION)
    assert [(task.owner, len(task.logs)) for task in tests] == [("SN7", 2)] * 2
    with_table(tmp_path / "monday" / "tests.csv", "A", "B")
    assert owners(tmp_path / "monday") == {"A": ["setting_01.csv"], "B": ["setting_10.csv"]}
    for task in tasks_by_damper(find_sources([str(tmp_path / "monday")]), CONFIGURATION):
        assert [one.name for one in task.tables] == ["tests.csv"]  # it goes to the worker
    declared = with_table(tmp_path / "mine.csv", "GIVEN", "GIVEN")
    assert list(owners(tmp_path / "monday", configuration=declared)) == ["GIVEN"]
    for root in ("a", "b"):  # folders of one name below two roots are two dampers
        put(tmp_path / root / "D1", texts)
    assert list(owners(tmp_path / "a", tmp_path / "b")) == ["a/D1", "b/D1"]
    windows = [FleetLog(f"C:\\runs\\{k}\\log_1.csv", f"{k}/log_1.csv") for k in "AB"]
    assert [task.owner for task in tasks_by_damper(windows, CONFIGURATION)] == ["A", "B"]


def test_only_logs_are_taken_from_a_folder_whatever_else_is_in_it(tmp_path, texts):
    """Nothing hidden, and nothing that damperfit wrote, whatever it is called."""
    folder = tmp_path / "D7"
    put(folder, texts)
    put(folder / ".old", texts)
    for name, text in {"README.md": "not a log", ".setting_11.csv": "", "kept.csv": OWN}.items():
        (folder / name).write_text(text)
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
    shares = {k: share_of(f" {k} / 7") for k in range(1, 8)}
    taken = [[k for k, takes in shares.items() if takes(task)] for task in tasks]
    assert {len(shares) for shares in taken} == {1}
    assert {k for (k,) in taken} == set(range(1, 8))
    for text in ("0/3", "4/3", "1", "a/b", "1/0", "-1/3"):
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
        *({"damper": {"gas_pressure": "5bara"}}, {"identification": {"procedure": "plain"}}),
        *({"rig": {"strict": True}}, {"output": {"max_mse_percent": 3.0}}),
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
    # Which table stands beside which log makes another result.
    found = set()
    for contents in ("12", "21"):
        for name, log in zip("ab", contents, strict=True):
            put(tmp_path / "both" / name, {"log.csv": (log, ""), "tests.csv": (name, "")})
        found.add(key(sorted((tmp_path / "both").rglob("*.csv"))))
    assert len(found) == 2


# Parts: whole or not at all, one of each test, and one table of them.


def facts(*hashes: str, places: tuple[str, ...] = ()) -> dict:
    return {"logs": list(hashes), "places": list(places)}


def rows(*values: float) -> pa.Table:
    return pa.table({"setting": [str(k) for k in range(len(values))], "r_m1": list(values)})


@pytest.mark.parametrize(
    "owner", ["D3", "SN 12/34", "..", "ÄÖ%", "a=b", "", "D\udcff1", "x" * 500, "ü" * 60]
)
def test_any_name_of_a_damper_has_a_folder_and_comes_back_from_it(tmp_path, owner):
    write_part(part_path(tmp_path, owner, "k"), rows(1.0), facts("a", places=(f"/{owner}",)))
    (part,) = parts_in(tmp_path)
    assert part.parent.parent == tmp_path
    assert len(part.parent.name.encode()) < 256
    assert not owner or part_path(tmp_path, owner[:-1], "k") != part
    is_cut = len(owner) > 90 or "\udcff" in owner
    assert is_cut or collect(tmp_path)["serial"].to_pylist() == [owner]


@pytest.mark.parametrize("owners", [("SN 1/2", "D2"), ("007", "12")])
def test_other_tools_read_the_folders_as_one_table_with_serials_as_text(tmp_path, owners):
    expected = dict(zip(owners, (1.0, 2.0), strict=True))
    for owner, value in expected.items():
        write_part(part_path(tmp_path, owner, "k"), rows(value), facts(owner))
    collect(tmp_path)  # its table is none of the parts
    whole = ds.dataset(tmp_path, format="parquet").to_table().to_pandas()
    for table in (pd.read_parquet(tmp_path), whole):
        assert dict(zip(table["serial"], table["r_m1"], strict=True)) == expected


def test_a_part_of_an_earlier_version_is_read_and_replaced(tmp_path):
    old = tmp_path / "serial=007" / "part-old.parquet"
    old.parent.mkdir()
    told = {b"damperfit": json.dumps(facts("x", places=("/a.csv",)))}
    pq.write_table(rows(1.0).replace_schema_metadata(told), old)
    assert collect(tmp_path)["serial"].to_pylist() == ["007"]
    write_part(part_path(tmp_path, "007", "new"), rows(2.0), facts("x", places=("/a.csv",)))
    assert collect(tmp_path)["r_m1"].to_pylist() == [2.0]
    assert not old.parent.exists()


@pytest.mark.parametrize(
    ("first", "second", "left"),
    [
        (("D1", facts("x", "y")), ("D1", facts("y", "z")), ["new"]),  # a log in common
        (("D1", facts("x", places=("/a",))), ("D2", facts("y", places=("/a",))), ["new"]),
        (("D1", facts("x", places=("/a",))), ("D1", facts("y", places=("/b",))), ["new", "old"]),
        (("D1", facts("x", places=("/a",))), ("D2", facts("x", places=("/b",))), ["old", "new"]),
    ],
)
def test_a_part_of_the_same_log_or_place_replaces_the_earlier_one(tmp_path, first, second, left):
    for (owner, known), key in ((first, "old"), (second, "new")):
        write_part(part_path(tmp_path, owner, key), rows(1.0), known)
    forget_earlier(tmp_path)
    assert [path.stem.removeprefix("part-") for path in parts_in(tmp_path)] == left


def test_what_cannot_be_written_leaves_nothing_and_damage_is_called_by_name(tmp_path, monkeypatch):
    def full(*_args, **_options):
        raise OSError(28, "No space left on device")

    path = part_path(tmp_path, "D1", "k")
    with monkeypatch.context() as patch:
        patch.setattr("damperfit.fleets.parts.os.fsync", full)
        with pytest.raises(OutputError, match="cannot be written: No space left on device"):
            write_part(path, rows(1.0), facts("a"))
    assert [one for one in tmp_path.rglob("*") if one.is_file()] == []
    write_part(path, rows(*range(100)), facts("a"))
    data = bytearray(path.read_bytes())
    data[200] ^= 0xFF  # its pages carry checksums
    path.write_bytes(bytes(data))
    with pytest.raises((OSError, pa.ArrowInvalid)):
        pq.ParquetFile(path, page_checksum_verification=True).read()
    path.write_bytes(path.read_bytes()[:-7])
    with pytest.raises(ConfigurationError, match=r"part-k\.parquet: damaged .* makes it again"):
        collect(tmp_path)
    assert read_facts_of(path) == {}


def test_what_a_killed_worker_left_goes_and_what_a_living_one_writes_stays(tmp_path):
    folder = tmp_path / "serial-D1"
    (folder / ".damperfit-new-killed").mkdir(parents=True)
    (folder / ".damperfit-new-killed" / "part-b.parquet").write_bytes(b"half")
    tidy(tmp_path)
    assert list(folder.iterdir()) == []
    with file_set(folder) as files:
        files.path("part-a.parquet").write_bytes(b"whole")
        tidy(tmp_path)
    assert [path.name for path in folder.iterdir()] == ["part-a.parquet"]


@pytest.mark.parametrize("versions", [[], ["0.0.1"], [__version__], [__version__, "0.0.1"]])
def test_only_this_version_is_believed_whose_a_log_is(versions, tmp_path, monkeypatch) -> None:
    """What an earlier run found in an object is trusted where the same version found it."""
    place = "s3://bucket/runs/a.csv"
    for key, version in zip("ab", versions, strict=False):
        seen = {"version": version, "seen": {place: ["etag", "abc", f"told by {version}"]}}
        write_part(part_path(tmp_path, "D1", key), pa.table({"setting": ["1"]}), seen)
    monkeypatch.setattr(sources, "_stamp_of", lambda _place: "etag")
    (found,) = sources.recognised([FleetLog(place, "a.csv")], tmp_path)
    own = KnownObject("etag", "abc", f"told by {__version__}")
    assert found.earlier == (own if __version__ in versions else None)
