"""One quantity, one number: what each outlet shows of a run agrees to its last printed digit."""

import base64
import contextlib
import io
import json
import math
import re
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import damperfit
from damperfit.adjustment.force_at import force_at
from damperfit.cli.main import main
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.simulation import Motion, simulate
from tests.fakes import log_text
from tests.fleet.conftest import Here

SETTING = 4
# Sample rate, Hz; motions as amplitude, m, frequency, Hz, and cycles; compliance, m/N; lag, s.
CASES = {
    "sine": (500.0, [(0.032, 1.5, 12)], 0.0, 0.0),
    "stepped": (500.0, [(0.02, 0.5, 5), (0.02, 1.5, 8), (0.02, 3.0, 14)], 0.0, 0.0),
    "few_samples": (200.0, [(0.02, 3.15, 25)], 0.0, 0.0),
    "rig": (500.0, [(0.02, 0.8, 6), (0.02, 2.5, 14)], 1e-6, 9e-3),
}
_CELL = r"<t[hd][^>]*>(.*?)</t[hd]>"
NUMBER = r"[-+−]?\d+(?:\.\d+)?(?:e[+-]?\d+)?"


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
    return log_text(time, rig, measured, f"setting: {SETTING}")


class Outlets:
    """A run, and what is shown of it."""

    def __init__(self, folder: Path, text: str) -> None:
        self.folder, self.log, self.out = folder, str(folder / "log.csv"), str(folder / "run")
        Path(self.log).write_text(text, encoding="utf-8")
        self.terminal = self.command("identify", self.log, "--out", self.out)

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
        return damperfit.load(self.out)

    def stored(self, name: str) -> pd.DataFrame:
        return pd.read_parquet(f"{self.out}/{name}.parquet")

    @cached_property
    def row(self) -> pd.Series:
        return self.stored("parameters").iloc[0]

    @cached_property
    def peaks(self) -> pd.DataFrame:
        """Peaks of the segments, the fastest last."""
        rows = self.stored("characteristics")
        return rows[rows["point"] == "peak"].sort_values("speed_rebound_m_per_s")

    @cached_property
    def forces(self) -> list[dict]:
        return self.stored("adjustment").to_dict("records")

    @cached_property
    def exported(self) -> Path:
        out = self.folder / "exported"
        self.command("export", self.out, "--to", "csv", "--out", str(out))
        return out

    @cached_property
    def compared(self) -> list[dict]:
        return self.json("compare", self.out, self.out)["comparisons"][0]["lines"]

    @cached_property
    def settings(self) -> list[dict]:
        return self.json("settings", self.out)["forces"]

    @cached_property
    def inspected(self) -> dict:
        (entry,) = self.json("inspect", self.log)["logs"]
        return entry

    @cached_property
    def fleet(self) -> pd.Series:
        out = self.folder / "fleet"
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("damperfit.workers.Processes", Here)
            self.command("fleet", self.log, "--out", str(out), "--jobs", "1")
        (part,) = out.glob("serial-*/part-*.parquet")
        return pd.read_parquet(part).iloc[0]

    @cached_property
    def page(self) -> str:
        self.command("report", self.out)
        text = Path(f"{self.out}/report.html").read_text(encoding="utf-8")
        return text[: text.index("<script>", text.index('id="data"'))]  # without plotly.js

    @cached_property
    def markdown(self) -> str:
        return Path(f"{self.out}/report.md").read_text(encoding="utf-8")

    @cached_property
    def plots(self) -> dict[str, list[dict]]:
        """The lines of each figure of the page, numbers in place of their arrays."""
        text = re.search(r'<script[^>]*id="data">(.*?)</script>', self.page, re.DOTALL)[1]
        data = json.loads(text)
        arrays = [np.frombuffer(base64.b64decode(one), "<f4") for one in data["arrays"]]
        named: dict[str, list[dict]] = {}
        for plot in data["plots"]:
            for panel in plot["panels"]:
                for line in panel["lines"]:
                    line |= {key: arrays[line[key]] for key in ("x", "y")}
                    named.setdefault(plot["name"], []).append(line)
        return named

    @cached_property
    def tables(self) -> list[tuple[str, list[str], list[list[str]]]]:
        """Outlet, headings and rows of every table that people read."""
        found = []
        for block in re.split(r"\n\s*\n", self.markdown):
            lines = [line for line in block.splitlines() if line[:1] == "|"]
            cells = [[one.strip() for one in line.strip("|").split("|")] for line in lines]
            if cells:
                found.append(("report.md", cells[0], cells[2:]))
        for table in re.findall(r"<table.*?</table>", self.page, re.DOTALL):
            lines = [re.findall(_CELL, line, re.DOTALL) for line in table.split("<tr")[1:]]
            cells = [[re.sub(r"<[^>]*>", "", one).strip() for one in line] for line in lines]
            headings = [" ".join(few).strip() for few in zip(*cells[:2], strict=False)]
            found.append(("report.html", headings, cells[2:]))
        for name, text in (
            ("terminal", self.terminal),
            ("settings", self.command("settings", self.out)),
        ):
            for block in re.split(r"\n\s*\n", text):
                headings, *lines = block.strip().splitlines()
                interval = rf" ± {NUMBER}| \({NUMBER} to {NUMBER}\)"
                rows = [re.findall(rf"{NUMBER}(?:{interval})?\*?|\S+", line) for line in lines]
                rows = [row for row in rows if row[0] == str(SETTING)]
                found.append((name, headings.split(), rows))
        return found

    def columns(self, word: str) -> list[tuple[str, str, list[str]]]:
        """Outlet, heading and cells of every column whose heading begins so."""
        return [
            (outlet, heading, [row[k] for row in rows])
            for outlet, headings, rows in self.tables
            for k, heading in enumerate(headings)
            if heading.startswith(word) and rows and all(len(row) > k for row in rows)
        ]


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=[pytest.mark.slow] * (name != "rig")) for name in CASES],
)
def shown(request, tmp_path_factory) -> Outlets:
    return Outlets(tmp_path_factory.mktemp(request.param), log(*CASES[request.param]))


