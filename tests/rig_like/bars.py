"""What must be reached on dampers like measured ones, by the command line.

    python -m tests.rig_like.bars                # three minutes of the processor
    python -m tests.rig_like.bars --all FOLDER   # also --model auto; logs and results stay there

The laws of the dampers (`dampers.py`) are none of the library's and their integrator is none of the
core's, so what is said of them holds for the whole chain. `valve_bars`, `other_laws`: drawn ones.
"""

import argparse
import csv
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from tests.rig_like.dampers import (
    ADJUSTABLE_TOML,
    RIG_TOML,
    written_adjustable,
    written_second_rig,
)

ADJUSTERS = """[adjusters]
l = ["rebound.bleed", "compression.bleed"]
h = ["rebound.opening", "compression.opening"]
"""
SHARED = f"""[damper.mounting]
lag = "fit"
{ADJUSTERS}"""
UNSEEN = "damper_L14_H2.csv"
NAMED, LEAST = 0.05, 0.2  # m/s and faster; of half the force's range


@dataclass(frozen=True)
class Bar:
    """What must be reached, and what is."""

    what: str
    found: float
    most: float

    @property
    def is_met(self) -> bool:
        """Whether it is."""
        return self.found <= self.most

    @property
    def line(self) -> str:
        """For people."""
        word = "met" if self.is_met else "MISSED"
        return f"{word:6} {self.what}: {self.found:.3g} ({self.most:g})"


def adjusted(toml: str) -> str:
    """Return a configuration with what its two adjusters turn."""
    return f"{toml}\n{ADJUSTERS}"


@dataclass(frozen=True)
class Identified:
    """What became of a run in a folder of logs."""

    rows: list[dict[str, str]]  # of mse.csv, those of whole settings left out
    n_at_bounds: int  # quantities of settings at an edge of their ranges
    worst_force: float  # of all settings, strokes and speeds: off the measured, per cent

    def mse(self, role: str, part: str = "", *, apart: str = "none") -> list[float]:
        """Return the MSE of logs with that role, with `part` in their names and without `apart`."""
        return [
            float(one["mse_percent"])
            for one in self.rows
            if one["role"] == role and part in one["log"] and apart not in one["log"]
        ]


def identified(folder: Path, *options: str) -> Identified:
    """Identify logs in a folder; its `results` are replaced."""
    out = folder / "results"
    command = [sys.executable, "-m", "damperfit", "identify", *options]
    command += ["--out", str(out), "--quiet"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)

    def table(name: str) -> list[dict[str, str]]:
        with (out / name).open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    worst = max(
        (
            100.0 * abs(difference) / max(abs(measured), LEAST * one["half_range"])
            for one in record["speed_forces"]
            for speed, measured, difference in zip(
                one["speeds"], one["measured"], one["difference"], strict=True
            )
            if speed >= NAMED
        ),
        default=0.0,
    )
    statuses = [row[n] for row in table("parameters.csv") for n in row if n.endswith("_status")]
    rows = [row for row in table("mse.csv") if row["log"]]
    return Identified(rows, statuses.count("at_bound"), worst)


def adjustable_bars(folder: Path) -> list[Bar]:
    """One model for all settings of the damper with two adjusters; a setting and a speed unseen."""
    logs = written_adjustable(folder / "adjustable")
    text = ADJUSTABLE_TOML.format(model="through_flow") + SHARED
    (logs / "damper.toml").write_text(text, encoding="utf-8")
    held = ("--hold-out", "*_slow.csv", "--hold-out", UNSEEN)
    run = identified(logs, "*.csv", *held, "--procedure", "joint", "--config", "damper.toml")
    fitted = run.mse("fitted")
    return [
        Bar("one model for all settings, mean MSE, %", sum(fitted) / len(fitted), 0.2),
        Bar("its worst log, %", max(fitted), 0.2),
        Bar("a setting that was not fitted, %", max(run.mse("held_out", UNSEEN)), 0.15),
        Bar("a speed five times slower, worst of two, %", max(run.mse("held_out", "_slow")), 0.5),
        Bar("quantities at a bound", run.n_at_bounds, 0),
    ]


def apart_bars(folder: Path) -> list[Bar]:
    """Each log by itself, the law chosen by evidence."""
    held = ("--hold-out", "*_slow.csv", "--model", "auto", "--config", "damper.toml")
    run = identified(folder / "adjustable", "*.csv", *held)
    return [
        Bar("log by log with --model auto, worst of 12, %", max(run.mse("fitted")), 0.12),
        Bar("quantities at a bound", run.n_at_bounds, 0),
    ]


def second_rig_bars(folder: Path) -> list[Bar]:
    """Thirteen speeds, play, one parameter set."""
    logs = written_second_rig(folder / "second_rig")
    text = RIG_TOML.format(model="twin_tube") + '[damper.mounting]\nplay = "fit"\n'
    (logs / "damper.toml").write_text(text, encoding="utf-8")
    run = identified(logs, "*.csv", "--config", "damper.toml")
    return [
        Bar("second rig, one parameter set for 13 speeds, worst, %", max(run.mse("fitted")), 0.5),
        Bar("quantities at a bound", run.n_at_bounds, 0),
    ]


def drawn_figures(folder: Path, *, logs: str, unseen: str, apart: str) -> dict[str, float]:
    """What a drawn damper reaches: the law chosen for each setting, then one model without one.

    `unseen` is the setting that the one model is not fitted to, `apart` one that no figure counts.
    """
    config = (folder / "damper.toml").read_text(encoding="utf-8")
    (folder / "adjusted.toml").write_text(adjusted(config), encoding="utf-8")
    endings = [one for one in ("_check.csv", "_slow.csv") if list(folder.glob(f"*{one}"))]
    held = [word for one in endings for word in ("--hold-out", f"*{one}")]
    asked = (logs, "--model", "auto", *held, "--config")
    alone = identified(folder, *asked, "damper.toml")
    joint = ("--procedure", "joint", "--hold-out", f"*{unseen}*")
    whole = identified(folder, *asked, "adjusted.toml", *joint)
    fitted = whole.mse("fitted")
    return {
        "log by log, worst, %": max(alone.mse("fitted", apart=apart)),
        **{f"{one}, worst, %": max(alone.mse("held_out", one, apart=apart)) for one in endings},
        **{f"{one} by one model, %": max(whole.mse("held_out", one, apart=unseen), default=0.0)
           for one in endings},
        "force at a speed, of the measured, worst, %": alone.worst_force,
        "force at a speed by one model, %": whole.worst_force,
        "quantities at a bound": alone.n_at_bounds,
        "one model for the settings, mean, %": sum(fitted) / len(fitted),
        "a setting that was not fitted, %": max(whole.mse("held_out", unseen), default=0.0),
    }  # fmt: skip


def shown(bars: Iterable[Bar]) -> bool:
    """Print a line for each bar; return whether one is missed."""
    is_missed = False
    for bar in bars:
        is_missed |= not bar.is_met
        print(f"  {bar.line}", flush=True)
    return is_missed


def main() -> None:
    """Print a line for each bar; ends with 1 where one is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help="the law chosen by evidence too")
    parser.add_argument("folder", nargs="?", type=Path, help="where logs and results stay")
    given = parser.parse_args()
    parts = [adjustable_bars, *([apart_bars] if given.all else []), second_rig_bars]
    with tempfile.TemporaryDirectory() as temporary:
        missed = [shown(part(given.folder or Path(temporary))) for part in parts]
    sys.exit(int(any(missed)))


if __name__ == "__main__":
    main()
