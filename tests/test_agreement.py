"""One quantity, one number: what each outlet shows of a run agrees to its last printed digit.

The runs are a sine, a stepped record, a log of few samples a cycle, and a rig that gives way by
1 um/N and delays the force by 9 ms. What is stored in Parquet is what all others are held against.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import damperfit
from damperfit.cli.main import main
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.simulation import Motion, simulate

SETTING = 4
# Sample rate, Hz; motions as amplitude, m, frequency, Hz, and cycles; compliance, m/N; lag, s.
CASES = {
    "sine": (500.0, [(0.032, 1.5, 12)], 0.0, 0.0),
    "stepped": (500.0, [(0.02, 0.5, 5), (0.02, 1.5, 8), (0.02, 3.0, 14)], 0.0, 0.0),
    "few_samples": (200.0, [(0.02, 3.15, 25)], 0.0, 0.0),
    "rig": (500.0, [(0.02, 0.8, 6), (0.02, 2.5, 14)], 1e-6, 9e-3),
}


def log(rate: float, motions: list, compliance: float, lag: float) -> str:
    """Return a log of the reference damper on a rig."""
    x, v = [np.zeros(round(0.3 * rate))], [np.zeros(round(0.3 * rate))]
    for amplitude, frequency, cycles in motions:
        angle = 2.0 * np.pi * frequency * np.arange(round(cycles * rate / frequency)) / rate
        x.append(amplitude * np.sin(angle))
        v.append(amplitude * 2.0 * np.pi * frequency * np.cos(angle))
    motion = Motion(1.0 / rate, np.concatenate(x), np.concatenate(v))
    force = simulate(reference_parameters(SETTING), PURDY_DAMPER, motion).force
    noise = np.random.default_rng(7).normal(0.0, 2.0, len(force))
    time = np.arange(len(force)) / rate
    rig = motion.displacement + compliance * force
    measured = np.interp(time - lag, time, force) + noise
    rows = zip(time, 1e3 * rig, measured, strict=True)
    head = f"# setting: {SETTING}\ntime_s,displacement_mm,force_N\n"
    return head + "".join(f"{t:.4f},{s:.5f},{f:.3f}\n" for t, s, f in rows)


@dataclass(frozen=True)
class Outlets:
    """A run, and what is shown of it."""

    folder: Path

    def command(self, *arguments: str) -> str:
        """Return what a command prints."""
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
            assert main(list(arguments)) in {0, 1}, arguments
        return out.getvalue()

    def json(self, *arguments: str) -> dict:
        return json.loads(self.command(*arguments, "--json"))

    @cached_property
    def run(self) -> damperfit.Run:
        return damperfit.load(self.folder / "run")

    def table(self, name: str) -> pd.DataFrame:
        return pd.read_csv(self.folder / "run" / f"{name}.csv")

    @cached_property
    def peak(self) -> pd.Series:
        """The row of the fastest segment's peaks, as stored."""
        rows = pd.read_parquet(self.folder / "run" / "characteristics.parquet")
        peaks = rows[rows["point"] == "peak"]
        return peaks.loc[peaks["speed_rebound_m_per_s"].idxmax()]

    @cached_property
    def compared(self) -> list[dict]:
        document = self.json("compare", *[str(self.folder / "run")] * 2)
        return document["comparisons"][0]["lines"]

    @cached_property
    def inspected(self) -> dict:
        (entry,) = self.json("inspect", str(self.folder / "log.csv"))["logs"]
        return entry

    @cached_property
    def identified(self) -> dict:
        return json.loads((self.folder / "identify.json").read_text())

    @cached_property
    def page(self) -> str:
        self.command("report", str(self.folder / "run"))
        return (self.folder / "run" / "report.html").read_text(encoding="utf-8")

    @cached_property
    def page_text(self) -> str:
        """What people read of the page."""
        return re.sub(r"<script.*?</script>|<[^>]*>", " ", self.page, flags=re.DOTALL)

    @cached_property
    def fleet(self) -> pd.Series:
        out = self.folder / "fleet"
        self.command("fleet", str(self.folder / "log.csv"), "--out", str(out), "--jobs", "1")
        (part,) = out.glob("serial=*/part-*.parquet")
        return pd.read_parquet(part).iloc[0]

    def rows_of_report(self, title: str) -> list[dict[str, str]]:
        """Return the rows of a table of report.md."""
        text = (self.folder / "run" / "report.md").read_text(encoding="utf-8")
        part = text.partition(f"## {title}")[2]
        lines = [line for line in part.partition("\n## ")[0].splitlines() if line[:1] == "|"]
        cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
        return [dict(zip(cells[0], row, strict=True)) for row in cells[2:]]


