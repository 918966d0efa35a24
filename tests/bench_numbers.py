"""Fit, held-out error, parameter error, coverage, evaluations and CPU time beside frozen figures.

    python -m tests.bench_numbers                    # all cases; ends with 1 where a number moved
    python -m tests.bench_numbers --only valves      # cases whose names begin so
    python -m tests.bench_numbers --freeze           # write bench_numbers.toml
    python -m tests.bench_numbers FOLDER ...         # one's own dampers, as in rig_like.valve_bars

Each case is one `damperfit identify`. MSE in per cent of the variance: mean and worst over fitted
logs, worst over held-out logs. Errors are of the parameters whose truth is known and that are told
(`fitted` or `shared`): the worst in per cent, the worst and the root mean square in standard
errors (half the interval on that side over 1.96), how many lie in their 95 % intervals. A number
has moved where an MSE differs by a factor of more than 1.02, an error by more than 0.1 standard
error, coverage at all, or where another model or other free parameters were chosen. Evaluations
and CPU time are reported, never judged.

Logs are made once on a machine (`bench_logs`).
"""

import argparse
import csv
import json
import math
import os
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from tests.bench_logs import PAPER, Truth, copied, folder_of
from tests.rig_like import other_laws, valve_bars

ROOT = Path(__file__).parents[1]
FROZEN = Path(__file__).with_suffix(".toml")
MSE_RATIO, STANDARD_ERRORS = 1.02, 0.1


@dataclass(frozen=True)
class Case:
    """One damper, or several of one kind, and how they are identified."""

    name: str
    logs: str
    options: tuple[str, ...]


@dataclass(frozen=True)
class Row:
    """What came of a case. MSE and `error` in per cent; NaN where nothing is known."""

    law: str
    fit: float
    fit_worst: float
    held_worst: float
    error: float
    error_se: float
    rms_se: float
    covered: int
    known: int
    evaluations: int
    cpu_s: float
    worst: str = ""


PLAIN = ("--procedure", "plain", "--free", ",".join(PAPER))
DECLARED = ("setting_*.csv", "--config", "damper.toml")
APART_DAMPERS = (*DECLARED, "--procedure", "plain")  # each setting is a damper of its own
AUTO = ("--model", "auto", "--hold-out", "*_slow.csv")
APART = (*AUTO, "--config", "damper.toml")
JOINT = (*AUTO, "--config", "adjusted.toml", "--procedure", "joint")
CHECKED = ("*_steps.csv", "*_check.csv", "*_slow.csv", "--hold-out", "*_check.csv")
CASES = (
    Case("samples", "samples", ("setting_*.csv",)),
    Case("samples joint", "samples", ("setting_*.csv", "--procedure", "joint")),
    Case("samples auto", "samples", ("setting_*.csv", "--model", "auto")),
    *(Case(motion, motion, (*DECLARED, *PLAIN))
      for motion in ("steps", "sweep", "road", "two triangles")),
    Case("rigid oil", "rigid oil", ("setting_*.csv",)),
    *(Case(name, name, APART_DAMPERS)
      for name in ("declared through_flow", "declared twin_tube", "declared monotube")),
    Case("triangles", "triangles", DECLARED),
    *(Case(f"valves {k}", f"valves {k}", (*CHECKED, *APART)) for k in range(3)),
    *(Case(f"valves joint {k}", f"valves {k}", (*CHECKED, *JOINT, "--hold-out", valve_bars.UNSEEN))
      for k in (1, 2)),
    *(Case(f"other laws {k}", f"other laws {k}", ("t*.csv", *APART)) for k in (0, 2, 3)),
    Case("other laws joint 2", "other laws 2",
         ("t*.csv", *JOINT, "--hold-out", other_laws.UNSEEN)),
    Case("rig auto", "adjustable", ("damper_*.csv", *APART)),
    Case("rig joint", "adjustable",
         ("damper_*.csv", "--procedure", "joint", "--config", "damper.toml",
          "--hold-out", "*_slow.csv", "--hold-out", "damper_L14_H2.csv")),
    *(Case(f"campaign {mounting}", f"campaign {mounting}",
           ("t*.csv", "--model", "auto", "--hold-out", "*_unseen.csv", "--config", "damper.toml"))
      for mounting in ("stiff", "rubber")),
    Case("second rig", "second rig", ("rig_*.csv", "--config", "damper.toml")),
    Case("MR paper", "MR", ("mr_*.csv", "--fix", "r_m3=2.597e6")),
    Case("MR auto", "MR", ("mr_*.csv", "--model", "auto")),
)  # fmt: skip


