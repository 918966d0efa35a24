"""A results folder read back for the targets."""

from __future__ import annotations

import hashlib
import json

import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import ConfigurationError
from damperfit.handover import hand_over
from damperfit.tables import make_tables, write_table
from tests.fakes import campaign, fit


def test_damper_values_motion_and_range_come_back(handed, results) -> None:
    assert handed.damper == PURDY_DAMPER
    assert [one.setting.cell for one in handed.settings] == [1, 10, 20]
    assert handed.settings[1].values == reference_parameters(10)
    assert handed.settings[1].mse_percent == 0.0123
    assert (handed.motion.amplitude, handed.motion.frequency) == (0.032, 1.5)
    assert handed.identity["damper"] == "front left"
    table = (results / "parameters.parquet").read_bytes()
    assert handed.digest == hashlib.sha256(table).hexdigest()
    assert handed.remarks == ()


def test_the_tested_range_is_that_of_all_stretches(handed) -> None:
    tested = handed.tested
    assert tested.n_logs == 3
    assert (tested.stroke, tested.speed) == (0.032, 0.30159)
    assert tested.frequencies == (0.5, 1.5)
    assert tested.temperatures == pytest.approx((25.1, 27.0))


def test_a_log_of_another_setting_adds_nothing_to_the_range(folder) -> None:
    record = json.loads((folder / "run.json").read_text())
    fast = {"kind": "steady", "amplitude_m": 0.05, "frequency_Hz": 9.0, "peak_speed_m_per_s": 2.8}
    record["inputs"].append({"log": "x.csv", "setting": 7, "stretches": [fast]})
    (folder / "run.json").write_text(json.dumps(record))
    assert hand_over(folder).tested.speed == 0.30159


def test_a_folder_without_run_json_is_handed_over_with_remarks(folder) -> None:
    (folder / "run.json").unlink()
    handed = hand_over(folder)
    assert len(handed.settings) == 3
    assert handed.tested.speed is None
    assert any("the paper's is assumed" in remark for remark in handed.remarks)
    assert any("nominal one is used" in remark for remark in handed.remarks)


def test_a_value_that_no_log_limits_is_noted(handed, folder) -> None:
    assert handed.notes == ()
    fits = [fit(n, status={"r_m2": "not_identifiable"} if n == 20 else {}) for n in (1, 20)]
    write_table(folder / "parameters.parquet", make_tables(campaign(*fits)).parameters)
    (said,) = hand_over(folder).notes
    assert said == (
        "r_m2 at setting 20: the logs set no upper limit, so the force beyond their speeds may be "
        "far off"
    )


def test_no_folder_is_refused(tmp_path) -> None:
    with pytest.raises(ConfigurationError, match="no such folder"):
        hand_over(tmp_path / "nothing")
