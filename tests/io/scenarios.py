"""Small logs with the arrays they must give, one writer for each format, one round trip."""

import gzip
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from damperfit.io import ReadOptions, read_log
from damperfit.recording import Recording

HEADER = "time_s,displacement_mm,force_N,temperature_degC"


@dataclass(frozen=True)
class Scenario:
    """What a log says, in the units it says it: s, mm, N, degC."""

    time: tuple[float, ...] = (0.0, 0.002, 0.004, 0.006, 0.008)
    displacement_mm: tuple[float, ...] = (1.25, -31.5, 0.0, 4.0, 12.125)
    force_n: tuple[float, ...] = (-56.75, 812.5, 0.0, -3.0, 1.5)
    temperature: tuple[float, ...] = (26.0, 26.5, 25.75, 26.0, 26.25)
    setting: int = 10

    def rows(self) -> list[tuple[float, float, float, float]]:
        return list(
            zip(self.time, self.displacement_mm, self.force_n, self.temperature, strict=True)
        )


def text(scenario: Scenario, *, header: str = HEADER, preamble: str = "") -> str:
    lines = [",".join(repr(value) for value in row) for row in scenario.rows()]
    return preamble + "\n".join([header, *lines]) + "\n"


def _plain(scenario: Scenario) -> bytes:
    return text(scenario, preamble=f"# rig log\n# setting: {scenario.setting}\n").encode()


def _crlf_bom(scenario: Scenario) -> bytes:
    return b"\xef\xbb\xbf" + _plain(scenario).replace(b"\n", b"\r\n")


def _utf16(scenario: Scenario) -> bytes:
    return _plain(scenario).decode().encode("utf-16")


def _latin1(scenario: Scenario) -> bytes:
    header = "time (s),displacement (\xb5m),force (N),temperature (\xb0C)"
    rows = [
        f"{t!r},{d * 1000.0!r},{f!r},{temperature!r}" for t, d, f, temperature in scenario.rows()
    ]
    preamble = f"# setting: {scenario.setting}\n"
    return (preamble + "\n".join([header, *rows]) + "\n").encode("latin-1")


def _european(scenario: Scenario) -> bytes:
    """Every field quoted, semicolon, decimal comma, preamble, units row, time last."""
    lines = [
        "Pr\xfcfstand 3;D\xe4mpfer",
        f"Setting: {scenario.setting}",
        '"Axial Force ";"Axial Displacement ";"Temperature ";"Running Time "',
        '"kN";"mm";"\xb0C";"sec"',
    ]
    for t, d, f, temperature in scenario.rows():
        fields = (f / 1000.0, d, temperature, t)
        lines.append(";".join(f'"{value!r}"'.replace(".", ",") for value in fields))
    return ("\r\n".join(lines) + "\r\n").encode("latin-1")


def _blanks(scenario: Scenario) -> bytes:
    header = "  time_ms   displacement_cm  force_kgf temperature_degF"
    lines = [f"# setting: {scenario.setting}", header]
    for t, d, f, temperature in scenario.rows():
        fields = (t * 1000.0, d / 10.0, f / 9.80665, temperature * 1.8 + 32.0)
        lines.append("   ".join(f"{value:+.17e}" for value in fields))
    return ("\n".join(lines) + "\n").encode()


def _shuffled(scenario: Scenario) -> bytes:
    """Another order, extra columns of text and numbers, the setting as a column."""
    lines = ["event,force_N,velocity_m_per_s,setting,displacement_mm,time_s,temperature_degC"]
    for t, d, f, temperature in scenario.rows():
        lines.append(f'"go, now",{f!r},99,{scenario.setting},{d!r},{t!r},{temperature!r}')
    return ("\n".join(lines) + "\n").encode()


def parquet_table(scenario: Scenario) -> pa.Table:
    columns = [pa.array(values, pa.float64()) for values in zip(*scenario.rows(), strict=True)]
    table = pa.table(columns, names=HEADER.split(","))
    return table.replace_schema_metadata({"setting": str(scenario.setting)})


def parquet_bytes(table: pa.Table, **options: object) -> bytes:
    sink = pa.BufferOutputStream()
    parquet.write_table(table, sink, write_page_checksum=True, **options)
    return sink.getvalue().to_pybytes()


