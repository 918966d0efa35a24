"""The table of stretches that `inspect` shows: a golden row a kind."""

from __future__ import annotations

from typing import Any

from damperfit.report.inspection import stretch_sheet

STEADY: dict[str, Any] = {
    "kind": "steady",
    "start_s": 1.25,
    "cycles": 7,
    "frequency_Hz": 1.5,
    "amplitude_m": 0.032,
    "peak_speed_m_per_s": 0.3016,
    "peak_force_rebound_N": 1556.4,
    "peak_force_bump_N": 1123.2,
    "energy_J": 41.27,
    "noise_N": 3.94,
    "noise_source": "scatter of the cycles",
}
MOVING = STEADY | {
    "kind": "moving",
    "cycles": 0,
    "frequency_Hz": None,
    "peak_force_rebound_N": None,
    "peak_force_bump_N": None,
    "energy_J": None,
    "noise_source": "above the filter",
}


def test_each_column_has_its_unit_and_each_stretch_its_row() -> None:
    logs = [
        {"name": "sine.csv", "stretches": [STEADY]},  # a single steady run needs no second table
        {"name": "steps.csv", "stretches": [STEADY, STEADY | {"start_s": 9.5}]},
        {"name": "road.csv", "stretches": [MOVING]},
    ]
    sheet = stretch_sheet(logs)
    columns = dict(zip(sheet.headings, zip(sheet.units, *sheet.rows, strict=True), strict=True))
    assert columns == {
        "stretches": ("", "steps.csv", "", "road.csv"),
        "from": ("s", "1.250", "9.500", "1.250"),
        "cycles": ("", "7", "7", "moving"),
        "freq.": ("Hz", "1.50", "1.50", "-"),
        "ampl.": ("mm", "32.0", "32.0", "32.0"),
        "speed": ("m/s", "0.302", "0.302", "0.302"),
        "rebound": ("N", "1556", "1556", "-"),
        "bump": ("N", "1123", "1123", "-"),
        "energy": ("J", "41.3", "41.3", "-"),
        "noise": ("N", "3.9", "3.9", "3.9*"),
    }
    assert sheet.notes