@pytest.fixture(scope="module", params=CASES)
def shown(request, tmp_path_factory) -> Outlets:
    folder = tmp_path_factory.mktemp(request.param)
    (folder / "log.csv").write_text(log(*CASES[request.param]), encoding="utf-8")
    found = Outlets(folder)
    told = found.command("identify", str(folder / "log.csv"), "--out", str(folder / "run"))
    (folder / "identify.txt").write_text(told, encoding="utf-8")
    return found


def agrees(shown: float | str, stored: float) -> bool:
    """Whether a number that is shown is a stored one, to its last digit."""
    if not isinstance(shown, str):
        return math.isclose(shown, stored, rel_tol=1e-12, abs_tol=0.0)
    mantissa, _, exponent = shown.partition("e")
    last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(shown) - stored) <= 0.5000001 * last


def shows(text: str, stored: float, *, factor: float = 1.0) -> bool:
    """Whether some number of two digits or more in a text is a stored one."""
    numbers = re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text.replace("−", "-"))
    known = [one for one in numbers if len(re.sub(r"\D|e.*", "", one).lstrip("0")) >= 2]
    return any(agrees(one, factor * stored) for one in known)


FIGURES = {
    "energy": ("measured_energy_J", "energy_J", "energy J"),
    "hysteresis_rebound": (
        "measured_hysteresis_rebound_N", "hysteresis_rebound_N", "hysteresis rebound N"
    ),
    "hysteresis_bump": ("measured_hysteresis_bump_N", "hysteresis_bump_N", "hysteresis bump N"),
    "peak_force_rebound": ("measured_rebound_N", "peak_force_rebound_N", "rebound N"),
    "peak_force_bump": ("measured_bump_N", "peak_force_bump_N", "bump N"),
    "peak_speed_rebound": ("speed_rebound_m_per_s", "peak_speed_rebound_m_per_s", "speed m/s"),
    "peak_speed_bump": ("speed_bump_m_per_s", "peak_speed_bump_m_per_s", None),
}  # fmt: skip


@pytest.mark.parametrize("name", FIGURES)
def test_what_is_read_off_a_segment(shown: Outlets, name: str) -> None:
    column, key, heading = FIGURES[name]
    stored = float(shown.peak[column])
    place = int(shown.peak["stretch"]) - 1
    row = shown.table("characteristics").query("point == 'peak'").iloc[place]
    assert agrees(float(row[column]), stored)
    (row,) = (one for one in shown.run.rows("characteristics") if _is_row(one, shown.peak))
    assert row[column] == stored
    (entry,) = shown.run.record["inputs"]
    assert entry["stretches"][place][key] == stored
    assert shown.run.record["stretches"][place][key] == stored
    assert shown.inspected["stretches"][place][key] == stored
    if heading is not None:
        for row in shown.rows_of_report("Segments as measured")[place : place + 1]:
            assert agrees(row[heading], stored)
        # The speed of a single segment stands in the figure alone.
        assert shows(shown.page_text, stored) or name == "peak_speed_rebound"
    if (line := _line(shown, name)) is not None:
        assert agrees(line["first_value"], stored)
        assert agrees(line["second_value"], stored)


def _is_row(row: dict, peak: pd.Series) -> bool:
    return row["point"] == "peak" and row["stretch"] == peak["stretch"]


def _line(shown: Outlets, name: str) -> dict | None:
    return next((line for line in shown.compared if line["name"] == name), None)


def test_the_energy_of_a_cycle_on_the_page(shown: Outlets) -> None:
    pairs = re.findall(r"Energy per cycle: (\S+) J measured, (\S+) J simulated", shown.page)
    rows = [row for row in shown.run.rows("characteristics") if row["point"] == "peak"]
    for measured, simulated in pairs:
        assert any(
            agrees(measured, row["measured_energy_J"])
            and agrees(simulated, row["simulated_energy_J"])
            for row in rows
        )
    assert pairs or len(rows) > 1  # of several segments a table tells


def test_the_energy_is_the_polygon_of_the_loop_with_its_sinc_correction(shown: Outlets) -> None:
    """What no code of the package has a part in, on the signals as they are stored."""
    signals = pd.read_parquet(shown.folder / "run" / "responses.parquet")
    place = int(shown.peak["stretch"]) - 1
    segment = shown.run.record["inputs"][0]["stretches"][place]
    start, stop, rate = (
        segment[key] for key in ("figures_start_s", "figures_stop_s", "frequency_Hz")
    )
    n = round((stop - start) * rate) - 1  # the last sample is one short of the last cycle's end
    time = start + np.arange(n * 1000 + 1) / (1000 * rate)
    x, f = (
        np.interp(time, signals["time_s"], signals[name])
        for name in ("displacement_m", "force_measured_N")
    )
    step = 2.0 * np.pi * rate * float(np.median(np.diff(signals["time_s"])))
    area = float(np.sum(0.5 * (f[1:] + f[:-1]) * np.diff(x))) / n * step / math.sin(step)
    assert shown.peak["measured_energy_J"] == pytest.approx(area, rel=2e-4)


