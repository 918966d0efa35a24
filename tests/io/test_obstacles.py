"""What stands between a log and its channels is told at once, with what the file does have."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log

ROWS = "0.0,1,2\n0.1,2,3\n0.2,3,4\n0.3,4,5\n"


@pytest.fixture
def refusal(tmp_path):
    def read(text: str, options: ReadOptions = ReadOptions()) -> str:
        path = tmp_path / "setting_3.csv"
        path.write_text(text)
        with pytest.raises(LogError) as caught:
            read_log(path, options)
        message = str(caught.value)
        assert message.count("setting_3.csv") == 1
        return message.removeprefix("setting_3.csv")

    return read


def test_unknown_unit_missing_unit_and_missing_column_are_one_message(refusal) -> None:
    # Used to be told one by one over three runs.
    told = refusal(f"Load (kX),Zt,Displacement\n{ROWS}")
    assert told.startswith(": 3 things are wrong: (1) no column for time; there are 'Load (kX)', ")
    assert "(2) column 'Displacement' has no unit" in told
    assert "(3) column 'Load (kX)': no unit of force 'kX'" in told


def test_several_missing_columns_share_one_list(refusal) -> None:
    told = refusal(f"time_s,disp_lacement_mm,forse_N\n{ROWS}".replace("disp_", "dis"))
    assert told == (
        ": no column for displacement and force; there are 'time_s', 'dislacement_mm', 'forse_N'. "
        "Did you mean 'dislacement_mm' for displacement? Did you mean 'forse_N' for force? "
        "Name them: rig.columns.displacement = 'NAME', rig.columns.force = 'NAME'; "
        "without a force nothing can be fitted"
    )


def test_a_wrong_declaration_does_not_hide_the_others(refusal) -> None:
    options = ReadOptions(columns={"force": "Loat"}, units={"displacement": "mm"})
    told = refusal(f"time,displacement,Load\n{ROWS}", options)
    assert "(1) column 'time' has no unit" in told
    assert "(2) no column 'Loat' for force" in told
    assert "Did you mean 'Load'?" in told


def test_values_missing_in_two_channels_are_told_together(refusal) -> None:
    told = refusal("time_s,displacement_mm,force_N\n0.0,1,\n0.1,nan,3\n0.2,3,4\n")
    assert "(1) line 3: displacement is blank, NaN or infinite, in 1 of 3 rows" in told
    assert "(2) line 2: force is blank, NaN or infinite, in 1 of 3 rows" in told


def test_one_obstacle_is_not_counted(refusal) -> None:
    assert "things are wrong" not in refusal(f"time_s,displacement_mm,forse_N\n{ROWS}")


# Names and rows of different widths


def test_four_names_over_two_fields_are_said(refusal) -> None:
    # Used to be "the columns have no names".
    two = "0.1,2\n0.2,3\n0.3,4\n"
    assert refusal(f"Time (s),Force (N),Displacement (mm),Temperature (C)\n{two}") == (
        ": line 1 has 4 names, line 2 has 2 fields: correct the names, or declare the numbers and "
        "units of time, displacement and force in rig.columns and rig.units"
    )


def test_names_with_another_separator_are_said(refusal) -> None:
    told = refusal("Rig 7\nTime (s),Displacement (mm),Force (N)\n" + ROWS.replace(",", "\t"))
    assert told.startswith(
        ": line 2 has 3 names (separator: comma), line 3 has 3 fields (separator: tab): correct "
    )


def test_without_any_names_that_is_said(refusal) -> None:
    assert refusal(ROWS).startswith(": the columns have no names; declare the numbers")


NARROW = "Time (s),Displacement (mm),Force (N)"


@pytest.mark.parametrize("units", ["", "s,mm,N,-\n"])
def test_rows_one_field_short_throughout_are_read(tmp_path, units) -> None:
    # Used to be refused in the first row.
    path = tmp_path / "setting_3.csv"
    names = NARROW.replace(" (s)", "").replace(" (mm)", "").replace(" (N)", "") if units else NARROW
    path.write_text(f"{names},Marker (V)\n{units}{ROWS}")
    found = read_log(path)
    np.testing.assert_array_equal(found.force, [2.0, 3.0, 4.0, 5.0])
    np.testing.assert_array_equal(found.time, [0.0, 0.1, 0.2, 0.3])
    (finding,) = found.findings
    assert finding.name == "short_rows"
    assert finding.severity == "warning"
    assert finding.sentence == (
        "line 1 has 4 names and every row 3 fields: the last, 'Marker (V)', was taken to have no "
        "values"
    )


@pytest.mark.parametrize(
    ("units", "says"), [("s,mm,N", ""), ("s,mm", ", line 2: 2 units for 4 names in line 1")]
)
def test_units_below_short_names_are_as_many_as_either(refusal, tmp_path, units, says) -> None:
    # Two units below four names over three fields: the fuzzer met a ValueError.
    text = f"Time,Displacement,Force,Valve\n{units}\n{ROWS}"
    if says:
        assert refusal(text) == says
        return
    path = tmp_path / "setting_3.csv"
    path.write_text(text)
    np.testing.assert_array_equal(read_log(path).force, [2.0, 3.0, 4.0, 5.0])


def test_short_rows_that_are_cut_at_the_end_are_still_short(tmp_path) -> None:
    path = tmp_path / "setting_3.csv"
    path.write_text(f"{NARROW},Valve\n{ROWS}0.4,5")
    found = read_log(path)
    assert [one.name for one in found.findings] == ["short_rows", "cut_row"]
    assert len(found.time) == 4


def test_rows_that_are_short_only_at_first_are_refused_in_their_line(refusal) -> None:
    told = refusal(f"{NARROW},Valve\n{ROWS}0.4,5,6,1\n0.5,6,7,1\n")
    assert told.startswith(", line 6: found 4 fields, expected 3 fields as in line 2")
    told = refusal(f"{NARROW},Valve\n0,1,2,1\n0.1,2,3,1\n0.2,3,4,1\n{ROWS[:6]}\n")
    assert told.startswith(", line 5: found 3 fields, expected 4 fields as in line 1")
    many = "".join(f"{i / 10},1,2\n" for i in range(60))
    told = refusal(f"{NARROW},Valve\n{many}6.1,5,6,1\n6.2,6,7,1\n")
    assert told.startswith(", line 62: found 4 fields, expected 3 fields as in line 2")


def test_short_rows_whose_last_name_is_needed_are_refused_with_the_reason(refusal) -> None:
    told = refusal(f"Sample,{NARROW}\n{ROWS}")
    assert told.startswith(
        ": no column for force (line 1 has 4 names and every row 3 fields: the last, 'Force (N)', "
        "was taken to have no values); there are 'Sample', "
    )
