"""Parts: whole or not at all, one of each test, and one table of them."""

import json
import os
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

from damperfit import __version__
from damperfit.errors import ConfigurationError, OutputError
from damperfit.fleets import sources as unchanged
from damperfit.fleets.parts import (
    collect,
    forget_earlier,
    part_path,
    parts_in,
    read_facts_of,
    tidy,
    write_part,
)
from damperfit.fleets.sources import FleetLog, KnownObject
from damperfit.store import file_set


def facts(*hashes: str, places: tuple[str, ...] = ()) -> dict:
    return {"logs": list(hashes), "places": list(places)}


def rows(*values: float) -> pa.Table:
    return pa.table({"setting": [str(k) for k in range(len(values))], "r_m1": list(values)})


@pytest.mark.parametrize("owner", ["D3", "SN 12/34", "..", "ÄÖ%", "a=b", ""])
def test_any_name_of_a_damper_comes_back_from_its_folder(tmp_path, owner):
    write_part(part_path(tmp_path, owner, "k"), rows(1.0), facts("a"))
    assert collect(tmp_path)["serial"].to_pylist() == [owner]
    (part,) = parts_in(tmp_path)
    assert part.parent.parent == tmp_path


@pytest.mark.parametrize("owners", [("SN 1/2", "D2"), ("007", "12")])
def test_other_tools_read_the_folders_as_one_table_with_serials_as_text(tmp_path, owners):
    for owner, value in zip(owners, (1.0, 2.0), strict=True):
        write_part(part_path(tmp_path, owner, "k"), rows(value), facts(owner))
    collect(tmp_path)  # its table is none of the parts
    readers = (
        pd.read_parquet,
        lambda path: ds.dataset(path, format="parquet").to_table().to_pandas(),
    )
    for read in readers:
        table = read(tmp_path)
        assert dict(zip(table["serial"], table["r_m1"], strict=True)) == dict(
            zip(owners, (1.0, 2.0), strict=True)
        )


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


def test_the_part_that_was_right_last_stays(tmp_path):
    first, second = (part_path(tmp_path, "D1", key) for key in ("first", "second"))
    for path in (first, second):
        write_part(path, rows(1.0), facts("x"))
    os.utime(second, (1.0, 1.0))
    forget_earlier(tmp_path)
    assert parts_in(tmp_path) == [first]


@pytest.mark.parametrize("owner", ["D\udcff1", "x" * 500, "ü" * 60])
def test_a_name_that_no_disk_takes_is_shortened_or_spelled(tmp_path, owner):
    write_part(part_path(tmp_path, owner, "k"), rows(1.0), facts("a", places=(f"/{owner}",)))
    (part,) = parts_in(tmp_path)
    assert len(part.parent.name.encode()) < 256
    assert part_path(tmp_path, owner[:-1], "k") != part


def test_what_cannot_be_written_leaves_nothing(tmp_path, monkeypatch):
    def full(*_args, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("damperfit.fleets.parts.os.fsync", full)
    with pytest.raises(OutputError, match="cannot be written: No space left on device"):
        write_part(part_path(tmp_path, "D1", "k"), rows(1.0), facts("a"))
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_damaged_part_is_called_by_name(tmp_path):
    path = part_path(tmp_path, "D1", "k")
    write_part(path, rows(1.0), facts("a"))
    path.write_bytes(path.read_bytes()[:-7])
    with pytest.raises(ConfigurationError, match=r"part-k\.parquet: damaged .* makes it again"):
        collect(tmp_path)
    assert read_facts_of(path) == {}


def test_parts_of_different_columns_make_one_table(tmp_path):
    write_part(part_path(tmp_path, "D1", "k"), rows(1.0), facts("a"))
    other = pa.table({"setting": ["1"], "rebound_bleed": [2e-6]})
    write_part(part_path(tmp_path, "D2", "k"), other, facts("b"))
    table = collect(tmp_path)
    assert table["r_m1"].to_pylist() == [1.0, None]
    assert table["rebound_bleed"].to_pylist() == [None, 2e-6]


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


def test_a_part_carries_its_page_checksums(tmp_path):
    path = part_path(tmp_path, "D1", "k")
    write_part(path, rows(*range(100)), facts("a"))
    data = bytearray(path.read_bytes())
    data[200] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises((OSError, pa.ArrowInvalid)):
        pq.ParquetFile(path, page_checksum_verification=True).read()


# What an earlier run found in an object is trusted where the same version found it.

PLACE = "s3://bucket/runs/a.csv"


def part(folder: Path, version: str, key: str) -> None:
    seen = {PLACE: ["etag", "abc", f"told by {version}"]}
    table = pa.table({"setting": ["1"]})
    write_part(part_path(folder, "D1", key), table, {"version": version, "seen": seen})


@pytest.mark.parametrize("versions", [[], ["0.0.1"], [__version__], [__version__, "0.0.1"]])
def test_only_this_version_is_believed_whose_a_log_is(
    versions: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for key, version in zip("ab", versions, strict=False):
        part(tmp_path, version, key)
    monkeypatch.setattr(unchanged, "_stamp_of", lambda _place: "etag")
    (found,) = unchanged.recognised([FleetLog(PLACE, "a.csv")], tmp_path)
    own = KnownObject("etag", "abc", f"told by {__version__}")
    assert found.seen == (own if __version__ in versions else None)
