"""Files with one fault each, made from a good log, and what the tool must say of them.

The ids F01, F02, ... are those of the list of faults that users expect to survive; what is not a
file (F01, F02, F36 ...) or is proved beside the code it concerns stands in `test_faults.py`.
"""

import gzip
import io
import pickle
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from scipy.io import savemat

from tests.io.scenarios import parquet_bytes

LIMIT = 4_000_000  # bytes, so that bombs can be small
NAMES = ("time_s", "displacement_mm", "force_N", "temperature_degC")


@dataclass(frozen=True)
class Good:
    """A good log as text and as numbers."""

    rows: tuple[str, ...]

    @property
    def header(self) -> str:
        return ",".join(NAMES)

    def text(self, header: str | None = None, rows: tuple[str, ...] | None = None) -> bytes:
        lines = [self.header if header is None else header, *(self.rows if rows is None else rows)]
        return ("\n".join(lines) + "\n").encode()

    def with_row(self, row: str, at: int = 10) -> bytes:
        """Return the log with another row in line 12."""
        return self.text(rows=(*self.rows[:at], row, *self.rows[at + 1 :]))

    def columns(self) -> np.ndarray:
        return np.array([[float(field) for field in row.split(",")] for row in self.rows]).T

    def table(self) -> pa.Table:
        return pa.table([pa.array(column) for column in self.columns()], names=list(NAMES))


@dataclass(frozen=True)
class Fault:
    """A faulty file."""

    make: Callable[[Good], bytes] | bytes
    says: str
    suffix: str = ".csv"
    is_good: bool = False
    needs: tuple[str, ...] = ()

    def content(self, good: Good) -> bytes:
        return self.make if isinstance(self.make, bytes) else self.make(good)


def _semicolons(good: Good) -> bytes:
    rows = tuple(row.replace(",", ";").replace(".", ",") for row in good.rows)
    return good.text(header=good.header.replace(",", ";"), rows=rows)


def _quoted_commas(good: Good) -> bytes:
    rows = (",".join(f'"{field}"'.replace(".", ",") for field in r.split(",")) for r in good.rows)
    return good.text(rows=tuple(rows))


def _micro(good: Good) -> bytes:
    header = "time (s),displacement (\xb5m),force (N),temperature (\xb0C)"
    time, displacement, force, temperature = good.columns()
    rows = tuple(
        f"{t!r},{1e3 * d!r},{f!r},{c!r}"
        for t, d, f, c in zip(
            time.tolist(), displacement.tolist(), force.tolist(), temperature.tolist(), strict=True
        )
    )
    return good.text(header=header, rows=rows).decode().encode("latin-1")


def _preamble(good: Good) -> bytes:
    lines = ["Rig 7;upper hall", "Operator: A. B.", "", "time,displacement,force,temperature"]
    return ("\n".join([*lines, "s,mm,N,degC", *good.rows]) + "\n").encode()


def _parquet(good: Good, **how: object) -> bytes:
    return parquet_bytes(good.table(), **how)


def _without_checksums(good: Good) -> bytes:
    from pyarrow import parquet

    sink = pa.BufferOutputStream()
    parquet.write_table(good.table(), sink)
    return sink.getvalue().to_pybytes()


def _flipped_parquet(good: Good) -> bytes:
    data = bytearray(_parquet(good, compression="none", use_dictionary=False))
    at = data.index(np.array(good.columns()[2][40]).tobytes())
    data[at + 5] ^= 16  # in a force value: 2 in the exponent would still look like a force
    return bytes(data)


