"""What is remarked on when results are read that a run did not write whole."""

from __future__ import annotations

import hashlib

import numpy as np
import pyarrow as pa
import pytest

from damperfit.tables.columns import column_kinds, is_late
from damperfit.tables.reading import _SIGNALS, _split, check_files, read_rows


@pytest.mark.parametrize("n_missing", [0, 1, 6, 7, 9])
def test_columns_that_are_missing_are_named_and_the_rest_counted(tmp_path, n_missing) -> None:
    # Of columns that came later nobody is told that older results lack them.
    names = [name for name in column_kinds("parameters") if not is_late(name)]
    kept = names[: len(names) - n_missing]
    row = ",".join("1" if name == "setting" else "" for name in kept)
    text = f"{','.join(kept)}\n{row}\n"
    (tmp_path / "parameters.csv").write_text(text, encoding="utf-8")
    remarks: list[str] = []
    (found,) = read_rows(tmp_path, "parameters", remarks)
    assert remarks[0] == "parameters.parquet is missing"
    assert found["setting"] == 1
    assert set(found) == set(column_kinds("parameters"))
    missing = names[len(names) - n_missing :]
    more = f" and {n_missing - 6} more" if n_missing > 6 else ""
    told = [f"parameters.csv has no column {', '.join(missing[:6])}{more}"]
    assert remarks[1:] == (told if missing else [])


def test_results_of_before_logs_were_held_out_lack_nothing() -> None:
    """`report` ended with code 1 for them."""
    assert is_late("role")
    assert not is_late("log")


def test_every_file_of_another_run_is_named_and_what_is_no_table_is_passed_over(tmp_path) -> None:
    for name in ("a.parquet", "b.parquet", "c.parquet", "d.txt"):
        (tmp_path / name).write_bytes(name.encode())
    right = hashlib.sha256(b"b.parquet").hexdigest()
    files = {
        "report.md": "0", "d.txt": "0", "../a.parquet": "0", "missing.parquet": "0", "a.parquet": 3,
        "b.parquet": right, "c.parquet": "0",
    }  # fmt: skip
    remarks: list[str] = []
    check_files(tmp_path, {"files": files}, remarks, ("a", "b", "c", "d", "missing"))
    assert [remark.partition(" ")[0] for remark in remarks] == ["a.parquet", "c.parquet"]
    assert remarks[1].endswith(" is not the file that the run wrote (see run.json)")


def test_loops_that_stand_in_one_group_come_apart_by_log_and_by_setting() -> None:
    """Of several rows each and of one; one name at two settings is two logs."""
    logs = ["a", "a", "a", "b", "b", "b", "c"]
    settings = [1, 1, 1, 1, 2, 2, 2]
    rows = {name: np.arange(7.0) + 10.0 * k for k, name in enumerate(_SIGNALS)}
    found = list(_split(pa.table({"log": logs, "setting": settings, **rows})))
    assert [(one.setting, one.log) for one in found] == [(1, "a"), (1, "b"), (2, "b"), (2, "c")]
    assert [one.time.tolist() for one in found] == [[0.0, 1.0, 2.0], [3.0], [4.0, 5.0], [6.0]]
    assert [one.pressures.shape for one in found] == [(3, 3), (3, 1), (3, 2), (3, 1)]
    assert [one.force[0] for one in found] == [40.0, 43.0, 44.0, 46.0]
    assert list(_split(pa.table({"log": logs[:0], "setting": settings[:0]}))) == []
