"""Logs of the public sets that `bench_numbers` identifies, each made once on a machine.

They stay in the folder of temporary files, under a name that follows the sources that make them:
two minutes of the processor in all. A folder holds logs, configurations and truth.json: the
parameters that are known, by setting.
"""

import csv
import hashlib
import json
import math
import os
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np

from damperfit.damper.purdy.parameters import (
    PURDY_DAMPER,
    incompressible_force,
    reference_parameters,
)
from damperfit.simulation import simulate
from tests.identification import accuracy_of_motions, convergence
from tests.laws.valve_logs import moved
from tests.oracles import motions
from tests.rig_like import campaign, dampers, other_laws, rig, test_triangles, valve_bars
from tests.rig_like.bars import SHARED, adjusted
from tests.rig_like.rig import Body, Channels, Logged, Valve, logged

ROOT = Path(__file__).parents[1]
SOURCES = (accuracy_of_motions, campaign, convergence, motions, dampers, other_laws, rig,
           test_triangles, valve_bars)  # fmt: skip
PAPER = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
Truth = dict[str, dict[str, float]]  # by setting as parameters.csv names it
LOCK = threading.Lock()


def _write_json(path: Path, value: object) -> None:
    path.write_text(json.dumps(value, indent=1), encoding="utf-8")


def _write_log(path: Path, log: Logged, setting: str) -> None:
    path.write_text(dampers.text_of(log, setting), encoding="utf-8")


def _samples(folder: Path) -> None:
    """Copy the sample runs and their truth."""
    for log in sorted((ROOT / "sample_runs").glob("setting_*.csv")):
        (folder / log.name).write_bytes(log.read_bytes())
    with (ROOT / "sample_runs/truth.csv").open(encoding="utf-8", newline="") as file:
        truth = {
            row["setting"]: {name: float(row[name]) for name in PAPER}
            for row in csv.DictReader(file)
        }
    _write_json(folder / "truth.json", truth)


def _of_motion(motion: str) -> Callable[[Path], None]:
    """Make three settings of the paper's damper, driven by a motion, with 4 N and 3 um of noise."""

    def made(folder: Path) -> None:
        truth: Truth = {}
        for setting in (5, 10, 15):
            drive, values = motions.MOTIONS[motion](), reference_parameters(setting)
            n = round(drive.duration * accuracy_of_motions.RATE)
            x, (force,) = accuracy_of_motions.made(drive, values, PURDY_DAMPER, n)
            _write_log(folder / f"setting_{setting:02}.csv", _noisy(x, force, 4.0, setting),
                       str(setting))  # fmt: skip
            truth[str(setting)] = {name: float(getattr(values, name)) for name in PAPER}
        (folder / "damper.toml").write_text('[rig]\ncentre = "0mm"\n', encoding="utf-8")
        _write_json(folder / "truth.json", truth)

    return made


def _noisy(x: np.ndarray, force: np.ndarray, noise: float, seed: int) -> Logged:
    """A log at 1 kHz, with force noise in N and 3 um."""
    chance = np.random.default_rng([seed, 11])
    n = len(x)
    return Logged(
        np.arange(n) / 1000.0,
        x + 3e-6 * chance.standard_normal(n),
        force + noise * chance.standard_normal(n),
        np.zeros((3, 0)),
    )


def _rigid(folder: Path) -> None:
    """Make three settings whose oil cannot be compressed; K_e has no truth."""
    truth: Truth = {}
    for setting in (1, 10, 20):
        angle = 2.0 * math.pi * 1.5 * np.arange(10_000) / 1000.0 + 0.1 * setting
        x, v = 0.032 * np.sin(angle), 0.032 * 2.0 * math.pi * 1.5 * np.cos(angle)
        values = reference_parameters(setting)
        force = incompressible_force(values, PURDY_DAMPER, x, v)
        log = _noisy(x, force, 2.0, setting)
        _write_log(folder / f"setting_{setting:02}.csv", log, str(setting))
        truth[str(setting)] = {n: float(getattr(values, n)) for n in ("r_m1", "r_m2", "f_f")}
    _write_json(folder / "truth.json", truth)