def agrees(shown: float | str, stored: float) -> bool:
    """Whether a number that is shown is a stored one, to its last digit."""
    if not isinstance(shown, str):
        return math.isclose(shown, stored, rel_tol=1e-12, abs_tol=0.0)
    mantissa, _, exponent = shown.replace("−", "-").partition("e")
    last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    if "." not in mantissa:  # 930 +- 120 is rounded to tens
        last *= 10.0 ** (len(mantissa) - len(mantissa.rstrip("0")))
    return abs(float(f"{mantissa}e{exponent or 0}") - stored) <= 0.5000001 * last


def holds(cell: str, value: float, low: float = math.nan, high: float = math.nan) -> bool:
    """Whether a cell is a value, and the larger side or both ends of its interval if it has one."""
    first, *ends = re.findall(NUMBER, cell)
    expected = (low, high) if len(ends) > 1 else (max(value - low, high - value),)
    return agrees(first, value) and all(map(agrees, ends, expected))


def plotted(lines: list[dict], label: str) -> np.ndarray:
    """The heights of the line of a figure with that label."""
    (line,) = (line for line in lines if line["label"] == label)
    return line["y"]


def test_the_forces_at_the_named_speeds(shown: Outlets) -> None:
    assert shown.forces
    by_place = {(one["speed_m_per_s"], one["stroke"]): one for one in shown.forces}
    alike = ["force_N", "force_ci_low_N", "force_ci_high_N", "measured_N", "model_N", "origin"]
    for rows in (
        shown.settings,
        pd.read_csv(f"{shown.out}/adjustment.csv").to_dict("records"),
        pd.read_csv(shown.exported / "damper_adjustment.csv").to_dict("records"),
        shown.run.forces.to_dict("records"),
    ):
        assert {(one["speed_m_per_s"], one["stroke"]) for one in rows} == set(by_place)
        for one in rows:
            known = by_place[one["speed_m_per_s"], one["stroke"]]
            for name in alike:
                assert one[name] == known[name] or pd.isna([one[name], known[name]]).all(), name
    rows = shown.stored("characteristics")
    loops = rows[rows["point"] == "speed"]
    for line in (line for line in shown.compared if line["name"] == "measured_force"):
        at = loops[loops["speed_rebound_m_per_s"] == line["speed_m_per_s"]]
        assert line["first_value"] in at[f"measured_{line['stroke']}_N"].tolist()
    compared = [line for line in shown.compared if line["name"] == "force"]
    assert len(compared) == len(by_place)
    for line in compared:
        known = by_place[line["speed_m_per_s"], line["stroke"]]
        column = {"model": "model_N", "measured": "measured_N"}[line["source"]]
        assert {line["first_value"], line["second_value"]} == {known[column]}
    for (speed, stroke), known in by_place.items():
        words = {"rebound": "rebound", "bump": "compression"}[stroke]
        force = known["force_N"]
        assert shown.fleet[f"force_{stroke}_{round(1e3 * speed)}_mm_per_s_N"] == force
        drawn = plotted(shown.plots["named_speeds"], f"{words}, {speed:g} m/s")
        assert drawn == pytest.approx([force], rel=1e-6)
        for line in shown.plots.get("peak_force", ()):  # of one segment there are loops
            if "constant speed" in line["label"] and words in line["label"]:
                place = int(np.argmin(np.abs(np.abs(line["x"]) - speed)))
                assert line["y"][place] == pytest.approx(known["model_N"], rel=1e-6)


