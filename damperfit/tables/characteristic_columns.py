"""The columns of the table "characteristics": name, type, unit, meaning."""

from __future__ import annotations

__all__ = ["CHARACTERISTIC_COLUMNS"]

_INT, _FLOAT, _TEXT = "int64", "double", "string"
CHARACTERISTIC_COLUMNS: tuple[tuple[str, str, str, str], ...] = (
    ("stretch", _INT, "1", "which stretch of the log, counted from 1"),
    ("kind", _TEXT, "", "steady: cycles that repeat; moving: motion that does not"),
    ("start_s", _FLOAT, "s", "time stamp of the first sample of the stretch"),
    ("cycles", _INT, "1", "whole cycles; 0 where nothing repeats"),
    ("frequency_Hz", _FLOAT, "Hz", "cycles per second"),
    ("amplitude_m", _FLOAT, "m", "half the stroke"),
    ("temperature_degC", _FLOAT, "degC", "mean over the log"),
    ("point", _TEXT, "", "peak: the largest forces and speeds (PVP); speed: a named speed"),
    ("speed_rebound_m_per_s", _FLOAT, "m/s", "speed in rebound, mean of the cycles"),
    ("speed_bump_m_per_s", _FLOAT, "m/s", "speed in bump, positive"),
    *(
        column
        for gas, said in (("", ""), ("_without_gas", ", gas force taken off"))
        for column in (
            *(
                (f"{whose}_{stroke}{gas}_N", _FLOAT, "N", f"{whose} force in {stroke}{said}")
                for whose in ("measured", "simulated")
                for stroke in ("rebound", "bump")
            ),
            *(
                (f"{whose}_ratio{gas}", _FLOAT, "1", f"rebound over bump, no signs, {whose}{said}")
                for whose in ("measured", "simulated")
            ),
        )
    ),
    ("mean_gas_force_N", _FLOAT, "N", "gas force from the damper's data, mean of the stretch"),
    *(
        (f"{whose}_energy_J", _FLOAT, "J", f"work in a cycle, {whose}; rows of peaks only")
        for whose in ("measured", "simulated")
    ),
    ("hysteresis_speed_m_per_s", _FLOAT, "m/s", "speed at which the hysteresis is taken"),
    *(
        (f"{whose}_hysteresis_{stroke}_N", _FLOAT, "N", f"opening less closing force, {whose}")
        for whose in ("measured", "simulated")
        for stroke in ("rebound", "bump")
    ),
    ("measured_energy_se_J", _FLOAT, "J", "standard error by the scatter of the cycles"),
    *(
        (f"measured_hysteresis_{stroke}_se_N", _FLOAT, "N", "standard error, likewise; of peaks")
        for stroke in ("rebound", "bump")
    ),
)