def _parquet(scenario: Scenario) -> bytes:
    return parquet_bytes(parquet_table(scenario))


def _gzip(scenario: Scenario) -> bytes:
    return gzip.compress(_european(scenario))


def _mts(scenario: Scenario) -> bytes:
    lines = [
        "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A",
        "",
        "Data Acquisition: Timed\t\tTime:\t1.5\tSec\t3/29/2016 1:54:32 PM",
        f"# setting: {scenario.setting}",
        "Running Time\tAxial Force\tTemperature\tAxial Displacement",
        "Sec\tN\tdegC\tmm",
    ]
    for t, d, f, temperature in scenario.rows():
        lines.append("\t".join(repr(value) for value in (t, f, temperature, d)))
    return ("\r\n".join(lines) + "\r\n").encode()


def _logger(scenario: Scenario) -> bytes:
    """Sample number and 12-hour clock, an event in some rows only."""
    lines = ["Header Size:  3", f"Setting:  {scenario.setting}"]
    lines.append("Sample, Date/Time, force (N), disp (mm), temperature (degC), Events")
    for i, (t, d, f, temperature) in enumerate(scenario.rows()):
        event = ", DAQ Resume" if i == 0 else ""
        clock = f"04/29/2022 12:00:{t:06.3f} PM"
        lines.append(f"{i + 1:10d},   {clock}, {f!r}, {d!r}, {temperature!r}{event}")
    return ("\r\n".join(lines) + "\r\n").encode()


def _parquet_stamps(scenario: Scenario) -> bytes:
    """Time as stamps in whole nanoseconds, under a name that says nothing."""
    table = parquet_table(scenario)
    ticks = [1_700_000_000_123_456_789 + round(1e9 * t) for t in scenario.time]
    stamps = pa.array(ticks, pa.timestamp("ns", tz="UTC"))
    return parquet_bytes(table.set_column(0, "logged at", stamps))


def _json_rows(scenario: Scenario) -> bytes:
    names = HEADER.split(",")
    rows = [dict(zip(names, row, strict=True)) for row in scenario.rows()]
    return json.dumps({"test": {"setting": scenario.setting}, "log": rows}, indent=1).encode()


def _json_lines(scenario: Scenario) -> bytes:
    names = [*HEADER.split(","), "setting"]
    rows = [dict(zip(names, (*row, scenario.setting), strict=True)) for row in scenario.rows()]
    return "".join(json.dumps(row) + "\n" for row in rows).encode()


WRITERS: dict[str, tuple[str, Callable[[Scenario], bytes]]] = {
    "plain": ("log.csv", _plain),
    "crlf and BOM": ("log.csv", _crlf_bom),
    "UTF-16": ("log.txt", _utf16),
    "Latin-1": ("log.csv", _latin1),
    "European export": ("log.csv", _european),
    "blanks": ("log.dat", _blanks),
    "gzip": ("log.csv.gz", _gzip),
    "MTS block": ("specimen.dat", _mts),
    "shuffled": ("log.csv", _shuffled),
    "logger": ("log.txt", _logger),
    "Parquet": ("log.parquet", _parquet),
    "Parquet, time stamps": ("log.parquet", _parquet_stamps),
    "Parquet called CSV": ("log.csv", _parquet),
    "CSV called Parquet": ("log.parquet", _plain),
    "JSON rows": ("log.json", _json_rows),
    "JSON lines": ("log.jsonl", _json_lines),
    "odd suffix": ("log.001", _plain),
}


def check_round_trip(
    folder: Path, file_name: str, data: bytes, scenario: Scenario, options: ReadOptions
) -> Recording:
    """Write, read, compare with what the scenario says in SI."""
    path = folder / file_name
    path.write_bytes(data)
    recording = read_log(path, options)
    expected = {
        "time": np.array(scenario.time),
        "displacement": np.array(scenario.displacement_mm) / 1000.0,
        "force": np.array(scenario.force_n),
        "temperature": np.array(scenario.temperature),
    }
    for channel, values in expected.items():
        found = getattr(recording, channel)
        assert found.dtype == np.float64
        # Two roundings: one where the writer converts, one where the reader does.
        np.testing.assert_allclose(found, values, rtol=1e-14, atol=1e-13, err_msg=channel)
    assert recording.setting == scenario.setting
    return recording
