"""A small reader of each format, as the program at the other end would read it; SI, our signs."""

import csv
import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import scipy.io

Curves = dict[str, tuple[np.ndarray, np.ndarray]]
MILLIMETRES = {"LENGTH": "mm", "ANGLE": "degrees", "FORCE": "newton", "MASS": "kg"}


def _curve(rows, v=1.0, f=1.0) -> tuple[np.ndarray, np.ndarray]:
    table = np.array(rows, dtype=np.float64) * (v, f)
    return table[np.argsort(table[:, 0])].T


def _by_setting(suffix, read):
    def of_files(files) -> Curves:
        pattern = rf"damper_s(.+){re.escape(suffix)}"
        return {re.fullmatch(pattern, name)[1]: read(one) for name, one in files.items()}

    return of_files


def _teimorbit(content: bytes):
    lines = [re.split(r"[$!]", raw)[0].strip() for raw in content.decode("ascii").splitlines()]
    blocks: dict[str, list[str]] = {}
    for line in filter(None, lines):
        if line.startswith("["):
            block = blocks.setdefault(line.strip("[]"), [])
        else:
            block.append(line)
    units = dict(re.match(r"(\w+)\s*=\s*'(\w+)'", one).groups() for one in blocks["UNITS"])
    assert units == MILLIMETRES | {"TIME": "second"}
    assert blocks["MDI_HEADER"][0].split() == ["FILE_TYPE", "=", "'dpr'"]
    assert re.fullmatch(r"\{\s*vel\s+force\s*\}", blocks["CURVE"][0])
    return _curve([row.split() for row in blocks["CURVE"][1:]], 1e-3)


def _xml(content: bytes):
    root = ET.fromstring(content)  # noqa: S314 - our own
    spline = next(one for one in root.iter() if one.get("name") == "spline_data")
    return _curve([row.split() for row in spline.text.strip().splitlines()], 1e-3)


def _infofile(content: bytes):
    first, *lines = content.decode("utf-8").splitlines()
    assert first == "#INFOFILE1.1 (UTF-8) - Do not remove this line!"
    tables: dict[str, list[list[float]]] = {}
    for line in lines:
        if line.startswith("\t"):
            tables[key].append([float(cell) for cell in line.split()])  # noqa: F821 - of a line before
        elif line.endswith(":"):
            key = line[:-1]
            tables[key] = []
        else:
            assert line[:1] == "#" or line.split(" = ")[1] == "1.0"
    push, pull = (np.array(tables[f"SuspF.Damp_{side}"]) for side in ("Push", "Pull"))
    for table in (push, pull):
        assert table[0].tolist() == [0.0, 0.0]
        assert (np.diff(table[:, 0]) > 0.0).all()
        assert (table >= 0.0).all()
    return _curve(np.vstack([-push[:0:-1], pull]))


def _parsfile(content: bytes):
    lines = [one for one in content.decode("ascii").splitlines() if not one.startswith("!")]
    assert (lines[0], lines[-1]) == ("FD_TABLE SPLINE", "ENDTABLE")
    rows = np.array([row.split(", ") for row in lines[1:-1]], dtype=float)
    assert (np.diff(rows[:, 0]) > 0.0).all()
    return _curve(rows, -1e-3, -1.0)  # compression is positive there


def _yaml(content: bytes):
    text = re.sub(r"(?m)^#.*\n", "", content.decode("utf-8"))
    assert text.startswith("tsdas:\n  - name: ")
    body = re.search(r"damping_curve_data: \[\n(.*)\n    \]\n$", text, re.DOTALL)[1]
    return _curve(re.findall(r"\[ (\S+), (\S+) \]", body))


def combi_matrices(content: bytes) -> dict[str, np.ndarray]:
    """Every matrix of a CombiTable text file, read word by word as its C code does."""
    text = content.decode("utf-8")
    assert text[:2] == "#1"
    words = re.sub(r"#[^\n]*|[,()]", " ", text[2:]).split()
    found, k = {}, 0
    while k < len(words):
        kind, name, n, m = words[k], words[k + 1], int(words[k + 2]), int(words[k + 3])
        assert kind == "double"
        found[name] = np.array(words[k + 4 : k + 4 + n * m], dtype=np.float64).reshape(n, m)
        k += 4 + n * m
    return found


def _combitable(files) -> Curves:
    matrices = combi_matrices(files["damper.txt"])
    curves = {
        name.removeprefix("force_s"): _curve(rows)
        for name, rows in matrices.items()
        if name.startswith("force_s")
    }
    if (grid := matrices.get("force")) is not None:
        for column, (v, f) in zip(grid[1:, 1:].T, curves.values(), strict=True):
            assert np.array_equal(v, grid[1:, 0])
            assert np.array_equal(f, column)
        assert (np.diff(grid[0, 1:]) > 0.0).all()
    return curves


def mat_variables(content: bytes) -> dict:
    """Variables of a .mat file of version 5: arrays, a text, the words of a list."""
    assert content[:9] == b"MATLAB 5."
    assert content[124:128] == b"\x00\x01IM"
    found = scipy.io.loadmat(io.BytesIO(content))
    found["about"] = str(found["about"][0])
    found["setting_label"] = [str(one[0]) for one in found["setting_label"][0]]
    return found


def _matlab(files) -> Curves:
    known = mat_variables(files["damper.mat"])
    script = re.sub(r"%[^\n]*", "", files["damper.m"].decode("utf-8"))
    for name, body in re.findall(r"(?m)^(\w+) = \[([^\]]*)\];", script):
        rows = np.array([row.split() for row in body.split(";")], dtype=np.float64)
        assert np.allclose(rows, known[name], rtol=1e-8, equal_nan=True), name
    pairs = zip(known["setting"][0], known["force"].T, strict=True)
    return {f"{setting:02.0f}": (known["velocity"][:, 0], force) for setting, force in pairs}


def _csv(files) -> Curves:
    rows = list(csv.DictReader(io.StringIO(files["damper.csv"].decode())))
    found: dict[str, list] = {}
    for row in rows:
        pair = (row["speed_m_per_s"], row["force_N"])
        found.setdefault(f"{int(row['setting']):02d}", []).append(pair)
    return {slug: _curve(pairs) for slug, pairs in found.items()}


READERS = {
    "adams": _by_setting(".dpr", _teimorbit),
    "adams-xml": _by_setting(".xml", _xml),
    "carmaker": _by_setting(".txt", _infofile),
    "carsim": _by_setting(".par", _parsfile),
    "chrono": _by_setting(".yaml", _yaml),
    "combitable": _combitable,
    "matlab": _matlab,
    "csv": _csv,
}