def test_tables_of_forces(shown: Outlets) -> None:
    outlets = set()
    for outlet, headings, rows in shown.tables:
        if not re.match("(rebound|compression)( N at)?$", headings[0]) or not rows:
            continue
        stroke = "rebound" if headings[0].startswith("rebound") else "bump"
        known = [one for one in shown.forces if one["stroke"] == stroke]
        for cell, one in zip(rows[-1][1:], known, strict=True):
            limits = one["force_ci_low_N"], one["force_ci_high_N"]
            assert holds(cell, one["force_N"], *limits), (outlet, cell)
        outlets.add((outlet, stroke))
    assert len(outlets) == 8


PARAMETERS = {"r_m1": ("R_m1", 1e-3), "r_m2": ("R_m2", 1e-6), "k_e": ("K_e", 1e-6)}


@pytest.mark.parametrize("name", PARAMETERS)
def test_the_parameters_and_their_intervals(shown: Outlets, name: str) -> None:
    symbol, factor = PARAMETERS[name]
    columns = [name, f"{name}_ci_low", f"{name}_ci_high"]
    value, low, high = shown.row[columns]
    exported = pd.read_csv(shown.exported / "damper_parameters.csv").iloc[0]
    exported.index = [one.partition(" ")[0] for one in exported.index]
    for row in (
        pd.read_csv(f"{shown.out}/parameters.csv").iloc[0],
        exported,
        shown.run.parameters.iloc[0],
        shown.fleet,
    ):
        assert row[columns].tolist() == [value, low, high]
    assert shown.run.setting(SETTING).values[name] == value
    assert shown.run.setting(SETTING).intervals[name] == (low, high)
    (line,) = (line for line in shown.compared if line["name"] == name)
    assert (line["first_value"], line["second_value"]) == (value, value)
    drawn = plotted(shown.plots[f"parameter_{name}"], f"setting {SETTING}")
    assert drawn == pytest.approx([factor * value], rel=1e-6)
    columns = [one for one in shown.columns(symbol) if "margin" not in one[1]]
    cells = {outlet: column[0] for outlet, _, column in columns}
    assert set(cells) == {"report.md", "terminal", "report.html"}
    for outlet, cell in cells.items():
        assert holds(cell, factor * value, factor * low, factor * high), outlet


def test_the_mse(shown: Outlets) -> None:
    value = shown.row["mse_percent"]
    rows = shown.stored("mse")
    whole = rows[(rows["log"].fillna("") == "") & (rows["role"] == "fitted")].iloc[0]
    assert shown.run.setting(SETTING).mse_percent == shown.fleet["mse_percent"] == value
    assert (
        whole["mse_percent"] == pd.read_csv(f"{shown.out}/mse.csv").iloc[0]["mse_percent"] == value
    )
    (line,) = (line for line in shown.compared if line["name"] == "mse")
    assert line["first_value"] == value
    drawn = plotted(shown.plots["mse"], f"MSE, setting {SETTING}")
    assert drawn == pytest.approx([value], rel=1e-6)
    cells = [cell for *_, (cell, *_) in shown.columns("MSE")]
    assert len(cells) >= 5  # by setting three times, by log twice
    for cell in cells:
        assert holds(cell.split()[0], value) or _of_a_segment(cell, shown), cell
    about = (shown.exported / "damper_about.txt").read_text(encoding="utf-8")
    sentences = re.findall(rf"MSE (?:of the fit: |median ){NUMBER} %", about + shown.page)
    assert len(sentences) >= 2
    assert all(agrees(re.search(NUMBER, one)[0], value) for one in sentences)


def _of_a_segment(cell: str, shown: Outlets) -> bool:
    segments = shown.run.record["stretches"]
    held = [one["mse_percent"] for one in shown.run.record["held_out"]]
    return any(agrees(cell, one) for one in [*held, *(one["mse_percent"] for one in segments)])


# Column of characteristics, key of run.json and inspect, headings of report.md and the page.
FIGURES = {
    "energy": ("measured_energy_J", "energy_J", "energy J", "energy measured, J"),
    "hysteresis_rebound": ("measured_hysteresis_rebound_N", "hysteresis_rebound_N",
                           "hyst. rebound N", "hyst. rebound measured, N"),
    "hysteresis_bump": ("measured_hysteresis_bump_N", "hysteresis_bump_N",
                        "hyst. compression N", "hyst. compression measured, N"),
    "peak_force_rebound": ("measured_rebound_N", "peak_force_rebound_N",
                           "rebound N", "rebound measured, N"),
    "peak_force_bump": ("measured_bump_N", "peak_force_bump_N",
                        "compression N", "compression measured, N"),
    "peak_speed_rebound": ("speed_rebound_m_per_s", "peak_speed_rebound_m_per_s",
                           "speed m/s", "speed m/s"),
    "peak_speed_bump": ("speed_bump_m_per_s", "peak_speed_bump_m_per_s", None, None),
}  # fmt: skip


