"""Every number of small whole runs, held against `snapshots/numbers.txt`.

    OMP_NUM_THREADS=1 python -m tests.test_numbers         # writes them anew: review the difference
    OMP_NUM_THREADS=1 python -m tests.test_numbers joint   # those of one case, rounded as tests do

A line of the snapshot is a place in what a case returns, and its numbers in order; more than six
are held as their count, the mean of their sizes and a mean with uneven weights. Of a sentence its
numbers count (~), to their last digit, and not its words. A test that fails prints what has moved.
"""

import itertools
import json
import math
import re
import sys
import zlib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict, fields, is_dataclass, replace
from enum import Enum
from functools import cache, partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from scipy.signal import butter, sosfilt

import damperfit
from damperfit.adjustment.clicks import Adjustment
from damperfit.checks import Subject, run_checks
from damperfit.cli import main as damperfit_command
from damperfit.conditioning import condition, transients
from damperfit.configuration.loading import load_configuration
from damperfit.damper.model import MODELS, Quantity, model_named
from damperfit.damper.mounting import FIT, NONE, Friction, Mounting, before_load_cell
from damperfit.damper.network import Valve
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.quasi_static import quasi_static
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import DamperfitError
from damperfit.fleets.parts import part_path, write_part
from damperfit.laws.description import LawAt, physics_in
from damperfit.laws.structures import LAYOUTS, Structure, exchanges, moves
from damperfit.problem import Problem
from damperfit.recording import Recording
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.synthetic import made_up_values
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Assessment

SNAPSHOT = Path(__file__).parent / "snapshots" / "numbers.txt"
SAMPLE = Path(__file__).parents[1] / "sample_runs" / "setting_10.csv"
MOST, TOGETHER = 6, 2  # numbers of a line that are shown, and of what shares a line
# What a number may be off on another machine, of itself: by case and place, the first that fits.
# Scans end at one of their steps, and errors hang on how many lags of a correlation count.
LOOSE = (
    (r"evaluations", 0.7),
    (r"skew|advise|in_steps.*tare", 0.3),
    (
        r"(plain|temperatures) .*(_se|error|correl|jackknife|ci_|sandwich|verdict|profil|sentenc)",
        0.08,
    ),
    (r"searched.*bic", 0.013),
    (r"searched|own_offset|asked.*(difference|percent|chance)", 0.05),
    (r"margin|plain|temperatures|flaw_ladders", 3e-3),
    (r"", 3e-4),
)
ROUNDED = 1e-9  # of what is nothing but rounding
# What is no number of a run, or stands in it twice.
IDLE = {"configuration", "timings", "version", "path", "sha256", "schema", "quantities", "message"}
IDLE |= {"warnings", "procedure", "displacement", "description", "files"}
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")

# Numbers of any object, as lines.


def leaves(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:  # noqa: PLR0912
    """Yield places and numbers; what a list holds has one place, or that of its names."""
    if isinstance(value, Problem):
        yield from leaves([value.severity, value.values.get("value")], place)
        value = str(value)
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, Setting):
        value = str(value)
    if is_dataclass(value):
        value = {one.name: getattr(value, one.name) for one in fields(value)}
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        for key, one in value.items():
            if key not in IDLE and not (isinstance(one, str) and place.endswith(f".{one}")):
                yield from leaves(one, f"{place}.{str(key).replace(' ', '_')}".strip("."))
    elif isinstance(value, np.ndarray):
        yield from ((place, float(one)) for one in value.ravel())
    elif isinstance(value, list | tuple | set | frozenset):
        for one in value:
            yield from leaves(one, place + _label(one))
    elif isinstance(value, str) and " " in value:
        yield from ((place, f"~{one}") for one in _NUMBER.findall(value))
    elif isinstance(value, str | int | float | np.generic) and value != "":
        yield place, value


def _label(one: Any) -> str:
    """What tells an element of a list from the others: its name or code."""
    get = one.get if isinstance(one, Mapping) else lambda key: getattr(one, key, None)
    names = (name for name in map(get, ("name", "code")) if isinstance(name, str))
    return "".join(f".{name.replace(' ', '_')}" for name in names)


def lines_of(value: Any) -> dict[str, str]:
    """Return the lines of a case, by place; what has a number or two stands together."""
    by_place: dict[str, list[Any]] = {}
    for place, one in leaves(value):
        by_place.setdefault(place, []).append(one)
    lines: dict[str, list[str]] = {}
    for place, values in by_place.items():
        parent, _, own = place.rpartition(".")
        if len(values) > TOGETHER:
            lines[place] = _shown(values)
        else:
            lines.setdefault(parent, []).append(f"{own}={','.join(_shown(values))}")
    return {place: " ".join(tokens) for place, tokens in sorted(lines.items())}


def _shown(values: list[Any]) -> list[str]:
    numbers = [float(one) for one in values if not isinstance(one, str)]
    words = [one.replace(" ", "_") for one in values if isinstance(one, str)]
    shown = [f"{one:.6g}" for one in numbers]
    if len(numbers) > MOST:
        known = np.array([one for one in numbers if math.isfinite(one)])
        weights = 1.0 + 0.5 * np.sin(1.0 + np.arange(len(known)))
        means = (np.mean(np.abs(known)), np.mean(weights * known)) if len(known) else ()
        shown = [f"{len(known)}/{len(numbers)}", *(f"{one:.6g}" for one in means)]
    if len(words) > MOST:
        counts = Counter(word for word in words if word[0] != "~")
        told = [float(word[1:]) for word in words if word[0] == "~"]
        in_order = zlib.crc32(" ".join(word for word in words if word[0] != "~").encode())
        words = [f"{n}*{word}" for word, n in sorted(counts.items())[:MOST]]
        words += [f"#{in_order}"] * (len(counts) > MOST)
        words += [f"{len(told)}~", f"{sum(map(abs, told)):.6g}"] * bool(told)
    return [*shown, *words]


def moved(place: str, was: str, now: str) -> str:
    """Say what of a line has moved by more than it may; empty: nothing."""
    olds, news = was.split(), now.split()
    if ("=" in was) is not ("=" in now):
        return f"{place}: {was} -> {now}"
    if "=" in was:
        before, after = (dict(one.split("=", 1) for one in tokens) for tokens in (olds, news))
        both = ((name, before.get(name, ""), after.get(name, "")) for name in {**before, **after})
        told = (_moved(f"{place}.{name}", *values) for name, *values in both)
        return "; ".join(filter(None, told))
    return _moved(place, ",".join(olds), ",".join(news))


def _moved(place: str, was: str, now: str) -> str:
    olds, news = was.split(","), now.split(",")
    share = next(most for pattern, most in LOOSE if re.search(pattern, place))
    change = f"{place}: {was} -> {now}"
    if any(one.endswith("~") for one in olds):
        share = max(share, 0.01)  # a sum of rounded numbers
    if len(olds) != len(news):
        return change
    sizes = [abs(float(one)) for one in olds if _NUMBER.fullmatch(one)]
    off = []
    for old, new in zip(olds, news, strict=True):
        if old == new:
            continue
        texts = [one.lstrip("~") for one in (old, new)]
        if not all(map(_NUMBER.fullmatch, texts)):
            return change
        first, second = map(float, texts)
        allowed = share * max([*sizes, abs(second)]) + ROUNDED
        if old[0] == "~":
            allowed = max(share * abs(first), *(1.01 * _digit(one) for one in texts))
        if abs(second - first) > allowed:
            off.append(f"{100.0 * (second - first) / (abs(first) or 1.0):+.3g} %")
    return f"{change} ({', '.join(off)})" if off else ""