def test_the_mse(shown: Outlets) -> None:
    stored = float(pd.read_parquet(shown.folder / "run" / "parameters.parquet")["mse_percent"][0])
    assert agrees(float(shown.table("parameters")["mse_percent"][0]), stored)
    assert agrees(float(shown.table("mse")["mse_percent"][0]), stored)
    assert shown.run.setting(SETTING).mse_percent == stored
    assert agrees(shown.fleet["mse_percent"], stored)
    assert shows(_row_of_setting((shown.folder / "identify.txt").read_text()), stored)
    assert agrees(shown.rows_of_report("Parameters")[0]["MSE %"], stored)
    assert shows(shown.page_text, stored)
    line = _line(shown, "mse")
    assert line is None or agrees(line["first_value"], stored)
    out = shown.folder / "about"
    shown.command("export", str(shown.folder / "run"), "--to", "csv", "--out", str(out))
    (about,) = [
        line
        for line in (out / "damper_about.txt").read_text().splitlines()
        if "MSE" in line and "fit" in line
    ]
    assert shows(about, stored)


def _row_of_setting(text: str) -> str:
    rows = [line for line in text.splitlines() if line.split()[:1] == [str(SETTING)]]
    return "; ".join(rows)


@pytest.mark.parametrize("name", ["r_m1", "r_m2", "k_e"])
def test_the_parameters(shown: Outlets, name: str) -> None:
    table = pd.read_parquet(shown.folder / "run" / "parameters.parquet")
    stored = float(table[name][0])
    factor = {"r_m1": 1e-3, "r_m2": 1e-6, "k_e": 1e-6}[name]
    heading = {"r_m1": "R_m1 1e3", "r_m2": "R_m2 1e6", "k_e": "K_e MPa"}[name]
    assert agrees(float(shown.table("parameters")[name][0]), stored)
    assert shown.run.setting(SETTING).values[name] == stored
    assert float(shown.run.parameters[name][0]) == stored
    assert agrees(shown.fleet[name], stored)
    line = _line(shown, name)
    assert line is not None
    assert agrees(line["first_value"], stored)
    told = re.sub(r"\([\d.]+\)", "", _row_of_setting((shown.folder / "identify.txt").read_text()))
    assert shows(told, stored, factor=factor)
    cells = shown.rows_of_report("Parameters")[0].items()
    (cell,) = (text for head, text in cells if head.startswith(heading))
    assert shows(cell, stored, factor=factor)
    assert shows(shown.page_text, stored, factor=factor)


def test_the_force_at_the_named_speeds(shown: Outlets) -> None:
    stored = pd.read_parquet(shown.folder / "run" / "adjustment.parquet")
    assert len(stored)
    known = {(row["speed_m_per_s"], row["stroke"]): row["force_N"] for _, row in stored.iterrows()}
    asked = shown.json("settings", str(shown.folder / "run"))["forces"]
    assert {(row["speed_m_per_s"], row["stroke"]) for row in asked} >= set(known)
    for row in asked:
        if (force := known.get((row["speed_m_per_s"], row["stroke"]))) is not None:
            assert row["force_N"] == pytest.approx(force, abs=0.05)
    for (speed, stroke), force in known.items():
        column = f"force_{stroke}_{round(1e3 * speed)}_mm_per_s_N"
        assert shown.fleet[column] == pytest.approx(force, abs=0.05)


def test_compare_reads_the_forces_that_the_tables_hold(shown: Outlets) -> None:
    stored = pd.read_parquet(shown.folder / "run" / "adjustment.parquet")
    known = {
        (row["speed_m_per_s"], row["stroke"]): row
        for _, row in stored.iterrows()
        if row["origin"] == "model"
    }
    lines = [line for line in shown.compared if line["kind"] == "force"]
    model = [line for line in lines if line["told_from"] == "model"]
    assert len(lines) == len(stored)
    for line in model:
        row = known[line["speed_m_per_s"], line["stroke"]]
        assert agrees(line["first_value"], row["force_N"])
    measured = [line for line in shown.compared if line["kind"] == "measured"]
    rows = pd.read_parquet(shown.folder / "run" / "characteristics.parquet")
    rows = rows[(rows["point"] == "speed") & (rows["stretch"] == shown.peak["stretch"])]
    assert len(measured) >= len(rows) > 0
    for line in measured:
        stroke = "rebound" if line["stroke"] == "rebound" else "bump"
        row = rows[rows["speed_rebound_m_per_s"] == line["speed_m_per_s"]].iloc[0]
        assert line["first_value"] == pytest.approx(row[f"measured_{stroke}_N"], rel=1e-5)