def _declared(kind: str) -> Callable[[Path], None]:
    """Make four dampers of a layout in the library's laws, each a setting; with noise."""

    def made(folder: Path) -> None:
        truth: Truth = {}
        for seed in range(4):
            model, values = convergence.made_up(kind, seed)
            motion = moved(convergence.SPEEDS, rate=1000.0)
            force = simulate(values, model, motion, options=convergence.SOLVER).force
            log = _noisy(motion.displacement, force, 4.0, seed)
            _write_log(folder / f"setting_{seed + 1:02}.csv", log, str(seed + 1))
            truth[str(seed + 1)] = {n: float(getattr(values, n)) for n in model.names}
        lines = [f'model = "{kind}"'] + [
            f"{name} = {getattr(model, name)!r}"
            for name in ("rod_diameter", "piston_diameter", "chamber_1_length", "oil_density",
                         "chamber_2_length", "gas_pressure", "gas_volume", "gas_exponent")
        ]  # fmt: skip
        (folder / "damper.toml").write_text("[damper]\n" + "\n".join(lines), encoding="utf-8")
        _write_json(folder / "truth.json", truth)

    return made


def _numbers_of(body: Body, channels: Channels) -> dict[str, float]:
    """The truth in the library's names; what the damper has not is left out."""
    values = {
        "f_f": body.friction, "k_s": body.stiffness, "play": body.play, "lag": channels.lag,
        # The cell drifts by so much over the log: its offset is the mean one.
        "f_0": channels.offset + 0.5 * channels.drift, "k_e": body.bulk, "drag": body.drag,
        "return_slope": body.check.slope,
    }  # fmt: skip
    for stroke, valve in (("rebound", body.rebound), ("compression", body.bump)):
        values |= _numbers_of_valve(stroke, valve)
    return {name: value for name, value in values.items() if value}


def _numbers_of_valve(stroke: str, valve: Valve) -> dict[str, float]:
    if valve.cost:  # a law that the library has not
        return {}
    return {f"{stroke}_{name}": getattr(valve, name) for name in ("bleed", "opening", "slope")}


def _valves(place: int) -> Callable[[Path], None]:
    """Make a damper of `rig_like.valve_bars`: four settings, other speeds and strokes."""

    def made(folder: Path) -> None:
        valve_bars.written(folder, place, 1)
        bodies, channels = valve_bars.drawn(place, 1)
        _with_adjusters(folder, {f"L{low} H{high}": body for (low, high), body in bodies.items()},
                        channels)  # fmt: skip

    return made


def _other(seed: int) -> Callable[[Path], None]:
    """Make a damper of `rig_like.other_laws`, whose friction, valves and oil have no truth here."""

    def made(folder: Path) -> None:
        other_laws.written(folder, seed)
        _with_adjusters(folder, {}, Channels())

    return made


def _with_adjusters(folder: Path, bodies: dict[str, Body], channels: Channels) -> None:
    text = (folder / "damper.toml").read_text(encoding="utf-8")
    (folder / "adjusted.toml").write_text(adjusted(text), encoding="utf-8")
    truth = {setting: _numbers_of(body, channels) for setting, body in bodies.items()}
    _write_json(folder / "truth.json", truth)


def _adjustable(folder: Path) -> None:
    dampers.written_adjustable(folder)
    text = dampers.ADJUSTABLE_TOML.format(model="through_flow") + SHARED
    (folder / "damper.toml").write_text(text, encoding="utf-8")


def _second_rig(folder: Path) -> None:
    dampers.written_second_rig(folder)
    text = dampers.RIG_TOML.format(model="twin_tube") + '[damper.mounting]\nplay = "fit"\n'
    (folder / "damper.toml").write_text(text, encoding="utf-8")


