"""The profiles in configs/ read the files of the rigs they are for, rebuilt here in small."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from damperfit.configuration.loading import load_configuration
from damperfit.io import read_logs

CONFIGS = Path(__file__).parents[2] / "configs"
PREAMBLE = (
    "Header Size:  7\r\nVersion:  2\r\nSampling Interval:  0.005\r\nSampling Rate:  200\r\n"
    "Sample Count:  15\r\nDevice Serial Number:  0\r\n"
    "Sample Number, Date/Time, CHANNEL0, CHANNEL1, Events\r\n"
)


def _logger(force_volts: str, displacement_volts: str, *, force_first: bool) -> bytes:
    volts = (force_volts, displacement_volts) if force_first else (displacement_volts, force_volts)
    rows = []
    for i in range(15):
        test, sample = divmod(i, 3)
        event = {0: ", DAQ Resume", 2: ", DAQ Pause"}.get(sample, "")
        rows.append(
            f"{i + 1:10d},   04/29/2022 12:{test:02d}:00.{5 * sample:03d} PM, "
            f"{volts[0]}, {volts[1]}{event}\r\n"
        )
    return (PREAMBLE + "".join(rows)).encode()


@pytest.mark.parametrize(
    ("name", "force_first"), [("ME25mm0x5Hz.txt", True), ("ME5mm3Hz.txt", False)]
)
def test_logger_of_the_mts_machine(tmp_path, name, force_first) -> None:
    path = tmp_path / name
    path.write_bytes(_logger("0.0320", "-2.9931", force_first=force_first))
    parts = read_logs(path, load_configuration(CONFIGS / "mr_damper_mts.toml").reading)
    assert [part.setting for part in parts] == [0, 25, 50, 75, 100]
    for part in parts:
        np.testing.assert_allclose(part.time - part.time[0], [0.0, 0.005, 0.01], atol=1e-12)
        np.testing.assert_allclose(part.force, 0.0320 * 980.665, rtol=1e-14)
        np.testing.assert_allclose(part.displacement, -29.931e-3, rtol=1e-14)


@pytest.mark.parametrize(
    ("name", "setting"),
    [
        ("ensaio1.mat", 0),
        ("ensaio2.mat", 0),
        ("ensaio10.1.mat", 0),
        ("ensaio5.2.mat", 87),
        ("ensaio5.2.2.mat", 87),
        ("ensaio.B.10.mat", 198),
        ("ensaio.A.2.mat", 321),
    ],
)
def test_matlab_files_with_left_over_variables(tmp_path, name, setting) -> None:
    time = np.arange(30)[:, np.newaxis] * 0.01
    variables = {
        "Tout": time,
        "dist": 10.0 * np.sin(time),
        "forc": 100.0 * np.cos(time),
        "x_F": np.hstack([time, time, time]),
        "tout": time,  # differs in case only
        "f": 1.5,  # neither the test's frequency nor its force
        "T": 1.0 / 1.5,
        "tt": np.zeros((1, 7)),
    }
    savemat(tmp_path / name, variables)
    (recording,) = read_logs(
        tmp_path / name, load_configuration(CONFIGS / "mr_damper_table.toml").reading
    )
    assert recording.setting == setting
    np.testing.assert_array_equal(recording.time, time.ravel())
    np.testing.assert_allclose(recording.displacement, 0.01 * np.sin(time.ravel()), rtol=1e-15)
    np.testing.assert_array_equal(recording.force, 100.0 * np.cos(time.ravel()))
