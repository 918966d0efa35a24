"""Clean logs of ten rigs: does anything warn where nothing is wrong?

    python -m tests.uncertainty.clean_rigs --logs 40

Every rig has its own damper, motion, rate, cycles, noise, format and signs; its force is that of
the oracle, which shares nothing with the core. The logs of a rig are files, fitted in campaigns of
five settings by `identify`. Printed are the warnings by code, and how many parameters are more
than 2 % and three half intervals off under a grade that stands.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import damperfit
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from tests.oracles.model import solve
from tests.uncertainty.faults import far_off

SETTINGS = (3, 7, 11, 15, 19)
PLACES = 4000  # of a steady cycle
FloatArray = np.ndarray
# Sines by harmonic: amplitude as a share of the first, phase.
SINE = ((1, 1.0, 0.0),)
CRANK = ((1, 1.0, 0.0), (2, 0.031, 0.5 * math.pi))
ROUNDED_TRIANGLE = ((1, 1.0, 0.0), (3, -1.0 / 9.0, 0.0), (5, 1.0 / 25.0, 0.0))
UNEVEN = ((1, 1.0, 0.0), (2, 0.08, 0.3), (3, 0.04, 1.0))


@dataclass(frozen=True)
class Rig:
    """How one rig tests one damper, and what its logger writes; SI."""

    write: Callable[[Path, FloatArray, FloatArray, FloatArray], Path]
    frequency: float = 1.5
    amplitude: float = 0.032
    rate: float = 1000.0
    cycles: int = 15
    motion: tuple[tuple[int, float, float], ...] = SINE
    noise: float = 2.0
    shake: float = 4e-6  # noise of the displacement
    force_step: float = 0.0
    rests: bool = False  # begins and ends at rest at the bottom of the stroke
    sign: float = 1.0  # -1: compression is positive in both channels
    tare: float = 0.0
    damper: tuple[tuple[str, float], ...] = ()
    rig: tuple[tuple[str, object], ...] = ()


def _text(
    path: Path,
    head: str,
    rows: FloatArray,
    forms: tuple[str, ...],
    mark: str = ",",
    point: str = ".",
) -> Path:
    lines = (mark.join(format(v, f) for v, f in zip(row, forms, strict=True)) for row in rows)
    body = "\n".join(line.replace(".", point) if point != "." else line for line in lines)
    path.write_text(f"{head}\n{body}\n", encoding="utf-8")
    return path


def own(path: Path, t: FloatArray, x: FloatArray, f: FloatArray) -> Path:
    head = "# damperfit rig log\ntime_s,displacement_mm,force_N,temperature_degC"
    rows = np.stack([t, 1e3 * x, f, 26.0 + 0.1 * np.sin(t)], axis=1)
    return _text(path.with_suffix(".csv"), head, rows, (".4f", ".4f", ".2f", ".1f"))


def european(path: Path, t: FloatArray, x: FloatArray, f: FloatArray) -> Path:
    rows = np.stack([f / 1e3, 1e3 * x, t], axis=1)
    head = '"Kraft ";"Weg ";"Zeit "\n"kN";"mm";"sec"'
    return _text(path.with_suffix(".csv"), head, rows, (".5f", ".4f", ".4f"), ";", ",")


def american(path: Path, t: FloatArray, x: FloatArray, f: FloatArray) -> Path:
    rows = np.stack([t, x / 0.0254, f / 4.4482216152605], axis=1)
    head = "Time (s),Position (in),Load (lbf)"
    return _text(path.with_suffix(".csv"), head, rows, (".5f", ".5f", ".3f"))


def wall_clock(path: Path, t: FloatArray, x: FloatArray, f: FloatArray) -> Path:
    stamps = np.datetime64("2025-03-04T10:11:12.000") + np.rint(1e3 * t).astype("timedelta64[ms]")
    rows = "\n".join(
        f"{str(s).replace('T', ' ')},{1e3 * a:.4f},{b:.2f}"
        for s, a, b in zip(stamps, x, f, strict=True)
    )
    path = path.with_suffix(".csv")
    path.write_text(f"Timestamp,Displacement (mm),Force (N)\n{rows}\n", encoding="utf-8")
    return path


def tabs(path: Path, t: FloatArray, x: FloatArray, f: FloatArray) -> Path:
    head = "Data Acquisition: Timed\nTime\tAxial Displacement\tAxial Force\nSec\tmm\tkN"
    rows = np.stack([t, 1e3 * x, f / 1e3], axis=1)
    return _text(path.with_suffix(".dat"), head, rows, (".6f", ".6f", ".7f"), "\t")


def numbered(path: Path, t: FloatArray, x: FloatArray, f: FloatArray) -> Path:
    head = f"# sample rate: {1.0 / (t[1] - t[0]):g} Hz\nSample,stroke_mm,load_N"
    rows = np.stack([np.arange(len(t)), 1e3 * x, f], axis=1)
    return _text(path.with_suffix(".csv"), head, rows, (".0f", ".3f", ".1f"))


def milliseconds(path: Path, t: FloatArray, x: FloatArray, f: FloatArray) -> Path:
    rows = np.stack([1e3 * t, 1e2 * x, f / 9.80665], axis=1)
    return _text(
        path.with_suffix(".txt"), "time_ms\tpos_cm\tload_kgf", rows, (".2f", ".5f", ".3f"), "\t"
    )


def parquet(path: Path, t: FloatArray, x: FloatArray, f: FloatArray) -> Path:
    path = path.with_suffix(".parquet")
    pq.write_table(pa.table({"time_s": t, "displacement_m": x, "force_N": f}), path)
    return path


def tdms(path: Path, t: FloatArray, x: FloatArray, f: FloatArray) -> Path:
    from nptdms import ChannelObject, TdmsWriter

    path = path.with_suffix(".tdms")
    clock = {
        "wf_increment": float(t[1] - t[0]), "wf_start_offset": 0.0,
        "wf_start_time": np.datetime64("2025-03-04T10:11:12"),
    }  # fmt: skip
    with TdmsWriter(path) as file:
        file.write_segment(
            [
                ChannelObject("log", "displacement_mm", 1e3 * x, clock),
                ChannelObject("log", "force_N", f, clock),
            ]
        )
    return path


NO_TEMPERATURE = (("temperature_tolerance", math.inf),)
SLIM = (("rod_diameter", 0.012), ("piston_diameter", 0.025), ("gas_pressure", 6e5))
FULL = (("gas_pressure", 1e6),)
RIGS = {
    "the paper's": Rig(own),
    "servo-hydraulic": Rig(european, 2.0, 0.025, 512.0, 8, noise=1.0, shake=2e-6),
    "crank dyno": Rig(american, 1.05, 0.0185, 300.0, 12, CRANK, 1.5, 3e-6),
    "student rig": Rig(wall_clock, 1.2, 0.03, 500.0, 10, SINE, 5.0, 6e-6),
    "long test": Rig(tabs, 3.0, 0.015, 2000.0, 45, SINE, 0.5, 1e-6),
    "coarse converter": Rig(numbered, 1.0, 0.04, 250.0, 9, SINE, 3.0, 2e-6, 1.5),
    "rounded triangle": Rig(milliseconds, 1.6, 0.03, 800.0, 11, ROUNDED_TRIANGLE, 2.0, 4e-6),
    "fast and short": Rig(parquet, 5.0, 0.008, 1000.0, 30, SINE, 2.0, 1e-6, damper=SLIM),
    "uneven, compression positive": Rig(
        tdms, 1.4, 0.028, 1024.0, 13, UNEVEN, 2.0, 3e-6, rests=True, sign=-1.0, damper=FULL
    ),
    "from rest to rest": Rig(own, 0.8, 0.035, 400.0, 7, SINE, 1.0, 3e-6, rests=True),
}


@cache
def oil_force(rig: Rig, setting: int) -> tuple[FloatArray, FloatArray]:
    """Force at `PLACES` of the second cycle, and of the first one, which begins at rest."""
    damper = replace(PURDY_DAMPER, **dict(rig.damper))
    omega = 2.0 * math.pi * rig.frequency
    phase = _turned(rig)

    middle = _middle(rig)

    def displacement(t: float) -> float:
        shape = sum(a * math.sin(k * (omega * t + phase) + p) for k, a, p in rig.motion)
        return rig.amplitude * (shape - middle)

    def velocity(t: float) -> float:
        return rig.amplitude * sum(
            a * k * omega * math.cos(k * (omega * t + phase) + p) for k, a, p in rig.motion
        )

    time = np.linspace(0.0, 2.0 / rig.frequency, 2 * PLACES + 1)
    values = replace(reference_parameters(setting), f_f=0.0, f_0=0.0)
    force = solve(values, damper, (displacement, velocity), time, rtol=1e-8).force
    return force[PLACES:], force[: PLACES + 1]


def _middle(rig: Rig) -> float:
    """Middle of the stroke, which the model takes for x = 0, in amplitudes."""
    phases = np.linspace(0.0, 2.0 * math.pi, 40001)
    shape = sum(a * np.sin(k * phases + p) for k, a, p in rig.motion)
    return 0.5 * float(shape.max() + shape.min())


def _turned(rig: Rig) -> float:
    """Phase at the bottom of the stroke."""
    phases = np.linspace(0.0, 2.0 * math.pi, 40001)
    return float(phases[np.argmin(sum(a * np.sin(k * phases + p) for k, a, p in rig.motion))])


def log_of(rig: Rig, setting: int, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, displacement and force as the logger has them."""
    random = np.random.default_rng([setting, seed])
    still = 0.8 if rig.rests else 0.0
    moving = rig.cycles / rig.frequency
    time = np.arange(round((moving + 2.0 * still) * rig.rate)) / rig.rate
    at = np.clip(time - still, 0.0, moving)
    # Where rests are not logged the record begins anywhere in the cycle.
    turns = at * rig.frequency + (0.0 if rig.rests else random.uniform())
    angle = 2.0 * math.pi * turns + _turned(rig)
    shape = sum(a * np.sin(k * angle + p) for k, a, p in rig.motion)
    x = rig.amplitude * (shape - _middle(rig))
    speed = (
        2.0
        * math.pi
        * rig.frequency
        * rig.amplitude
        * sum(a * k * np.cos(k * angle + p) for k, a, p in rig.motion)
    )
    speed = np.where((time > still) & (time < still + moving), speed, 0.0)
    steady, first = oil_force(rig, setting)
    place = (turns % 1.0) * PLACES
    force = np.interp(place, np.arange(PLACES + 1), steady)
    if rig.rests:
        force = np.where(turns < 1.0, np.interp(place, np.arange(PLACES + 1), first), force)
        fades = np.exp(-np.maximum(time - still - moving, 0.0) / 0.02)  # oil leaks to rest
        force = first[0] + (force - first[0]) * fades
        force = np.where(time <= still, first[0], force)
    friction = reference_parameters(setting).f_f
    force = force + friction * np.clip(speed / 1e-4, -1.0, 1.0) + rig.tare
    force = force + rig.noise * random.standard_normal(len(time))
    x = x + rig.shake * random.standard_normal(len(time))
    if rig.force_step:
        force = rig.force_step * np.round(force / rig.force_step)
    return time, rig.sign * x, rig.sign * force


