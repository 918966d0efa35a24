"""What must be reached on dampers like measured ones, by the command line.

    python -m tests.rig_like.bars                # three minutes of the processor
    python -m tests.rig_like.bars --all FOLDER   # also --model auto; logs and results stay there

The laws of the dampers (`dampers.py`) are none of the library's and their integrator is none of the
core's, so what is said of them holds for the whole chain.
"""

import argparse
import csv
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.rig_like.dampers import (
    ADJUSTABLE_TOML,
    RIG_TOML,
    written_adjustable,
    written_second_rig,
)

__all__ = [
    "Bar", "adjustable_bars", "adjusted", "at_bounds", "identified", "second_rig_bars",
]  # fmt: skip

ADJUSTERS = """[adjusters]
l = ["rebound.bleed", "compression.bleed"]
h = ["rebound.opening", "compression.opening"]
"""
SHARED = f"""[damper.mounting]
lag = "fit"
{ADJUSTERS}"""
UNSEEN = "damper_L14_H2.csv"


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
        return (
            f"{'met' if self.is_met else 'MISSED':6} {self.what}: {self.found:.3g} ({self.most:g})"
        )


def adjusted(toml: str) -> str:
    """Return a configuration with what its two adjusters turn."""
    return f"{toml}\n{ADJUSTERS}"


def identified(folder: Path, *options: str) -> list[dict[str, str]]:
    """Rows of mse.csv of a run, those of whole settings left out."""
    out = folder / "results"
    command = [
        sys.executable,
        "-m",
        "damperfit",
        "identify",
        *options,
        "--out",
        str(out),
        "--quiet",
    ]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    with (out / "mse.csv").open(encoding="utf-8", newline="") as file:
        return [row for row in csv.DictReader(file) if row["log"]]


def at_bounds(folder: Path) -> int:
    """How many quantities of how many settings ended at an edge of their ranges."""
    with (folder / "results" / "parameters.csv").open(encoding="utf-8", newline="") as file:
        return sum(
            value == "at_bound"
            for row in csv.DictReader(file)
            for name, value in row.items()
            if name.endswith("_status")
        )


def adjustable_bars(folder: Path) -> list[Bar]:
    """One model for all settings of the damper with two adjusters; a setting and a speed unseen."""
    logs = written_adjustable(folder / "adjustable")
    text = ADJUSTABLE_TOML.format(model="through_flow") + SHARED
    (logs / "damper.toml").write_text(text, encoding="utf-8")
    held = ("--hold-out", "*_slow.csv", "--hold-out", UNSEEN)
    rows = identified(logs, "*.csv", *held, "--procedure", "joint", "--config", "damper.toml")
    fitted = [float(row["mse_percent"]) for row in rows if row["role"] == "fitted"]
    told = {row["log"]: float(row["mse_percent"]) for row in rows if row["role"] == "held_out"}
    slow = max(mse for name, mse in told.items() if name != UNSEEN)
    return [
        Bar("one model for all settings, mean MSE, %", sum(fitted) / len(fitted), 0.2),
        Bar("its worst log, %", max(fitted), 0.2),
        Bar("a setting that was not fitted, %", told[UNSEEN], 0.15),
        Bar("a speed five times slower, worst of two, %", slow, 0.5),
        Bar("quantities at a bound", at_bounds(logs), 0),
    ]


def apart_bars(folder: Path) -> list[Bar]:
    """Each log by itself, the law chosen by evidence."""
    logs = folder / "adjustable"
    held = ("--hold-out", "*_slow.csv")
    rows = identified(logs, "*.csv", *held, "--model", "auto", "--config", "damper.toml")
    fitted = [float(row["mse_percent"]) for row in rows if row["role"] == "fitted"]
    return [
        Bar("log by log with --model auto, worst of 12, %", max(fitted), 0.12),
        Bar("quantities at a bound", at_bounds(logs), 0),
    ]


def second_rig_bars(folder: Path) -> list[Bar]:
    """Thirteen speeds, play, one parameter set."""
    logs = written_second_rig(folder / "second_rig")
    text = RIG_TOML.format(model="twin_tube") + '[damper.mounting]\nplay = "fit"\n'
    (logs / "damper.toml").write_text(text, encoding="utf-8")
    rows = identified(logs, "*.csv", "--config", "damper.toml")
    worst = max(float(row["mse_percent"]) for row in rows)
    return [
        Bar("second rig, one parameter set for 13 speeds, worst, %", worst, 0.5),
        Bar("quantities at a bound", at_bounds(logs), 0),
    ]


def main() -> None:
    """Print a line for each bar; ends with 1 where one is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help="the law chosen by evidence too")
    parser.add_argument("folder", nargs="?", type=Path, help="where logs and results stay")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        parts = [adjustable_bars, *([apart_bars] if given.all else []), second_rig_bars]
        missed = False
        for part in parts:
            for bar in part(folder):
                missed |= not bar.is_met
                print(bar.line, flush=True)
    sys.exit(int(missed))


if __name__ == "__main__":
    main()