def _parquet_bomb(_: Good) -> bytes:
    zeros = pa.array(np.zeros(LIMIT // 32 + 1))
    return parquet_bytes(pa.table([zeros] * 4, names=list(NAMES)))


def _gzip_bomb(_: Good) -> bytes:
    return gzip.compress(b"0,1,2,3\n" * (LIMIT // 8 + 1))


def _matlab_bomb(_: Good) -> bytes:
    sink = io.BytesIO()
    savemat(sink, {"force": np.zeros((LIMIT // 8 + 1, 1))}, do_compression=True)
    assert len(sink.getvalue()) < LIMIT // 500
    return sink.getvalue()


def _npy(_: Good) -> bytes:
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000,), }"
    body = header.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(body)) + body.encode()


def _npz(_: Good) -> bytes:
    sink = io.BytesIO()
    np.savez(sink, force=np.array([{}], dtype=object))
    return sink.getvalue()


def _tdms(good: Good) -> bytes:
    from nptdms import ChannelObject, TdmsWriter

    sink = io.BytesIO()
    with TdmsWriter(sink) as writer:
        channels = [
            ChannelObject("run", name, column)
            for name, column in zip(NAMES, good.columns(), strict=True)
        ]
        writer.write_segment(channels)
    return sink.getvalue()


def _tdms_cut(good: Good) -> bytes:
    """Temperature comes last: 100 of its values are missing."""
    return _tdms(good)[: -8 * 100]


def _tdms_claim(good: Good) -> bytes:
    data = bytearray(_tdms(good))
    n = struct.pack("<Q", len(good.rows))
    data[data.index(n) : data.index(n) + 8] = struct.pack("<Q", 10**12)
    return bytes(data)


def _tdms_lengths(good: Good) -> bytes:
    from nptdms import ChannelObject, TdmsWriter

    sink = io.BytesIO()
    with TdmsWriter(sink) as writer:
        columns = zip(NAMES, good.columns(), (0, 0, 7, 0), strict=True)
        writer.write_segment(
            [ChannelObject("run", name, column[skip:]) for name, column, skip in columns]
        )
    return sink.getvalue()


def _matlab_73_without_numbers(_: Good) -> bytes:
    import h5py

    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        file["handle"] = np.zeros((1, 6), np.uint32)
        file["handle"].attrs["MATLAB_class"] = np.bytes_("function_handle")
    return sink.getvalue()


def _excel(good: Good) -> bytes:
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(list(NAMES))
    for row in good.rows:
        book.active.append([float(field) for field in row.split(",")])
    book.active["G1"] = "=SUM(B5:B9)"
    sink = io.BytesIO()
    book.save(sink)
    return sink.getvalue()


def _zip(members: dict[str, bytes]) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return sink.getvalue()


def _tar(good: Good) -> bytes:
    import tarfile

    sink = io.BytesIO()
    with tarfile.open(fileobj=sink, mode="w") as archive:
        member = tarfile.TarInfo("../../log.csv")
        member.size = len(good.text())
        archive.addfile(member, io.BytesIO(good.text()))
    return sink.getvalue()


def _metres(good: Good) -> bytes:
    """Values in mm under a header that says metres."""
    return good.text(header=good.header.replace("displacement_mm", "displacement_m"))


def _thousandths(good: Good) -> bytes:
    """Values in m under a header that says mm."""
    rows = []
    for row in good.rows:
        cells = row.split(",")
        rows.append(",".join((cells[0], f"{float(cells[1]) / 1000:.7f}", *cells[2:])))
    return good.text(rows=tuple(rows))


FAULTS: dict[str, Fault] = {
    # Files and text
    "F03 empty": Fault(b"", "empty file (0 bytes)"),
    "F04 header only": Fault(lambda g: g.text(rows=()), "no data rows after the names in line 1"),
    "F05 too many fields": Fault(
        lambda g: g.with_row("0.020,1,2,26,5"), "line 12: found 5 fields, expected 4"
    ),
    "F06 too few fields": Fault(
        lambda g: g.with_row("0.020,1,2"), "line 12: found 3 fields, expected 4"
    ),
    "F07 every row ends in a separator": Fault(
        lambda g: g.text(rows=tuple(row + "," for row in g.rows)),
        "the empty last column was left out",
        is_good=True,
    ),
    "F07 but one row has a value there": Fault(
        lambda g: g.text(rows=(*(f"{row}," for row in g.rows[:-1]), g.rows[-1] + ",7")),
        "found '7' after the last named column",
    ),
    "F08 semicolon and decimal comma": Fault(_semicolons, "decimal mark: comma", is_good=True),
    "F08 decimal commas between commas": Fault(_quoted_commas, "decimal mark: comma", is_good=True),
    "F09 thousands": Fault(lambda g: g.with_row('0.020,1,"1,234",26'), "line 12: force is '1,234'"),
    "F10 text": Fault(lambda g: g.with_row("0.020,OVR,2,26"), "line 12: displacement is 'OVR'"),
    "F10 underscore": Fault(
        lambda g: g.with_row("0.020,1_000,2,26"), "line 12: displacement is '1_000'"
    ),
    "F10 #NV": Fault(lambda g: g.with_row("0.020,1,#NV,26"), "line 12: force is '#NV'"),
    "F11 NUL": Fault(lambda g: g.with_row("0.020,1,\0,26"), "line 12: NUL byte at byte offset "),
    "F12 UTF-8 with a mark": Fault(
        lambda g: b"\xef\xbb\xbf" + g.text(), "setting: from the file name", is_good=True
    ),
    "F12 UTF-16": Fault(
        lambda g: g.text().decode().encode("utf-16"), "encoding: UTF-16-LE", is_good=True
    ),
    "F12 UTF-16 without a mark": Fault(
        lambda g: g.text().decode().encode("utf-16-le"), "looks like UTF-16"
    ),
    "F13 Latin-1": Fault(_micro, "encoding: not UTF-8, read as Latin-1", is_good=True),
    "F14 open quote": Fault(
        lambda g: g.with_row('0.020,"1,2,26'), "line 12: a quote opens and does not close"
    ),
    "F15 cut in mid-number": Fault(
        lambda g: g.text() + b"99.000,1,-12", "no final newline; the last row", is_good=True
    ),
    "F16 preamble and units row": Fault(_preamble, "preamble: 2 lines above", is_good=True),
    "F17 two channels of one name": Fault(
        lambda g: g.text(header="time_s,force_N,force_N,displacement_mm"),
        "columns 2 and 3 are both named 'force_N'",
    ),
    "F18 a channel missing": Fault(
        lambda g: g.text(header=g.header.replace("force_N", "forse_N")),
        "no column for force; there are 'time_s', 'displacement_mm', 'forse_N', "
        "'temperature_degC'. Did you mean 'forse_N'? Name it: rig.columns.force = 'NAME'",
    ),
    "F19 no unit": Fault(
        lambda g: g.text(header=g.header.replace("force_N", "force")), "column 'force' has no unit"
    ),
    "F19 mm called m": Fault(_metres, "displacement swings +-"),
    "F19 m called mm": Fault(_thousandths, "was m read as mm? Declare the unit"),
    "F19 N called kN": Fault(
        lambda g: g.text(header=g.header.replace("force_N", "force_kN")), "was N read as kN?"
    ),
    "F20 line of a million characters": Fault(
        b"1" * 1_000_000 + b"\n", "line 1: longer than 262144 bytes"
    ),
    "F20 row of a million characters": Fault(
        lambda g: g.text() + b"1," * 500_000 + b"\n", "found 500001 fields, expected 4"
    ),
    "F20 100000 columns": Fault(
        b",".join([b"1"] * 100_000) + b"\n", "100000 columns, more than the limit of 2000"
    ),
    "F20 mixed line ends": Fault(
        lambda g: g.text().replace(b"\n", b"\r\n", 40).replace(b"\r\n", b"\n", 7),
        "setting: from the file name",
        is_good=True,
    ),
    # Binary formats and limits
    "F21 Parquet without its tail": Fault(
        lambda g: _parquet(g)[:-200], "truncated Parquet", ".parquet"
    ),
    "F21 half a Parquet": Fault(
        lambda g: _parquet(g)[: len(_parquet(g)) // 2], "truncated Parquet", ".parquet"
    ),
    "F22 a bit flipped in Parquet": Fault(_flipped_parquet, "damaged Parquet", ".parquet"),
    "F22 no checksums in Parquet": Fault(
        _without_checksums, "without page checksums", ".parquet", is_good=True
    ),
    "F23 Parquet bomb": Fault(
        _parquet_bomb, f"more than the limit of {LIMIT} (rig.max_log_bytes)", ".parquet"
    ),
    "F24 gzip bomb": Fault(
        _gzip_bomb, f"more than the limit of {LIMIT} bytes when unpacked", ".csv.gz"
    ),
    "F25 MATLAB bomb": Fault(_matlab_bomb, "more than the limit", ".mat"),
    "F25 NumPy archive": Fault(_npz, "this is a NumPy archive", ".npz"),
    "F26 NumPy array of 745 GiB": Fault(_npy, "this is a NumPy array", ".npy"),
    "F27 pickle": Fault(lambda g: pickle.dumps(g.columns()), "this is a Python pickle", ".pkl"),
    "F28 MATLAB 7.3 with a function handle": Fault(
        _matlab_73_without_numbers, "no channels of numbers", ".mat", needs=("h5py",)
    ),
    "F29 TDMS cut": Fault(_tdms_cut, "'temperature_degC' lost 100 of ", ".tdms", needs=("nptdms",)),
    "F30 TDMS that claims 1e12 values": Fault(
        _tdms_claim, "TDMS file: 74656 bytes of values are declared", ".tdms", needs=("nptdms",)
    ),
    "F32 TDMS channels of different length": Fault(
        _tdms_lengths, "channels of different length: time", ".tdms", needs=("nptdms",)
    ),
    "F33 CSV called Parquet": Fault(
        lambda g: g.text(), "setting: from the file name", ".parquet", is_good=True
    ),
    "F33 Parquet called CSV": Fault(_parquet, "setting: from the file name", is_good=True),
    "F33 web page called CSV": Fault(
        b"<!DOCTYPE html><html><body>404</body></html>", "this is HTML"
    ),
    "F33 noise called TDMS": Fault(
        bytes(range(256)), "is named like TDMS and does not begin like it", ".tdms"
    ),
    "F34 formulas": Fault(
        _excel,
        "1 cells hold formulas; their last saved values are read",
        ".xlsx",
        is_good=True,
        needs=("openpyxl", "python_calamine"),
    ),
    "F34 workbook bomb": Fault(
        lambda _: _zip({"xl/workbook.xml": b"", "xl/worksheets/sheet1.xml": b" " * (LIMIT + 1)}),
        "the workbook claims",
        ".xlsx",
    ),
    "F35 archive with ../": Fault(
        lambda g: _zip({"../../log.csv": g.text()}), "this is a ZIP archive; unpack it", ".zip"
    ),
    "F35 archive of 20000 members": Fault(
        lambda _: _zip({f"xl/workbook{i}": b"" for i in range(20_000)}), "20000 members", ".xlsx"
    ),
    "F35 tar": Fault(_tar, "this is an archive; unpack it", ".tar"),
    "F35 gzip in gzip": Fault(
        lambda g: gzip.compress(gzip.compress(g.text())), "a gzip inside a gzip", ".csv.gz"
    ),
}


def file_name(fault: str) -> str:
    """Return the name of a faulty file: a setting of its own, and no blanks."""
    number = 100 + list(FAULTS).index(fault)
    words = "".join(c if c.isalnum() else "_" for c in fault)
    return f"{words}_setting_{number}{FAULTS[fault].suffix}"
