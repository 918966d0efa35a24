"""JSON as a log: the shapes that are read, and a sentence that says JSON for the others."""

import json

import numpy as np
import pytest

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log, read_logs

NAMES = ["time_s", "displacement_mm", "force_N"]
ROWS = [[0.0, 1.0, 2.0], [0.1, 2.0, 3.0], [0.2, 3.0, 4.0]]
COLUMNS = {name: list(values) for name, values in zip(NAMES, zip(*ROWS, strict=True), strict=True)}
DICTS = [dict(zip(NAMES, row, strict=True)) for row in ROWS]
DECLARED = ReadOptions(
    columns={"time": 1, "displacement": 2, "force": 3},
    units={"time": "s", "displacement": "mm", "force": "N"},
)


@pytest.fixture
def put(put):
    def write(content, name: str = "setting_3.json"):
        return put(content if isinstance(content, str | bytes) else json.dumps(content), name)

    return write


def _is_whole(recording) -> bool:
    np.testing.assert_array_equal(recording.time, [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(recording.displacement, [1e-3, 2e-3, 3e-3])
    np.testing.assert_array_equal(recording.force, [2.0, 3.0, 4.0])
    assert "format: JSON" in recording.notes
    return True


SHAPES = {
    "columns": COLUMNS,
    "columns with facts": {"setting": 3, "tags": ["a", "b"], "limits": [1, 2], **COLUMNS},
    "columns below two names, other numbers beside": {"a": {"b": COLUMNS}, "limits": [1.0, 2.0]},
    "columns with units": {
        "time": {"unit": "s", "values": [0, 0.1, 0.2]},
        "displacement": {"unit": "mm", "data": [1, 2, 3]},
        "force": {"units": "kN", "values": [0.002, 0.003, 0.004]},
    },
    "columns in a list": [
        {"name": "time", "unit": "s", "values": [0, 0.1, 0.2]},
        {"name": "displacement", "unit": "mm", "values": [1, 2, 3]},
        {"name": "force", "unit": "N", "values": [2, 3, 4]},
    ],
    "split": {"columns": NAMES, "index": [0, 1, 2], "data": ROWS},
    "rows": DICTS,
    "lists with names": [NAMES, *ROWS],
    "lists with names and units": [
        ["Time", "Displacement", "Force"],
        ["s", "(mm)", "N"],
        *ROWS,
    ],
    "lines of objects": "\n".join(json.dumps(row) for row in DICTS) + "\n\n",
    "UTF-16": json.dumps(COLUMNS).encode("utf-16"),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_columns_and_rows_are_read(put, shape) -> None:
    assert _is_whole(read_log(put(SHAPES[shape])))
    assert _is_whole(read_log(put(SHAPES[shape], "setting_3.txt")))  # whatever its suffix


def test_rows_without_names_need_their_numbers(put) -> None:
    path = put(ROWS)
    with pytest.raises(LogError, match="the columns have no names; declare the numbers"):
        read_log(path)
    assert _is_whole(read_log(path, DECLARED))


def test_facts_beside_the_columns_are_kept(put) -> None:
    found = read_log(
        put({"Setting": 12, "Operator": "A. B.", "ok": True, "log": COLUMNS}, "a.json")
    )
    assert found.setting == 12
    assert found.metadata == {"setting": "12", "operator": "A. B.", "ok": "True"}


def test_tables_under_names_are_tests(put) -> None:
    parts = read_logs(
        put({"run 1": {"setting": 1, **COLUMNS}, "run 2": {"setting": 2, "log": DICTS}})
    )
    assert [part.setting for part in parts] == [1, 2]
    assert all(_is_whole(part) for part in parts)
    assert "part: run 1" in parts[0].notes


def test_stamps_are_a_clock(put) -> None:
    stamps = [f"2026-11-22T10:00:0{i}.5Z" for i in range(3)]
    found = read_log(put({"logged at": stamps, "displacement_mm": [1, 2, 3], "force_N": [2, 3, 4]}))
    np.testing.assert_allclose(found.time, [0.0, 1.0, 2.0])


def test_a_bad_value_is_refused_with_its_row_or_dropped(put) -> None:
    path = put(
        [
            *DICTS,
            {"time_s": 0.3, "displacement_mm": "OVR", "force_N": 1},
            DICTS[2] | {"time_s": 0.4},
        ]
    )
    with pytest.raises(
        LogError, match=r"row 4: displacement is 'OVR', expected a number; .*bad_rows"
    ):
        read_log(path)
    found = read_log(path, ReadOptions(bad_rows="drop"))
    np.testing.assert_array_equal(found.time, [0.0, 0.1, 0.2, 0.4])
    (finding,) = found.findings
    assert finding.code == "rows_dropped"
    assert str(finding).startswith("1 row that cannot be read dropped; setting_3.json, row 4")


REFUSED = {
    "numbers in quotes": (
        {"time_s": ["0.0", "0.1"], "displacement_mm": ["1", "2"], "force_N": ["-3", "4e0"]},
        "the numbers of this JSON are in quotes",
    ),
    "facts alone": ({"setting": 3, "force": "N"}, "this is JSON without columns or rows"),
    "empty object": ("{}", "this is JSON without columns"),
    "one column missing": (
        {name: COLUMNS[name] for name in NAMES[:2]},
        "no column for force (this is JSON); there are 'time_s', 'displacement_mm'",
    ),
    "cut": (json.dumps(COLUMNS, indent=1)[:-20], "this is JSON, damaged in line "),
    "double name": (
        '{"time_s": [1, 2], "force_N": [1, 2], "time_s": [2, 3]}',
        "this is JSON with two values for 'time_s'",
    ),
    "another key": ([*DICTS, {"time_s": 1.0, "force": 2.0}], "row 4: lacks 'displacement_mm'"),
    "a short row": ([*ROWS, [1.0, 2.0]], "row 4: found 2 values, expected 3 as in row 1"),
    "lengths": (COLUMNS | {"force_N": [1.0]}, "columns of different length: 'time_s' 3, "),
    "true": (COLUMNS | {"force_N": [1.0, True, 2.0]}, "row 2: force is 'True', expected a number"),
    "too large": ('{"time_s":[1,2],"displacement_mm":[1,1e999],"force_N":[1,2]}', "infinite"),
    "deep": ("[" * 5000, "this is JSON, nested too deep"),
    "NUL": ('{"time_s":[1,\0 2]}', "NUL byte"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_one_line(put, case) -> None:
    content, says = REFUSED[case]
    with pytest.raises(LogError) as caught:
        read_logs(put(content))
    message = str(caught.value)
    assert message.startswith("setting_3.json")
    assert says in message
    assert message.isprintable()


@pytest.mark.parametrize(("spare", "is_read"), [(0, True), (-1, False)])
def test_memory_is_counted_before_anything_is_kept(put, spare, is_read) -> None:
    path = put(COLUMNS)  # 8 commas, an object and 3 lists
    options = ReadOptions(max_bytes=8 * 32 + 4 * 64 + spare)
    if is_read:
        assert _is_whole(read_log(path, options))
        return
    with pytest.raises(LogError, match=r"the JSON claims 512 bytes, more than the limit of 511"):
        read_log(path, options)