def _triangles(folder: Path) -> None:
    """Make triangles of four speeds, one below the knee, on valves of `test_triangles`."""
    body, channels = test_triangles.BODY, Channels(rate=1000.0, noise=3.0, jitter=6e-6)
    for k, motion in enumerate((*test_triangles.ABOVE, test_triangles.BELOW)):
        _write_log(folder / f"setting_02_{k}.csv", logged(body, motion, channels, 1000 + k), "2")
    known = {name: getattr(body, name) for name in type(body).__dataclass_fields__}
    text = valve_bars.TOML.format(**known).replace("[damper]", '[damper]\nmodel = "through_flow"')
    (folder / "damper.toml").write_text(text, encoding="utf-8")
    _write_json(folder / "truth.json", {"2": _numbers_of(body, channels)})


def _campaign(mounting: str) -> Callable[[Path], None]:
    """Make the campaign of `rig_like.campaign`; one value of what is the damper's or the rig's."""

    def made(folder: Path) -> None:
        campaign.written(folder, mounting)
        stiffness, rubber = campaign.MOUNTINGS[mounting]
        body = campaign.body_of(campaign.TESTS[0], mounting)
        rod, bore = body.areas
        # A preload of the checks acts as friction does: without it f_f is found 5.3 N lower.
        friction = body.friction + body.check.opening * (bore - 0.5 * rod)
        known = {"f_f": friction, "seal_area": body.seal, "lag": 0.008, "k_s": stiffness}
        known |= {"rubber": rubber, "rubber_bend": body.rubber_bend} if rubber else {}
        _write_json(folder / "truth.json", {f"L{t.low} H{t.high}": known for t in campaign.TESTS})

    return made


def _rheological(folder: Path) -> None:
    for place, current in enumerate((0.0, 0.5, 1.0, 1.5)):
        for frequency in (1.0, 2.5):
            log = dampers.magneto_rheological(current, frequency, place)
            _write_log(folder / f"mr_{current:g}A_{frequency:g}Hz.csv", log, str(place + 1))


MAKERS: dict[str, Callable[[Path], None]] = {
    "samples": _samples,
    **{name: _of_motion(name) for name in ("steps", "sweep", "road", "two triangles")},
    "rigid oil": _rigid,
    **{f"declared {k}": _declared(k) for k in ("through_flow", "twin_tube", "monotube")},
    "triangles": _triangles,
    **{f"valves {place}": _valves(place) for place in range(3)},
    **{f"other laws {seed}": _other(seed) for seed in (0, 2, 3)},
    "adjustable": _adjustable,
    "second rig": _second_rig,
    "MR": _rheological,
    **{f"campaign {mounting}": _campaign(mounting) for mounting in campaign.MOUNTINGS},
}


def folder_of(name: str, make: Callable[[Path], None] | None = None) -> Path:
    """Return the folder of a set's logs, made where it is not there."""
    sources = [Path(one.__file__ or "") for one in SOURCES]
    sources += [Path(__file__), ROOT / "tests/rig_like/rig.c"]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:12]
    kept = Path(tempfile.gettempdir()) / f"damperfit_bench_{os.getuid()}_{digest}"
    kept.mkdir(exist_ok=True)
    folder = kept / name.replace(" ", "_")
    with LOCK:
        if not folder.exists():
            with tempfile.TemporaryDirectory(dir=kept) as temporary:
                (new := Path(temporary) / "logs").mkdir()
                (make or MAKERS[name])(new)
                new.rename(folder)
    return folder


def copied(source: Path) -> Path:
    """Return a copy of a user's own folder of logs, with adjusters declared beside."""

    def make(folder: Path) -> None:
        for path in source.iterdir():
            if path.is_file() and path.name != "truth.json":
                (folder / path.name).write_bytes(path.read_bytes())
        _with_adjusters(folder, {}, Channels())

    return folder_of(str(source.resolve()).replace("/", "_"), make)