@pytest.mark.parametrize("name", FIGURES)
def test_what_is_read_off_a_segment(shown: Outlets, name: str) -> None:
    column, key, *headings = FIGURES[name]
    known = shown.peaks[column].tolist()
    csv = pd.read_csv(f"{shown.out}/characteristics.csv")
    exported = pd.read_csv(shown.exported / "damper_characteristics.csv")
    for rows in (csv, exported, shown.run.characteristics):
        peaks = rows[rows["point"] == "peak"].sort_values("speed_rebound_m_per_s")
        assert peaks[column].tolist() == known
    (entry,) = shown.run.record["inputs"]
    for document in (entry, shown.run.record, shown.inspected):
        assert [one[key] for one in document["stretches"]] == known
    lines = [line for line in shown.compared if line["name"] == name]
    assert {line["first_value"] for line in lines} <= {known[-1]}
    assert lines or not name.startswith(("energy", "hyst"))
    outlets = set()
    for outlet, names, rows in shown.tables:
        heading = next((one for one in headings if one in names), None)
        if heading and any(one.startswith("energy") for one in names):
            cells = [row[names.index(heading)] for row in rows]
            assert all(map(agrees, cells, known)), (outlet, heading, cells)
            outlets.add(outlet)
    if headings[0] is not None:  # of one segment the page has the loops alone
        assert outlets == {"report.md", "report.html"} if len(known) > 1 else {"report.md"}
    if (stroke := name.removeprefix("peak_force_")) in {"rebound", "bump"}:
        words = {"rebound": "rebound", "bump": "compression"}[stroke]
        if "peak_force" in shown.plots:  # of one segment there are loops
            drawn = plotted(shown.plots["peak_force"], f"setting {SETTING}, measured, {words}")
            assert drawn == pytest.approx(known, rel=1e-6)


def test_the_energy_is_the_polygon_of_the_loop_with_its_sinc_correction(shown: Outlets) -> None:
    """What no code of the package has a part in, on the signals as they are stored."""
    signals = shown.stored("responses")
    place = int(shown.peaks.iloc[-1]["stretch"]) - 1
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
    assert shown.peaks.iloc[-1]["measured_energy_J"] == pytest.approx(area, rel=2e-4)


def test_the_pressures(shown: Outlets) -> None:
    signals = shown.stored("responses")
    names = [f"pressure_{k}_Pa" for k in (1, 2, 3)]
    assert shown.run.traces[names].to_numpy().tolist() == signals[names].to_numpy().tolist()
    lines = [one for name, few in shown.plots.items() if "pressures" in name for one in few]
    assert len(lines) >= 3
    for line in lines:
        stored = signals[f"pressure_{re.search('chamber (.)', line['label'])[1]}_Pa"].to_numpy()
        off = np.abs(1e5 * line["y"][:, None] - stored[None])
        assert float(np.max(np.min(off, axis=1))) <= 1e-6 * float(np.max(stored)) + 1.0
    lowest, chamber = shown.row["lowest_pressure"], shown.row["lowest_pressure_chamber"]
    assert lowest <= float(signals[f"pressure_{chamber}_Pa"].min()) + 100.0
    for _, heading, cells in shown.columns("lowest pressure"):
        assert agrees(cells[0], 1e-5 * lowest), heading


def test_the_exported_table_is_the_damper_at_those_speeds(shown: Outlets) -> None:
    """Without gas force and tare, to the last printed digit."""
    table = pd.read_csv(shown.exported / "damper.csv", dtype=str)
    (setting,) = shown.run.settings
    speeds = table["speed_m_per_s"].astype(float).abs()
    known = force_at(
        [setting],
        shown.run.damper,
        sorted({v for v in speeds if v}),
        measured=shown.run.speed_forces,
    )
    by_place = {(one.speed, one.stroke): one for one in known}
    for _, row in table.iterrows():
        speed = float(row["speed_m_per_s"])
        if not speed:
            continue
        one = by_place[abs(speed), "rebound" if speed > 0.0 else "bump"]
        # The grid's speeds are printed to six digits, as the forces are.
        assert float(row["force_N"]) == pytest.approx(one.damping, rel=5e-5, abs=2e-3)
        half = 0.5 * (float(row["force_ci_high_N"]) - float(row["force_ci_low_N"]))
        assert half == pytest.approx(one.reach, rel=0.02, abs=2e-3)