def _digit(text: str) -> float:
    mantissa, _, power = text.partition("e")
    return 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


Change = Callable[[np.ndarray, Recording], np.ndarray]  # of a channel
Fault = Callable[[Recording], Recording]

# Logs: the core's forces of a motion, with noise, and what a rig does to them.

RATE = 500.0
ROUGH = SolverOptions(tolerance=1e-2)


def parts(*motions: tuple[float, float, float], rest: float = 0.3, rate: float = RATE) -> Motion:
    """Sines of amplitudes, m, frequencies, Hz, and cycles one after the other, behind a rest."""
    x = [np.zeros(round(rest * rate))]
    v = [np.zeros(round(rest * rate))]
    for amplitude, frequency, cycles in motions:
        angle = 2.0 * np.pi * frequency * np.arange(round(cycles * rate / frequency)) / rate
        x.append(amplitude * np.sin(angle))
        v.append(amplitude * 2.0 * np.pi * frequency * np.cos(angle))
    return Motion(1.0 / rate, np.concatenate(x), np.concatenate(v))


def sine(
    cycles: float = 8.3, *, lead: float = 0.7, rate: float = RATE, amplitude: float = 0.032
) -> Motion:
    """A machine that runs when the log starts."""
    angle = 3.0 * np.pi * (np.arange(round(cycles / 1.5 * rate)) / rate + lead)
    return Motion(1.0 / rate, amplitude * np.sin(angle), amplitude * 3.0 * np.pi * np.cos(angle))


