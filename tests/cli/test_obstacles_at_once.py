"""What is wrong with a log and its missing setting are told in one run, not one after the other."""

from __future__ import annotations

import pytest

EITHER = ". Nor does the log say its adjuster setting: give --setting N too"
COLUMNS = "Load (kX),Zt,Displacement\n0.0,1,2\n0.1,2,3\n0.2,1,3\n"
SHORT = "time_s,displacement_mm,force_N\n0.0,1,2\n0.1,2,3\n0.2,1,3\n"


@pytest.mark.parametrize("command", ["inspect", "identify"])
@pytest.mark.parametrize("text", [COLUMNS, SHORT])
def test_a_missing_setting_is_told_beside(run, tmp_path, command, text) -> None:
    # Used to be told in another run, once the columns were put right.
    (tmp_path / "bench.csv").write_text(text)
    told = run(command, "bench.csv")
    assert told.code == 3
    line = told.err.splitlines()[0]
    # A log is inspected without a setting, and then lacks none.
    assert line.endswith(EITHER) is (command == "identify")
    assert ("Nor does" in told.err) is (command == "identify")
    assert ("3 things are wrong" in line) is (text == COLUMNS)
