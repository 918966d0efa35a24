"""The way a log is written does not change the parameters: N19, N21, N22, N23."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.identification import FitOptions, identify
from damperfit.io import ReadOptions, read_log
from tests.identification.rig import recording

OPTIONS = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})
SI = {"time_s": 1.0, "displacement_m": 1.0, "force_N": 1.0}


@pytest.fixture(scope="module")
def channels() -> dict[str, np.ndarray]:
    log = recording(9, noise=4.0, rate=500.0, duration=6.0)
    return {"time": log.time, "displacement": log.displacement, "force": log.force}


def _columns(channels: dict[str, np.ndarray], names: dict[str, float]) -> dict[str, np.ndarray]:
    return {name: channels[name.split("_")[0]] * factor for name, factor in names.items()}


def _csv(path: Path, columns: dict[str, np.ndarray]) -> Path:
    rows = zip(*columns.values(), strict=True)
    lines = ["# setting: 9", ",".join(columns)]
    lines += [",".join(repr(float(value)) for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _fitted(path: Path, options: ReadOptions | None = None) -> Parameters:
    log = read_log(path, options) if options else read_log(path)
    return identify([condition(log)], PURDY_DAMPER, OPTIONS).fits[0].parameters


@pytest.mark.parametrize(
    "names",
    [
        {"time_ms": 1e3, "displacement_mm": 1e3, "force_kN": 1e-3},
        {"time_s": 1.0, "displacement_cm": 1e2, "force_N": 1.0},
        {"time_s": 1.0, "displacement_in": 1 / 0.0254, "force_lbf": 1 / 4.4482216152605},
    ],
)
def test_units_do_not_matter(tmp_path: Path, channels, names: dict[str, float]) -> None:
    expected = _fitted(_csv(tmp_path / "si.csv", _columns(channels, SI)))
    found = _fitted(_csv(tmp_path / "other.csv", _columns(channels, names)))
    for name in ("r_m1", "r_m2", "k_e"):
        # Rounding in the text's last digit is all that differs.
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-10)


def test_column_order_extra_columns_and_format_give_the_same_bits(tmp_path: Path, channels) -> None:
    columns = _columns(channels, SI)
    expected = _fitted(_csv(tmp_path / "a.csv", columns))
    shuffled = {"note_V": columns["force_N"] * 0.0, **dict(reversed(columns.items()))}
    assert _fitted(_csv(tmp_path / "b.csv", shuffled)) == expected
    table = pa.table({**columns, "setting": np.full(len(columns["time_s"]), 9)})
    pq.write_table(table, tmp_path / "c.parquet")
    assert _fitted(tmp_path / "c.parquet") == expected


@pytest.mark.parametrize("channel", ["force", "displacement"])
def test_a_mirrored_channel_is_the_same_once_declared(
    tmp_path: Path, channels, channel: str
) -> None:
    expected = _fitted(_csv(tmp_path / "a.csv", _columns(channels, SI)))
    mirrored = {**channels, channel: -channels[channel]}
    path = _csv(tmp_path / "b.csv", _columns(mirrored, SI))
    assert _fitted(path, ReadOptions(**{f"reverse_{channel}": True})) == expected


def test_a_setting_is_the_same_alone_and_among_others() -> None:
    logs = [condition(recording(n, noise=4.0, duration=5.0)) for n in (3, 7, 12)]
    together = identify(logs, PURDY_DAMPER, OPTIONS, jobs=2)
    for log, fit in zip(logs, together.fits, strict=True):
        alone = identify([log], PURDY_DAMPER, OPTIONS)
        assert alone.fits[0].parameters == fit.parameters