def triangle(
    speed: float, *, cycles: float = 6.0, amplitude: float = 0.03, width: int = 1
) -> Motion:
    """Even speeds, with corners that are rounded over so many samples."""
    period = 4.0 * amplitude / speed
    turn = (np.arange(round(cycles * period * RATE)) / RATE / period + 0.07) % 1.0
    x = amplitude * (1.0 - 4.0 * np.abs(((turn + 0.25) % 1.0) - 0.5))
    x = np.convolve(np.pad(x, width // 2, "edge"), np.ones(width) / width, "valid")
    return Motion(1.0 / RATE, x, np.gradient(x, 1.0 / RATE))


def road(*, highest: float = 4.0, duration: float = 8.0, middle: float = 0.0) -> Motion:
    """A motion that does not repeat."""
    random, t = np.random.default_rng(3), np.arange(round(duration * RATE)) / RATE
    rates = np.arange(0.3, highest, 0.25)
    turns = 2.0 * np.pi * rates[:, None] * t + random.uniform(0.0, 6.3, (len(rates), 1))
    x, v = (1.0 / rates) @ np.sin(turns), (2.0 * np.pi * np.ones(len(rates))) @ np.cos(turns)
    size = 0.035 / np.abs(x).max()
    return Motion(1.0 / RATE, middle + size * x, size * v)


def sweep() -> Motion:
    """A sine of rising frequency."""
    t = np.arange(round(8.0 * RATE)) / RATE
    rate = 0.5 + 0.3 * t
    angle = 2.0 * np.pi * (0.5 * t + 0.15 * t**2)
    return Motion(1.0 / RATE, 0.015 * np.sin(angle), 0.03 * np.pi * rate * np.cos(angle))


def log(
    motion: Motion,
    values: Any = None,
    model: Any = PURDY_DAMPER,
    *,
    setting: Any = 10,
    noise: float = 2.0,
    jitter: float = 4e-6,
    temperature: float | None = 26.0,
    name: str = "",
) -> Recording:
    """What a rig writes of a motion; by default of the paper's damper at a setting."""
    values = values or reference_parameters(int(setting))
    force = simulate(values, model, motion, options=ROUGH).force
    random, n = np.random.default_rng(len(force) + len(str(setting))), len(force)
    return Recording(
        name=name or f"setting_{setting}.csv".replace(" ", "_"),
        path="",
        sha256="",
        setting=Setting.of(setting),
        time=motion.interval * np.arange(n),
        displacement=motion.displacement + jitter * random.standard_normal(n),
        force=force + noise * random.standard_normal(n),
        temperature=None if temperature is None else np.full(n, temperature),
    )


def with_(channel: str, change: Change) -> Fault:
    """What changes a channel of a log."""
    return lambda one: replace(one, **{channel: change(getattr(one, channel).copy(), one)})


def rows(keep: Callable[[np.ndarray], np.ndarray]) -> Fault:
    """What keeps some rows of a log."""

    def kept(one: Recording) -> Recording:
        at = keep(np.arange(len(one.time)))
        channels = ("time", "displacement", "force", "temperature")
        return replace(one, **{name: getattr(one, name)[at] for name in channels})

    return kept


def low_pass(corner: float) -> Change:
    return lambda y, one: (
        sosfilt(butter(2, corner, fs=1.0 / (one.time[1] - one.time[0]), output="sos"), y - y[0])
        + y[0]
    )


def late(seconds: float) -> Change:
    return lambda y, one: np.interp(one.time - seconds, one.time, y)


def _spiked(y: np.ndarray, one: Recording) -> np.ndarray:
    y[[700, 1100, 1101, 1600, 2000]] += np.array([0.3, 0.5, -0.2, 0.04, -0.6]) * np.ptp(y)
    return y


def _stuck(y: np.ndarray, one: Recording) -> np.ndarray:
    y[1240:1275] = y[1240]
    return y


def ramp(one: Recording) -> np.ndarray:
    return one.time / one.time[-1]


def passed(one: Recording) -> np.ndarray:
    return np.gradient(one.displacement, one.time)


SAID = {"frequency": "1.6 Hz", "amplitude_mm": "25"}
CHANNELS = ("displacement", "force")
FORCE, PLACE = partial(with_, "force"), partial(with_, "displacement")
STEPPED = ((0.02, 0.5, 3), (0.02, 1.5, 6), (0.02, 3.0, 9))
SINE = cache(lambda: log(sine()))
FINE = cache(lambda: log(sine(rate=1000.0)))
LONG = cache(lambda: log(sine(12.3)))
STEPS = cache(lambda: log(parts(*STEPPED)))
ROAD = cache(lambda: log(road()))
TRIANGLE = cache(lambda: log(triangle(0.2)))
TWICE = cache(lambda: log(parts((0.02, 1.5, 6), (1e-9, 1.0, 2), (0.02, 1.5, 6))))


def BOTH(one: Recording) -> Recording:  # noqa: N802 - a fault
    """Both channels the other way round."""
    return replace(one, force=-one.force, displacement=-one.displacement)


# A log, what is done to it, and what is declared.
LOGS: dict[str, tuple[Callable[[], Recording], Fault | None, dict[str, Any]]] = {
    "sine": (SINE, None, {}),
    "sine at 2 kHz": (lambda: log(sine(5.3, rate=2000.0)), None, {}),
    "sine at 100 Hz": (lambda: log(sine(12.3, rate=100.0)), None, {}),
    "sine at 40 Hz": (lambda: log(sine(12.3, rate=40.0)), None, {}),
    "stepped": (STEPS, None, {}),
    "stepped with rests": (
        lambda: log(parts((0.02, 1.0, 5), (1e-9, 1.0, 1), (0.01, 3.0, 12), rest=1.0)),
        None,
        {},
    ),
    "sweep": (lambda: log(sweep()), None, {}),
    "road": (ROAD, None, {}),
    "triangle": (TRIANGLE, None, {}),
    "fast": (lambda: log(parts((0.003, 12.0, 60))), None, {}),
    "two forces": (
        lambda: log(parts((0.02, 2.0, 16))),
        FORCE(lambda y, one: np.where(one.time > 4.3, 1.4, 1.0) * y),
        {},
    ),
    "causal filter": (SINE, None, {"conditioning": {"filter": "causal"}}),
    "no filter": (SINE, None, {"conditioning": {"filter": "none"}}),
    "another corner": (STEPS, None, {"conditioning": {"filter_corner": "12Hz", "filter_order": 3}}),
    "auto corner": (STEPS, None, {"conditioning": {"filter_corner": "auto"}}),
    "rig filter": (SINE, None, {"rig": {"filter": "causal", "filter_corner": "25Hz"}}),
    "rig filter, zero phase": (
        TRIANGLE,
        None,
        {"rig": {"filter": "zero_phase", "filter_order": 2}},
    ),
    "centre": (SINE, PLACE(lambda y, _: y + 0.012), {"rig": {"centre": "11mm"}}),
    "late, taken back": (LONG, FORCE(late(3e-3)), {"rig": {"skew": "auto"}}),
    "late as declared": (SINE, FORCE(late(3e-3)), {"rig": {"skew": "3ms"}}),
    "force reversed": (SINE, FORCE(lambda y, _: -y), {}),
    "displacement reversed": (SINE, PLACE(lambda y, _: -y), {}),
    "both reversed": (SINE, BOTH, {}),
    "as declared": (SINE, FORCE(lambda y, _: -y), {"rig": {"reverse_force": True}}),
    "force clipped": (
        lambda: log(sine(), noise=0.5),
        FORCE(lambda y, _: np.clip(y, 0.93 * y.min(), 0.96 * y.max())),
        {},
    ),
    "spikes": (SINE, FORCE(_spiked), {}),
    "spikes, bridged": (SINE, FORCE(_spiked), {"conditioning": {"spikes": "bridge"}}),
    "force drifts over steps": (
        lambda: log(parts((0.03, 0.3, 3), (0.03, 0.8, 3), (0.03, 1.5, 3))),
        FORCE(lambda y, one: y + 120.0 * ramp(one)),
        {},
    ),
    "no temperature": (lambda: log(sine(), temperature=None), None, {}),
    "clock in ms": (
        lambda: log(sine(rate=2000.0)),
        with_("time", lambda t, _: np.floor(1e3 * t) / 1e3 + 1e-7 * (np.arange(len(t)) % 2)),
        {},
    ),
    "swapped": (
        SINE,
        lambda one: replace(one, force=one.displacement * 1e5, displacement=one.force * 1e-5),
        {},
    ),
    "constant": (SINE, FORCE(lambda y, _: 0.0 * y), {}),
    "slow, a pump": (
        lambda: log(parts((0.03, 0.3, 4))),
        FORCE(lambda y, one: y + 15.0 * np.sin(18.2 * np.pi * one.time)),
        {},
    ),
    "pauses": (lambda: log(parts((0.02, 1.5, 6), (1e-9, 2.0, 1), (0.02, 1.5, 7))), None, {}),
    "reversed, and declared not": (
        lambda: log(parts((0.02, 1.0, 6), (1e-9, 2.0, 1), (0.02, 1.0, 6)), setting=1),
        lambda one: replace(BOTH(one), reverse_displacement=False, reverse_force=False),
        {},
    ),
    "no velocity": (SINE, lambda one: replace(one, velocity=np.cos(31.0 * one.time)), {}),
    "as said": (SINE, lambda one: replace(one, metadata=SAID), {}),
    "too fast": (lambda: log(parts((0.0005, 45.0, 100)), jitter=0.0), None, {}),
    "late start": (SINE, with_("time", lambda t, _: t + 1e4), {}),
    "auto corner at a low rate": (
        lambda: log(parts((0.01, 4.0, 30), rate=120.0)),
        None,
        {"conditioning": {"filter_corner": "auto"}},
    ),
}


def conditioned(name: str) -> Any:
    """Return the trace of a log, or why there is none."""
    make, change, declared = LOGS[name]
    options = load_configuration(overlay=declared).conditioning
    one = make()
    try:
        return condition(one if change is None else change(one), options)
    except DamperfitError as error:
        return {"refused": error.problem, "code": error.problem.code}


@cache
def all_conditioned() -> dict[str, Any]:
    return {name.replace(" ", "_"): conditioned(name) for name in LOGS}


def of_model(name: str) -> Any:
    """Return the fit of a model to a log of its own, and how it was judged."""
    from tests.test_every_model import case as fitted

    done = fitted(name)
    (one,), (known,) = done.campaign.fits, done.assessment.uncertainties
    ended = {"force": done.trace.force, "ended": (one.outcome, one.mse_percent)}
    if name in {
        "polynomial_xv",
        "restoring_force_surface",
    }:  # on one sine their terms are not independent
        return ended
    return {
        **ended,
        "starts": [asdict(start) for start in done.model.start([done.trace], {})],
        "fit": asdict(one.parameters),
        "status": one.status,
        "evaluations": one.evaluations,
        "known": known,
        "diagnoses": done.assessment.diagnoses,
        "doubts": done.assessment.doubts(done.campaign),
    }


CASES: dict[str, Callable[[], Any]] = {
    "logs": all_conditioned,
    **{f"model {name}": partial(of_model, name) for name in MODELS},
}


def case(make: Callable[[], Any]) -> Callable[[], Any]:
    """Hold what a function returns."""
    CASES[make.__name__] = make
    return make


def limits_of(model: Any) -> dict[str, Any]:
    """What a fit of a model stays within, what is held and what is believed of its quantities."""
    usual = {f.name: f.default for f in fields(Quantity) if "str" not in str(f.type)}
    return {
        q.name: {name: getattr(q, name) for name in usual if getattr(q, name) != usual[name]}
        for q in model.quantities
    }


@case
def limits() -> Any:
    """The quantities of every model."""
    return {name: limits_of(model_named(name)()) for name in MODELS}


# Runs.

TABLES = ("parameters", "mse", "adjustment", "characteristics", "valves", "profiles")


def told(run: damperfit.Run, *, whole: bool = False) -> dict[str, Any]:
    """Return what a run holds; of its logs, forces and checks only with `whole`."""
    record = dict(run.record)
    if not whole:
        signs = {True: "+", False: "-", None: "?"}
        kept = (
            "problems",
            "uncertainty",
            "profiles",
            "grades_withheld",
            "held_out",
            "speed_forces",
        )
        short = {name: record[name] for name in kept}
        short["checks"] = "".join(signs[one["passed"]] for one in record["checks"])
        return {**short, **{name: run.rows(name) for name in ("parameters", "mse")}}
    inputs = record.pop("inputs")
    logs = [{**one, "findings": (), "notes": (), "warnings": ()} for one in inputs]
    signals = [(one.force, one.force_measured, one.pressures) for one in run.signals]
    return {"run": record, "logs": logs, "signals": signals, **{n: run.rows(n) for n in TABLES}}


def fit(logs: Any, **how: Any) -> damperfit.Run:
    return damperfit.identify(logs, jobs=1, **how)


SETTINGS = (4, 8, 12, 16, 20)


@cache
def of_paper() -> damperfit.Run:
    """Three settings by the paper's procedure."""
    return fit([log(sine(), setting=one) for one in SETTINGS[:3]])


@case
def paper() -> Any:
    return told(of_paper(), whole=True)


@case
def asked_of_a_run() -> Any:
    run, ask = of_paper(), damperfit
    few = fit([log(sine(), setting=8)], fix={"r_m3": 2.597e6, "f_f": 50.0})
    motion = {"parameters": run, "amplitude": 0.02, "frequency": 2.0, "cycles": 2.0}
    return {
        "simulate": ask.simulate(8, **motion).document(),
        "triangle": ask.simulate(8, wave="triangle", **motion).document(),
        "sweep": ask.sweep(8, parameters=run, vary={"r_m1": [0.8, 1.2], "k_e": [0.5]}).records,
        "settings": ask.settings(run).document(),
        "which": ask.settings(run, force="900N", velocity="0.2m/s").document(),
        "advise": ask.advise(few, for_="k_e", setting="8").document(),
        "compare": ask.compare(run, of_five()).document(),
        "measured": ask.compare(run, of_five(), measured=True, tolerance="1%,5N").document(),
        "inspect": ask.inspect(str(SAMPLE)).document(),
    }


@cache
def of_five() -> damperfit.Run:
    """Five settings in one fit; the middle one has another valve."""
    odd = replace(reference_parameters(12), r_m1=1.06 * reference_parameters(12).r_m1)
    logs = [log(sine(), odd if one == 12 else None, setting=one) for one in SETTINGS]
    return fit(logs, procedure="joint")


@case
def joint() -> Any:
    return told(of_five(), whole=True)


@case
def joint_gas_content() -> Any:
    logs = [log(sine(), setting=one) for one in SETTINGS[:3]]
    return told(fit(logs, procedure="joint", bulk_modulus="appendix1", hold_out=["setting_8*"]))


@case
def plain() -> Any:
    """Two logs a setting, the last cycles and a log held out, an offset, a start."""
    logs = [
        log(motion, setting=one, name=f"s{one}_{name}.csv")
        for one in (4, 16)
        for name, motion in (
            ("a", sine()),
            ("b", parts((0.02, 3.0, 12))),
            ("c", parts((0.03, 0.5, 4))),
        )
    ]
    logs = [FORCE(lambda y, _: y + 25.0)(one) for one in logs]
    how = {"fix": {"f_f": "50N"}, "free": "r_m1,r_m2,r_m3,k_e,f_0", "start": {"r_m1": 1e4}}
    run = fit(logs, procedure="plain", hold_out=["*_c*"], hold_out_cycles=0.3, profile="k_e", **how)
    return told(run, whole=True)


@case
def steps_held_out() -> Any:
    return told(fit([STEPS()], hold_out=["0.3m/s-"]), whole=True)


@case
def motions() -> Any:
    """Motions that do not repeat, and a log of few samples a cycle."""
    logs = {
        "road": ROAD(),
        "sweep": log(sweep()),
        "triangle": log(triangle(0.2, cycles=8.0), noise=0.5),
        "slow_log": log(sine(10.3, rate=66.0)),
        "small": log(sine(amplitude=0.002)),
    }
    known = {"f_f": "50N", "r_m3": 2.597e6}
    return {name: told(fit([one], procedure="plain", fix=known)) for name, one in logs.items()}


@case
def oil() -> Any:
    """A chamber that empties, oil that does not give, oil that gives much."""
    own = reference_parameters(16)
    values = {
        "cavitates": replace(own, r_m3=1.3 * own.r_m3),
        "rigid": replace(own, k_e=1e12),
        "soft": replace(own, k_e=3e7),
    }
    found = {name: told(fit([log(sine(), one, setting=16)])) for name, one in values.items()}
    # Explained by a chamber that empties or without it, equally well: without it.
    own = reference_parameters(2)
    loose = FLAWS["mounting"](log(sine(), replace(own, r_m3=1.1 * own.r_m3), setting=2))
    return {**found, "loose": told(fit([loose], procedure="plain"))}


@case
def temperatures() -> Any:
    logs = [
        log(
            sine(),
            warmer(reference_parameters(one), hot),
            setting=one,
            temperature=hot,
            name=f"s{one}_{hot:g}.csv",
        )
        for one in (4, 16)
        for hot in (26.0, 45.0)
    ]
    return told(
        fit(logs, covariate="temperature", procedure="joint", share="r_m3,f_f,beta"), whole=True
    )


def warmer(values: Any, temperature: float) -> Any:
    thinner = math.exp(-0.012 * (temperature - 26.0))
    return replace(values, r_m2=thinner * values.r_m2, r_m3=thinner * values.r_m3)


FLAWS: dict[str, Fault] = {
    "late": FORCE(late(3e-3)),
    "filter": FORCE(low_pass(30.0)),
    "slow_friction": FORCE(
        lambda y, one: y + 30.0 * np.sign(speed(one)) * np.exp(-np.abs(speed(one)) / 0.05)
    ),
    "side_load": FORCE(lambda y, one: y + 900.0 * np.abs(one.displacement) * np.sign(speed(one))),
    "presliding": FORCE(
        lambda y, one: (
            y - 100.0 * np.sign(speed(one)) * np.exp(-(0.032 - np.abs(one.displacement)) / 5e-4)
        )
    ),
    "gas": FORCE(lambda y, one: y - 1500.0 * one.displacement),
    "mass": FORCE(lambda y, one: y - 3.0 * (3.0 * np.pi) ** 2 * one.displacement),
    "zero": FORCE(lambda y, _: y + 25.0),
    "drift": FORCE(lambda y, one: y + 15.0 * ramp(one)),
    "fades": FORCE(lambda y, one: y * (1.0 - 0.05 * ramp(one))),
    "cell": FORCE(lambda y, _: y + 0.03 * y * (y / 1500.0) ** 2),
    "mounting": PLACE(lambda y, one: y + one.force / 2e6),
    "play": PLACE(lambda y, one: y + 1.5e-4 * np.tanh(one.force / 20.0)),
    "end_stop": FORCE(lambda y, one: y + 5e4 * np.maximum(one.displacement - 0.03, 0.0)),
    "hum": FORCE(lambda y, one: y + 15.0 * np.sin(18.2 * np.pi * one.time)),
}


def speed(one: Recording) -> np.ndarray:
    return np.gradient(0.032 * np.sin(3.0 * np.pi * (one.time + 0.7)), one.time)


@case
def flaws() -> Any:
    """One fault of rig or damper each, and what is said of its misfit."""
    logs = {name: change(SINE()) for name, change in FLAWS.items()}
    # Two speeds, of which one counts more; a preload that holds its force is in the model, too.
    model = ThroughFlow(mounting=Mounting(FIT))
    late_valve = FORCE(late(3e-3))(valve_log(model, 3))
    found = {name: told(fit([one], fix={"r_m3": 2.597e6})) for name, one in logs.items()}
    # Two logs of a setting, of unlike strokes.
    loaded = FORCE(lambda y, one: y + 900.0 * np.abs(one.displacement) * np.sign(passed(one)))
    both = [loaded(log(sine(7.3, amplitude=a), name=f"{a}.csv")) for a in (0.016, 0.032)]
    found["side_load_of_two"] = told(fit(both, fix={"r_m3": 2.597e6}))
    return {**found, "late_valve": told(fit([late_valve], damper=model))}


IDLE_ROWS = ("ci_low", "ci_high", "margin", "evaluations", "velocity", "n_logs", "setting")


@case
def flaw_ladders() -> Any:
    """Each of the faults from small to large: where a verdict on it begins, and what it costs."""
    found = {}
    for name, change in FLAWS.items():
        sound, bad, seen = SINE(), change(SINE()), []
        for size in (0.1, 0.3, 3.0):
            x, f = ((1.0 - size) * getattr(sound, c) + size * getattr(bad, c) for c in CHANNELS)
            seen.append(told(fit([replace(sound, displacement=x, force=f)], fix={"r_m3": 2.597e6})))
        (rows,) = zip(*(each["parameters"] for each in seen), strict=True)
        problems = (each["problems"] for each in seen)
        found[name] = {
            "checks": [each["checks"] for each in seen],
            "said": [[(p["code"], p["values"].get("flaw", "")) for p in each] for each in problems],
            **{key: [row[key] for row in rows] for key in rows[0] if not key.endswith(IDLE_ROWS)},
        }
    return found


@case
def odd_logs() -> Any:
    """One log of four with another clock, stroke or gain, or of several speeds."""
    sound = [log(sine(), setting=one) for one in (4, 10, 16, 19)]
    changes = {
        "clock": with_("time", lambda t, _: 1.02 * t),
        "speeds": lambda _: log(parts((0.032, 1.5, 6), (0.032, 2.5, 9)), setting=10),
    }
    steps = [log(parts((0.032, 1, 4), (0.032, 2, 6)), setting=one) for one in (4, 10, 16)]
    steps[1] = PLACE(lambda y, _: 1.03 * y)(steps[1])
    found = {
        name: told(fit([sound[0], change(sound[1]), *sound[2:]]))
        for name, change in changes.items()
    }
    gain = [*sound[:3], FORCE(lambda y, _: 1.05 * y)(sound[3])]
    return {
        **found,
        "stroke": told(fit(steps, fix={"r_m3": 2.597e6, "f_f": 50.0})),
        "gain": told(fit(gain)),
    }


VALVES = {
    "rebound_bleed": 5e4, "rebound_opening": 2.5e5, "rebound_slope": 5e6,
    "compression_bleed": 4e4, "compression_opening": 2e5, "compression_slope": 4e6,
    "k_e": 9e8, "f_f": 20.0, "f_0": -12.0, "return_slope": 2.5e5, "k_s": 4e5,
    "play": 4e-4, "lag": 6e-3, "breakaway": 15.0, "stribeck_speed": 0.02,
}  # fmt: skip
SLOWER = ((0.02, 0.5, 3), (0.02, 2.0, 7))


def valve_log(
    model: Any, setting: Any, motion: Motion | None = None, **factors: float
) -> Recording:
    values = {name: VALVES[name] * factors.get(name, 1.0) for name in VALVES if name in model.names}
    motion = motion or parts(*SLOWER)
    return log(motion, model.values(values), model, setting=setting, noise=1.5, jitter=3e-6)


@cache
def of_valves() -> damperfit.Run:
    """A twin tube behind a mounting with play and lag."""
    model = TwinTube(gas_pressure=5e5, mounting=Mounting(FIT, FIT, FIT))
    logs = [valve_log(model, 3), valve_log(model, 5, rebound_bleed=0.7, rebound_opening=1.4)]
    return fit(logs, damper=model)


@case
def gas_pressure_declared_wrong() -> Any:
    """A third more than there is: the gas volume and the offset take it up."""
    model, free = TwinTube(gas_pressure=1.5e6), ("f_0", "f_f", "k_e", "gas_volume")
    known = {name: VALVES[name] for name in VALVES if name in model.names and name not in free}
    one, damper = valve_log(model, 3, f_0=0.0), replace(model, gas_pressure=2e6)
    run = fit([one], damper=damper, free=free, fix=known)
    return told(run)["problems"]


@case
def valves() -> Any:
    run = of_valves()
    return {
        **told(run, whole=True),
        "orifices": damperfit.valves(run, seat="8mm", force="500N", velocity="0.2m/s").document(),
    }


@case
def adjusters() -> Any:
    """Two adjusters whose clicks move bleeds and openings, in one fit."""
    model = TwinTube(gas_pressure=5e5, mounting=Mounting(NONE))
    moves = {6: 1.0, 14: 0.6}, {1: 1.0, 3: 1.5}
    logs = [
        valve_log(
            model,
            Setting((("low", low), ("high", high))),
            rebound_bleed=soft,
            compression_bleed=soft,
            rebound_opening=stiff,
        )
        for low, soft in moves[0].items()
        for high, stiff in moves[1].items()
    ]
    run = fit(logs, damper=model, procedure="joint")
    return {**told(run, whole=True), "asked": [wanted(run, f) for f in ("350N", "400N", "-100N")]}


def wanted(run: damperfit.Run, force: str) -> Any:
    answer = damperfit.settings(run, force=force, velocity="0.2m/s").document()
    return answer["sentence"], answer["answers"]


def unlike(change: Callable[[Any, int], Any]) -> list[Recording]:
    """Logs of three settings whose values are others."""
    own = [(one, reference_parameters(one)) for one in SETTINGS[:3]]
    return [log(sine(), change(values, k), setting=one) for k, (one, values) in enumerate(own)]


FRICTIONS = partial(unlike, lambda values, k: replace(values, f_f=30.0 + 20.0 * k))
UNSEEN = partial(unlike, lambda values, _: replace(values, r_m3=2.6e3, f_f=1e-3))
SOUND = partial(unlike, lambda values, _: values)


@case
def doubtful() -> Any:
    """What settings do not tell or disagree about, and what is predicted badly."""
    own = {one: reference_parameters(one) for one in SETTINGS}
    thick = replace(PURDY_DAMPER, rod_diameter=0.022)
    outside = replace(thick, ambient_pressure=101325.0)
    airy = [log(sine(), own[one], outside, setting=one) for one in (8, 12)]
    other = replace(own[8], r_m1=1.3 * own[8].r_m1)
    held = log(parts((0.02, 2.5, 12)), other, setting=8, name="held.csv")
    return {
        "frictions": told(fit(FRICTIONS())),
        "unseen_alone": told(fit(UNSEEN()[:1], procedure="plain")),
        "air": told(fit(airy, damper=thick)),
        "missed": told(fit([*SOUND(), held], hold_out=["held*"])),
        "starts": fit([SOUND()[2]], procedure="plain", starts=4).record["searches"],
    }


@case
def doubtful_together() -> Any:
    """At night: the same of settings in one fit."""
    return {
        "apart": told(fit(FRICTIONS(), procedure="joint")),
        "unseen": told(fit(UNSEEN())),
        "shared_profile": told(fit(SOUND(), procedure="joint", profile="r_m3")),
    }


@case
def forces_wanted() -> Any:
    """Which setting gives a force, in both strokes, between clicks and beyond them."""
    asked = ("900N", "-700N", "60kN", "1N", "1500N", "2kN")
    uneven = fit([log(sine(), setting=one) for one in (2, 3, 9, 11, 19)])
    return [wanted(run, force) for run in (of_five(), uneven) for force in asked]


@case
def valve_kinds() -> Any:
    """Valves of every kind in every layout, all parts of mounting and friction: forces, starts."""
    bleeds = itertools.cycle(("none", "orifice", "long", "leak"))
    blow_offs = ("linear", "none", "linear", "port", "rounded", "power")
    found = {}
    for layout, blow_off in zip(itertools.cycle([TwinTube, Monotube, ThroughFlow]), blow_offs):
        rebound, compression = Valve("orifice", blow_off), Valve(next(bleeds), "linear")
        turns = {"turning_speed": FIT} if blow_off == "port" else {"presliding": FIT}
        model = layout(
            gas_pressure=2e6,
            rebound=rebound,
            compression=compression,
            mounting=Mounting(*[FIT] * 6) if blow_off != "none" else Mounting(NONE),
            friction=Friction(breakaway=FIT, stribeck_speed=FIT, seal_area=FIT, **turns),
        )
        values, law = made_up_values(model, 3, 0.25), Structure(model, ("drag",))
        values = values.replace(drag=15.0)
        motion = parts((0.02, 0.6, 2), (0.02, 2.0, 6))
        seen = simulate(values, model, motion, sensitivities=model.names, options=ROUGH)
        trace = condition(log(motion, values, model, noise=1.0))
        found[f"{layout.name}_{blow_off}"] = {
            "limits": limits_of(model),
            "values": asdict(values),
            "seen": (seen.force, seen.pressures, seen.sensitivities),
            "static": quasi_static(model, values, (-0.2, -0.05, 0.0, 0.1), sensitivities=("f_f",)),
            "starts": [asdict(one) for one in model.start([trace], {})],
            "further": [
                asdict(one) for one in model.further_starts([trace], {"f_f": 20.0}, model.names)
            ],
            "read": model.valve_characteristics(values, [trace]),
            "said": physics_in([LawAt(Setting.of(3), model, values, (), ())], tuple(LAYOUTS)),
            "structures": [
                {"free": len(one.free), "needless": one.n_needless, "held": sum(one.held.values())}
                for one in (*moves(law).values(), *(other for *_, other in exchanges(law)))
            ],
            "weighed": before_load_cell(trace, moving_mass=0.5, lag=5e-3).force,
        }
    return found


@case
def batches() -> Any:
    """Copies, contradictions and temperatures of one setting; signs of a batch."""
    one, warm = SINE(), log(sine(7.3), temperature=41.0, name="warm.csv")
    other = replace(log(sine(7.3), reference_parameters(11)), name="other.csv")
    rounded = replace(FORCE(lambda y, _: np.round(y, 1))(one), name="copy.csv")
    elsewhere = replace(rounded, setting=Setting.of(11))
    slow = log(sine(amplitude=0.016), reference_parameters(11), name="slow.csv")
    hot = replace(other, temperature=41.0 + 0.0 * other.time)
    resting = [
        replace(log(parts((0.02, 1.5, 8), rest=0.8), setting=k), setting=Setting.of(k))
        for k in (3, 4)
    ]
    sets: dict[str, tuple[list[Recording], dict[str, Any]]] = {
        "copy": ([one, rounded], {}),
        "copy_elsewhere": ([one, elsewhere], {}),
        "contradiction": ([one, other], {}),
        "contradiction_warm": ([one, hot], {}),
        "averaged": ([one, other], {"rig": {"contradictions": "average"}}),
        "other_motion": ([one, slow], {}),
        "warm": ([one, warm], {}),
        "reversed": ([replace(k, force=-k.force) for k in resting], {}),
        "both_reversed": ([BOTH(k) for k in resting], {}),
    }
    found: dict[str, Any] = {}
    for name, (logs, how) in sets.items():
        try:
            found[name] = told(fit(logs, **how))
        except DamperfitError as error:
            found[name] = {
                "refused": error.problem,
                "why": [one.problem for one in getattr(error, "failures", ())],
            }
    return found


# A fault of every size from next to nothing to absurd: at which of them what is said begins.

QUIET = cache(lambda: log(sine(), noise=0.5, jitter=1e-6))
Sized = Callable[[np.ndarray, Recording, float], np.ndarray]


def blurred(y: np.ndarray, one: Recording, size: float) -> np.ndarray:
    n = int(size)
    return np.convolve(np.pad(y, n, "edge"), np.ones(2 * n + 1) / (2 * n + 1), "valid")


def stands(y: np.ndarray, one: Recording, size: float) -> np.ndarray:
    y[1240 : 1240 + int(size)] = y[1240]
    return y


def spiky(y: np.ndarray, one: Recording, size: float) -> np.ndarray:
    return (1.0 - size) * y + size * _spiked(y.copy(), one)


def diced(y: np.ndarray, one: Recording, size: float) -> np.ndarray:
    return y + size * np.random.default_rng(7).standard_normal(len(y))


# A log, the channels that a fault changes (of `rows` which are kept), the fault, its sizes.
LADDERS: dict[str, tuple[Callable[[], Recording], str, Sized, float, float]] = {
    "late": (LONG, "force", lambda y, one, s: late(s)(y, one), 1e-4, 0.03),
    "early": (LONG, "force", lambda y, one, s: late(-s)(y, one), 1e-4, 0.03),
    "filter": (LONG, "force", lambda y, one, s: low_pass(s)(y, one), 4.0, 200.0),
    "filters": (LONG, "force displacement", lambda y, one, s: low_pass(s)(y, one), 4.0, 200.0),
    "tare": (STEPS, "force", lambda y, _, s: y + s, 3.0, 600.0),
    "tare_reversed": (SINE, "force", lambda y, _, s: s - y, 3.0, 600.0),
    "clip": (QUIET, "force", lambda y, _, s: np.maximum(y, (1.0 - s) * y.min()), 3e-3, 0.9),
    "clip_x": (QUIET, "displacement", lambda y, _, s: np.minimum(y, y.max() - 0.03 * s), 3e-3, 0.9),
    "steps": (QUIET, "force", lambda y, _, s: s * np.round(y / s), 0.3, 300.0),
    "steps_x": (QUIET, "displacement", lambda y, _, s: s * np.round(y / s), 5e-6, 2e-3),
    "spikes": (SINE, "force", spiky, 0.02, 1.5),
    "spikes_x": (SINE, "displacement", spiky, 0.02, 1.5),
    "spikes_road": (ROAD, "force", spiky, 0.02, 1.5),
    "in_a_row": (SINE, "force", lambda y, _, s: y + 400.0 * (np.arange(len(y)) % 900 < s), 1, 12),
    "stuck": (SINE, "force", stands, 3, 90),
    "stuck_x": (SINE, "displacement", stands, 3, 90),
    "frozen": (SINE, "force displacement", stands, 3, 90),
    "zeros": (SINE, "force", lambda y, _, s: np.where(np.arange(len(y)) // s == 50, 0.0, y), 1, 40),
    "held": (FINE, "force", lambda y, _, s: y[np.arange(len(y)) // int(s) * int(s)], 2, 60),
    "mean": (FINE, "force", blurred, 1, 60),
    "corners": (TRIANGLE, "displacement", blurred, 1, 60),
    "drift": (LONG, "force", lambda y, one, s: y + s * ramp(one), 1.0, 200.0),
    "fades": (LONG, "force", lambda y, one, s: y * (1.0 - s * ramp(one)), 2e-3, 0.4),
    "stroke": (LONG, "displacement", lambda y, one, s: y * (1.0 + s * ramp(one)), 2e-3, 0.4),
    "middle": (LONG, "displacement", lambda y, one, s: y + s * ramp(one), 1e-4, 0.03),
    "blow": (LONG, "force", lambda y, one, s: y + s * (np.abs(one.time - 4.0) < 0.03), 3.0, 900.0),
    "hum": (LONG, "force", lambda y, one, s: y + s * np.sin(314.0 * one.time), 0.3, 100.0),
    "line": (LONG, "force", lambda y, one, s: y + s * np.sin(57.2 * one.time), 0.3, 100.0),
    "noise": (LONG, "force", diced, 1.0, 300.0),
    "noise_x": (LONG, "displacement", diced, 3e-6, 3e-3),
    "warms": (LONG, "temperature", lambda y, one, s: y + s * ramp(one), 0.3, 60.0),
    "warm": (LONG, "temperature", lambda y, _, s: y + s, 0.3, 60.0),
    "gap": (LONG, "rows", lambda n, _, s: n[(n < 900) | (n > 900 + s)], 1, 900),
    "gaps": (SINE, "rows", lambda n, _, s: n[n % int(s) != 1], 2, 300),
    "ends": (LONG, "rows", lambda n, _, s: n[: int(s)], 300, 4000),
    "begins": (STEPS, "rows", lambda n, _, s: n[int(s) :], 10, 3500),
    "second": (TWICE, "rows", lambda n, _, s: n[: int(s)], 2000, 4900),
    "rate": (FINE, "rows", lambda n, _, s: n[:: int(s)], 2, 90),
    "jitter": (SINE, "time", lambda t, _, s: t + s * np.sin(7.3 * np.arange(len(t))), 1e-5, 2e-3),
    "clock": (SINE, "time", lambda t, _, s: t + s * t**2, 1e-4, 0.05),
    "unsteady": (LONG, "displacement", lambda y, t, s: y + s * y * np.sin(5.0 * t.time), 3e-3, 0.4),
    "crank": (SINE, "displacement", lambda y, _, s: y + s * y**2, 0.03, 8.0),
    "other": (TWICE, "force", lambda y, one, s: y + s * y * (one.time > 5.0), 3e-3, 0.9),
    "lag": (SINE, "velocity", lambda _, one, s: late(s)(passed(one), one), 3e-4, 0.1),
    "speed": (SINE, "velocity", lambda _, one, s: s * passed(one), 0.3, 3.0),
    "force": (SINE, "force", lambda y, _, s: s * y, 1e-3, 30.0),
    "size": (SINE, "displacement", lambda y, _, s: s * y, 5e-3, 30.0),
    "centre": (SINE, "displacement", lambda y, _, s: y + s, 1e-3, 0.3),
}  # fmt: skip
# Motions of which one measure grows.
MOTIONS: dict[str, tuple[Callable[[float], Motion], float, float]] = {
    "cycles": (sine, 0.8, 12.0),
    "faster": (lambda s: parts((0.05 / s, s, 8)), 0.4, 40.0),
    "other_period": (lambda s: parts((0.03, 1, 6), (0.03, 1 + s, 1), (0.03, 2, 6)), 3e-3, 0.2),
    "other_stroke": (lambda s: parts((0.03, 1, 6), (0.03 + s, 1, 1), (0.03, 2, 6)), 1e-4, 6e-3),
    "near": (lambda s: parts((0.02, 1.5, 5), (0.02, 1.5 + s, 7)), 3e-3, 1.0),
    "pause": (lambda s: parts((0.02, 1.5, 6), (1e-9, 1.0 / s, 1), (0.02, 1.5, 6)), 0.02, 2.0),
    "slow_end": (lambda s: parts((0.02, 2, 8), (s, 1, 2.3)), 2e-4, 0.02),
    "short": (lambda s: parts((0.02, 2, 8), (0.02, 6, s)), 0.6, 9.0),
    "middle_of_road": (lambda s: road(middle=s), 1e-3, 0.04),
    "highest": (lambda s: road(highest=s), 0.8, 30.0),
    "rounded": (lambda s: triangle(0.2, width=int(s)), 1, 90),
    "slower": (triangle, 0.02, 0.9),
}


def laddered(*rungs: int) -> Any:
    options, n = load_configuration().conditioning, len(rungs)
    found: dict[str, Any] = {}
    motions = ((name, (make, "", None, *ends)) for name, (make, *ends) in MOTIONS.items())
    for name, (make, channels, change, low, high) in itertools.chain(LADDERS.items(), motions):
        ladder: dict[str, list[Any]] = defaultdict(lambda: [math.nan] * n)
        said: dict[str, list[str]] = defaultdict(lambda: ["-"] * n)
        text: dict[str, list[str]] = defaultdict(list)
        for k, size in enumerate(np.geomspace(low, high, 9)[[*rungs]]):
            one = make() if channels else log(make(size), noise=0.5)
            if channels == "rows":
                one = rows(lambda n: change(n, one, size))(one)  # noqa: B023 - called at once
            else:
                was = {channel: getattr(one, channel) for channel in channels.split()}
                now = {
                    c: change(None if y is None else y.copy(), one, size) for c, y in was.items()
                }
                one = replace(one, **now)
            try:
                trace = condition(one, options)
            except DamperfitError as error:
                said[error.problem.code][k] = "!"
                text[error.problem.code].append(str(error.problem))
                continue
            for finding in trace.findings:
                said[finding.code][k] = finding.severity[0]
                ladder[finding.code][k] = finding.values.get("value") or 0.0
                text[finding.code].append(str(finding))
            seen = {"n": trace.n_cycles, "f": trace.frequency, "a": trace.amplitude}
            beside = transients(trace.whole or trace)
            seen |= {"t": sum(one.n_samples for one in beside.segments) if beside else 0}
            seen |= {"sd": trace.fastest.noise, "F": np.ptp(trace.force[trace.compared])}
            for what, number in seen.items():
                ladder[what][k] = number
        at = {one: "".join(row) for one, row in said.items()}
        found[name] = {"at": at, "text": text, **ladder}
    return found


CASES["ladders"] = partial(laddered, 2, 4, 6)
CASES["ladders_between"] = partial(laddered, 0, 1, 3, 5, 7, 8)  # at night


def written_by(folder: Path, *words: str) -> dict[str, Any]:
    """Return what a command ends with, its JSON, and its tables by column."""
    with redirect_stdout(StringIO()) as said, redirect_stderr(StringIO()):
        code = damperfit_command([*words, "--json", "--out", str(folder)])
    tables = {path.stem: pd.read_csv(path) for path in sorted(folder.rglob("*.csv"))}
    columns = {name: table.to_dict("list") for name, table in tables.items()}
    return {"code": code, "document": json.loads(said.getvalue()), **columns}


@case
def trends() -> Any:
    """Courses over the settings, sound and with settings that are off, swapped, few or unknown."""
    from tests import fakes
    from tests.adjustment.false_alarms import CLICKS, SMOOTH, SUBSETS, reference_trends, trend_of

    ten, clicks = SUBSETS["all 20"][::2], CLICKS[::2]
    rising, zigzag = 1e4 * np.exp(0.05 * clicks), (-1.0) ** np.arange(10)
    found: dict[str, Any] = {name: reference_trends(SUBSETS[name], seed=3) for name in SUBSETS}
    for (shape, values), off in zip(SMOOTH.items(), itertools.cycle([(4,), (0, 9), (2, 3)])):
        sound, course = values[::2], values[::2].copy()
        course[list(off)] *= 1.25
        found[shape] = [trend_of(y, ten, scatter=3e-3, seed=5) for y in (sound, course)]
    swings = np.geomspace(3e-3, 0.3, 7)
    unlike = np.where(clicks % 4 == 2, 0.1, 1e-3 * (1.0 + clicks))
    how: Any = {"n": 5e8 + 1e7 * clicks**2, "constant": 0.0 * clicks + 5e8}
    found |= {
        "few": [trend_of(how["n"][:n], ten[:n], name="k_e", seed=3) for n in range(3, 9)],
        "even": [trend_of(how["constant"][:n], ten[:n]) for n in range(3, 9)],
        "unlike_errors": [  # a setting that is off, of those known well or badly
            trend_of(rising * (1.0 + off * (clicks == at)), ten, error=unlike, scatter=s, seed=4)
            for at, off in ((2, 0.5), (4, 0.1), (6, 0.1), (8, 0.2), (12, 0.15))
            for s in (0.0, 0.01)
        ],
        "scatter": [trend_of(rising, ten, error=3e-4, scatter=s, seed=2) for s in swings],
        "saw": [trend_of(rising * np.exp(s * zigzag), ten, error=3e-4) for s in swings],
        "saw_k_e": [
            trend_of(how["n"] * np.exp(s * zigzag), ten, name="k_e", error=e)
            for e in (1e-3, 1e-2)
            for s in swings
        ],
        "pair": [
            trend_of(
                1e4 * np.exp(s * (CLICKS + (CLICKS == 9) - (CLICKS == 10))), CLICKS, error=3e-4
            )
            for s in swings[:4]
        ],
        "falls": [trend_of(1e8 / np.roll(rising, k), ten, error=3e-4) for k in (0, 1)],
        "turns": [trend_of(1e4 * np.exp(s * (clicks - 8) ** 2), ten) for s in (3e-3, -3e-3)],
        "unknown": [trend_of(how["constant"][:8], ten[:8], error=s, name="k_e") for s in swings],
        "gaps": [
            trend_of(rising[[0, 1, 2, 8, 9]], (1, 2, 3, last - 1, last)) for last in (10, 80, 10**6)
        ],
        "swapped": [
            trend_of(np.exp(0.3 * np.roll(np.log(rising), k)), ten, error=3e-4) for k in (1, 2, 7)
        ],
    }
    campaign, signs = fakes.campaign(fakes.fit(1)), {True: "+", False: "-", None: "?"}
    for name, some in found.items():
        courses = tuple(some.values()) if isinstance(some, dict) else tuple(some)
        seen = run_checks(Subject(campaign, Assessment(), Adjustment(trends=courses)))
        said = [f"{one.name} {one.reason}" for one in seen]
        found[name] = [some, "".join(signs[one.passed] for one in seen), said]
    return found


@case
def fleet() -> Any:
    """Parts of thirty dampers: bands, who is far off, a tolerance, Cp and Cpk, shifts by date."""
    random, found = np.random.default_rng(2), {}
    with TemporaryDirectory() as place:
        for k in range(30):
            day, rows = 1 + 7 * k % 30, []
            for setting, force in (("2", 900.0), ("10", 1500.0)):
                size = 1.0 + 0.01 * random.standard_normal() + 0.03 * (day > 22) + 0.3 * (k == 4)
                row = {"damper": f"D{k}", "setting": setting, "error": None, "error_kind": None}
                row |= {"date": f"2026-03-{day + (setting == '2'):02d}"}
                row |= {"grade": "good" if k % 9 or setting == "2" else "poor"}
                row |= {"mse_percent": 0.1 + 0.02 * k, "r_m1": 2e4 * size, "r_m1_se": 90.0 + k}
                for stroke, v in (("rebound", 130), ("rebound", 260), ("bump", -260)):
                    row[f"force_{stroke}_{abs(v)}_mm_per_s_N"] = v * size * force / 300.0
                    row[f"force_{stroke}_{abs(v)}_mm_per_s_se_N"] = 3.0 + 0.1 * k
                rows.append(row)
            if k % 11 == 5:
                rows.append(
                    {"damper": f"D{k}", "error": f"{k}.csv: none", "error_kind": "LogError"}
                )
            names = {name: None for row in rows for name in row}
            table = pa.table({name: [row.get(name) for row in rows] for name in names})
            write_part(part_path(Path(place), f"D{k}", "k"), table, {"logs": [str(k)]})
        found["5%"] = written_by(Path(place), "fleet", "--report", "--tolerance", "5%")
        found["1%,30N"] = written_by(Path(place), "fleet", "--tolerance", "1%,30N")["document"]
    return found


@case
def searched() -> Any:
    """Structures of one log, of friction that is larger at rest: each that is tried."""
    at_rest = Friction(breakaway=FIT, stribeck_speed=FIT)
    damper = TwinTube(gas_pressure=5e5, mounting=Mounting(NONE))
    one = valve_log(replace(damper, friction=at_rest), 3)
    frame = pd.DataFrame(
        {"time_s": one.time, "displacement_m": one.displacement, "force_N": one.force}
    )
    bare = TwinTube(gas_pressure=5e5)
    run = damperfit.identify({"3": frame}, model="auto", damper=bare, jobs=1)
    found = run.record["law_choice"]
    # The criterion beside its own noise, which is none of its size.
    laws = {
        f"{k}_{law['change']}": {**law, "bic": 20.0 + (law["bic"] or 0.0), "reason": ""}
        for k, law in enumerate(found["laws"])
    }
    kept = {name: found[name] for name in ("chosen", "settings", "undecided", "sentences")}
    return {**kept, "laws": laws, "run": told(run)}


def written() -> dict[str, dict[str, str]]:
    """Return the stored lines, by case and place."""
    found: dict[str, dict[str, str]] = {}
    for line in SNAPSHOT.read_text(encoding="utf-8").splitlines() if SNAPSHOT.exists() else ():
        if line.startswith("["):
            found[line[1:-1]] = now = {}
        elif line:
            place, _, values = line.partition(": ")
            now[place] = values
    return found


def check(name: str) -> None:
    """Say which numbers of a case have moved."""
    was, now = written()[name], lines_of(CASES[name]())
    gone = [f"{place}: gone, was {was[place]}" for place in was if place not in now]
    new = [f"{place}: new, {now[place]}" for place in now if place not in was]
    both = [moved(f"{name} {place}", was[place], now[place]) for place in was if place in now]
    told = [line for line in (*both, *gone, *new) if line]
    assert not told, (
        f"{len(told)} lines of {name} moved; python -m tests.test_numbers {name}:\n"
        + "\n".join(told[:60])
    )


@pytest.mark.parametrize("name", [name for name in CASES if not name.startswith("model ")])
def test_no_number_has_moved(name: str) -> None:
    check(name)


def main() -> None:
    """Write the numbers of some cases, or of all."""
    asked = sys.argv[1:] or list(CASES)
    known = written()
    for name in asked:
        was, now = known.get(name, {}), lines_of(CASES[name]())
        same = {k: was[k] for k in now if k in was and not moved(f"{name} {k}", was[k], now[k])}
        known[name] = now | same
    text = "".join(
        f"[{name}]\n"
        + "".join(f"{place}: {values}\n" for place, values in known[name].items())
        + "\n"
        for name in CASES
        if name in known
    )
    SNAPSHOT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