def campaign(rig: Rig, seed: int) -> tuple[Counter[str], list[str], list[str]]:
    """Return the warnings of a campaign by code, their texts, and what is off unseen."""
    damper = dict(rig.damper) or None
    with tempfile.TemporaryDirectory() as folder:
        logs = [
            rig.write(Path(folder) / f"setting_{setting:02d}", *log_of(rig, setting, seed))
            for setting in SETTINGS
        ]
        run = damperfit.identify(
            logs, damper=damper, rig=dict(NO_TEMPERATURE if rig.write is not own else ()), jobs=1
        )
    told = [one for one in run.problems if one.severity == "warning"]
    return Counter(one.code for one in told), [str(one) for one in told], far_off(run)


def main() -> int:
    """Print the table; return 1 where something warns."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.uncertainty.clean_rigs", description=__doc__
    )
    parser.add_argument("rigs", nargs="*", help="as in the table; all by default")
    parser.add_argument("--logs", type=int, default=40, help="of each rig")
    parser.add_argument("--say", action="store_true", help="print the warnings")
    asked = parser.parse_args()
    n_warnings = 0
    for name in asked.rigs or RIGS:
        codes: Counter[str] = Counter()
        off: list[str] = []
        n = math.ceil(asked.logs / len(SETTINGS))
        for seed in range(n):
            found, texts, far = campaign(RIGS[name], seed)
            codes += found
            off += far
            if asked.say:
                print(*(f"    {text}" for text in texts), sep="\n", end="\n" * bool(texts))
        n_warnings += codes.total()
        listed = ", ".join(f"{code} {count}" for code, count in codes.items()) or "none"
        print(f"{name:30s} {n * len(SETTINGS):3d} logs, warnings: {listed}; "
              f"off unseen {len(off)} {', '.join(off[:3])}", flush=True)  # fmt: skip
    return int(n_warnings > 0)


if __name__ == "__main__":
    sys.exit(main())