def measured(case: Case, command: Sequence[str] = ("-m", "damperfit")) -> Row:
    """Identify a case with one worker, by a command of Python's."""
    folder = folder_of(case.logs)
    with tempfile.TemporaryDirectory() as temporary:
        out = Path(temporary) / "results"
        arguments = ["identify", *case.options, "--jobs", "1", "--quiet", "--out", str(out)]
        cpu_s = timed([sys.executable, *command, *arguments], folder)
        truth = folder / "truth.json"
        known = json.loads(truth.read_text(encoding="utf-8")) if truth.exists() else {}
        return replace(_row(out, known), cpu_s=round(cpu_s, 2))


def timed(command: list[str], folder: Path) -> float:
    """Run a command in a folder; return its CPU time in s."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True)  # fmt: skip
    assert process.stderr is not None
    with process.stderr as stream:
        said = stream.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in {0, 1}:
        sys.exit(f"{' '.join(command)} in {folder}\n{said}")
    return usage.ru_utime + usage.ru_stime


def _row(out: Path, truth: Truth) -> Row:
    def table(name: str) -> list[dict[str, str]]:
        with (out / name).open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    logs = [row for row in table("mse.csv") if row["log"]]
    fitted = [float(row["mse_percent"]) for row in logs if row["role"] == "fitted"]
    held = [float(row["mse_percent"]) for row in logs if row["role"] == "held_out"]
    settings = table("parameters.csv")
    errors = list(_errors(settings, truth))
    furthest = max(errors, key=lambda one: one[2], default=("", math.nan, math.nan, False))
    squares = [one[2] ** 2 for one in errors]
    run = json.loads((out / "run.json").read_text(encoding="utf-8"))
    return Row(
        law=_law(settings, run["configuration"]["damper"]["model"]),
        fit=float(np.mean(fitted)),
        fit_worst=max(fitted),
        held_worst=max(held, default=math.nan),
        error=max((one[1] for one in errors), default=math.nan),
        error_se=furthest[2],
        rms_se=math.sqrt(sum(squares) / len(squares)) if squares else math.nan,
        covered=sum(one[3] for one in errors),
        known=len(errors),
        evaluations=sum(int(row["evaluations"] or 0) for row in settings),
        cpu_s=0.0,
        worst=furthest[0],
    )


def _errors(
    settings: Iterable[dict[str, str]], truth: Truth
) -> Iterable[tuple[str, float, float, bool]]:
    """Of each number that is known and told: where, per cent, standard errors, whether covered."""
    for row in settings:
        for name, true in truth.get(row["setting"], {}).items():
            if row.get(f"{name}_status") not in {"fitted", "shared"}:
                continue
            value = float(row[name])
            low, high = float(row[f"{name}_ci_low"]), float(row[f"{name}_ci_high"])
            # In the interval's own errors, side by side: noise, repeating misfit and defaults.
            far = 1.96 * (true - value) / (high - value if true > value else value - low)
            place = f"{name} at {row['setting']}"
            # An offset is of either sign: it has no relative error.
            percent = 0.0 if name == "f_0" else 100.0 * abs(value / true - 1.0)
            yield place, percent, abs(far), low <= true <= high


def _law(settings: list[dict[str, str]], model: str) -> str:
    """The model and every name that is free in some setting, with how many settings have it."""
    names = [name.removesuffix("_status") for name in settings[0] if name.endswith("_status")]
    free = {n: sum(row[f"{n}_status"] not in {"fixed", ""} for row in settings) for n in names}
    return f"{model}: " + " ".join(
        name if n == len(settings) else f"{name}({n})" for name, n in free.items() if n
    )


def moved(now: Row, frozen: Row) -> list[str]:
    """Name what differs by more than it may."""

    def differs(a: float, b: float, most: float) -> bool:
        return not (math.isnan(a) and math.isnan(b)) and not abs(a - b) <= most

    ratios = [
        name
        for name in ("fit", "fit_worst", "held_worst")
        if differs(*(math.log(getattr(row, name)) for row in (now, frozen)), math.log(MSE_RATIO))
    ]
    errors = [
        name
        for name in ("error_se", "rms_se")
        if differs(getattr(now, name), getattr(frozen, name), STANDARD_ERRORS)
    ]
    same = [
        name for name in ("covered", "known", "law") if getattr(now, name) != getattr(frozen, name)
    ]
    return [*ratios, *errors, *same]


def shown(name: str, row: Row) -> str:
    """One line of the table."""
    return (
        f"{name:22} {row.fit:9.3g} {row.fit_worst:9.3g} {row.held_worst:9.3g} {row.error:7.3g} "
        f"{row.error_se:6.2f} {row.rms_se:6.2f} {row.covered:4}/{row.known:<4} {row.evaluations:6} "
        f"{row.cpu_s:7.1f}  {row.worst}"
    )


HEAD = (
    f"{'case':22} {'fit %':>9} {'worst %':>9} {'held %':>9} {'error %':>7} {'/se':>6} {'rms':>6} "
    f"{'covered':>9} {'evals':>6} {'CPU s':>7}  furthest"
)


def load_frozen() -> dict[str, Row]:
    """The frozen rows by name."""
    if not FROZEN.exists():
        return {}
    rows = tomllib.loads(FROZEN.read_text(encoding="utf-8"))
    return {name: Row(**row) for name, row in rows.items()}


def _freeze(rows: dict[str, Row]) -> None:
    def value(one: object) -> str:
        return (
            json.dumps(one)
            if isinstance(one, str)
            else f"{one:.6g}"
            if isinstance(one, float)
            else str(one)
        )

    tables = (
        "\n".join([f'["{name}"]', *(f"{key} = {value(one)}" for key, one in asdict(row).items())])
        for name, row in rows.items()
    )
    text = "# Written by `python -m tests.bench_numbers --freeze`; MSE and `error` in per cent.\n\n"
    FROZEN.write_text(text + "\n\n".join(tables) + "\n", encoding="utf-8")


def compared(
    cases: Sequence[Case], frozen: dict[str, Row], *, command: Sequence[str] = ("-m", "damperfit"),
    jobs: int = 2,
) -> dict[str, Row]:  # fmt: skip
    """Measure cases and print each beside its frozen row; return what was measured."""
    print(HEAD)
    rows = {}
    with ThreadPoolExecutor(jobs) as pool:
        for case, row in zip(cases, pool.map(lambda c: measured(c, command), cases), strict=True):
            rows[case.name] = row
            print(shown(case.name, row))
            if (before := frozen.get(case.name)) and (changes := moved(row, before)):
                print(shown("  frozen", before))
                print(f"  MOVED: {', '.join(changes)}")
                if "law" in changes:
                    print(f"  now {row.law}\n  was {before.law}")
            sys.stdout.flush()
    seconds = sum(row.cpu_s for row in rows.values())
    before_s = sum(frozen[name].cpu_s for name in rows if name in frozen)
    print(f"CPU {seconds:.0f} s, frozen {before_s:.0f} s")
    return rows


def _own(folder: Path) -> list[Case]:
    """A damper of a user's own: log by log, and as a whole."""
    kinds = [one for one in ("*_steps.csv", "*_check.csv", "*_slow.csv") if list(folder.glob(one))]
    held = [option for kind in kinds[1:] for option in ("--hold-out", kind)]
    options, logs = (*kinds, *held, "--model", "auto", "--config"), copied(folder).name
    return [
        Case(folder.name, logs, (*options, "damper.toml")),
        Case(f"{folder.name} joint", logs, (*options, "adjusted.toml", "--procedure", "joint")),
    ]


def main() -> None:
    """Print the table; ends with 1 where a number moved."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="beginnings of names of cases")
    parser.add_argument("--freeze", action="store_true")
    parser.add_argument("--jobs", type=int, default=2, help="cases at once")
    given = parser.parse_args()
    cases = [case for folder in given.folders for case in _own(folder)] or [
        case for case in CASES if case.name.startswith(tuple(given.only))
    ]
    frozen = load_frozen()
    rows = compared(cases, {} if given.folders else frozen, jobs=given.jobs)
    if given.freeze and not given.folders:
        _freeze({**frozen, **rows})
    elif not given.folders:
        sys.exit(int(any(moved(row, frozen[name]) if name in frozen else True
                         for name, row in rows.items())))  # fmt: skip


if __name__ == "__main__":
    main()
