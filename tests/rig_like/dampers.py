"""Made-up dampers like those that were measured on rigs, in laws that the library has not.

    python -m tests.rig_like.dampers FOLDER        # writes their logs, to be looked at by hand

`adjustable`: two adjusters, 12 settings at 1 Hz and +-25 mm and two at 0.2 Hz, from a crank with a
second harmonic; shims by a power of the flow beyond their preload, needles with a laminar part,
preloaded return checks, friction of a bristle with a breakaway and a seal under pressure, oil with
free gas, a force channel 10 ms late, warming oil, a cell zeroed before mounting that drifts.
`second_rig`: a twin tube at 13 speeds from 0.2 to 10 Hz with play at the joints.
`magneto_rheological`: Bouc-Wen with a yield that sets in before it slides; no valve at all.
"""

import argparse
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.rig_like.rig import FINE, Body, Channels, Logged, Valve, crank, logged

LOWS, HIGHS = (6, 10, 14, 18), (1, 2, 3)
SETTINGS = tuple((low, high) for low in LOWS for high in HIGHS)
SLOW = ((14, 1), (18, 3))
# By click of the needle, S in s sqrt(N)/(m kg); by turn of the preload, Pa. No straight lines.
NEEDLE = {6: 1.7e4, 10: 3.1e4, 14: 6.4e4, 18: 1.6e5}
PRELOAD = {1: 2.3e5, 2: 5.2e5, 3: 8.9e5}
ADJUSTABLE_TOML = """[damper]
model = "{model}"
rod_diameter = "8.9mm"
piston_diameter = "25mm"
chamber_1_length = "60mm"
chamber_2_length = "60mm"
gas_pressure = "4.46bar"
gas_volume = "20cm3"
gas_exponent = 1.3
oil_density = "850kg/m3"
"""
RIG_TOML = """[damper]
model = "{model}"
rod_diameter = "12.4mm"
piston_diameter = "30mm"
chamber_1_length = "90mm"
chamber_2_length = "90mm"
gas_pressure = "5bar"
gas_volume = "35cm3"
gas_exponent = 1.3
oil_density = "850kg/m3"
"""


def adjustable(low: int, high: int, *, warmth: float = 0.0) -> Body:
    """The damper at a setting; warmth in K above the first log's."""
    thin = math.exp(-0.006 * warmth)  # the laminar parts: viscosity
    needle, preload = NEEDLE[low], PRELOAD[high]
    return Body(
        "through_flow",
        # Preload stiffens a stack a little.
        Valve(bleed=needle, leak=0.05 * needle * 350 * thin, opening=preload,
              cost=8.0e6 * (1 + 0.03 * high), power=1.3),
        Valve(bleed=0.8 * needle, leak=0.04 * needle * 350 * thin, opening=0.85 * preload,
              cost=6.5e6 * (1 + 0.03 * high), power=1.25),
        check=Valve(opening=1.2e4, slope=2.0e5),
        bulk=1.1e9, free_gas=8e-4, stiffness=4.5e5, friction=17.0, breakaway=6.0, stribeck=0.012,
        seal=4e-6, presliding=1.2e-5, mass=0.25, drag=12.0 * thin,
    )  # fmt: skip


def logged_adjustable(low: int, high: int, frequency: float, place: int) -> Logged:
    """The log of a setting, as the place-th of the day."""
    chance = np.random.default_rng([place, 5])
    warmth = 0.4 * place + chance.uniform(0.0, 1.0)
    cycles = 9.0 if frequency > 0.5 else 4.0
    motion = crank(frequency, 0.025, cycles + chance.uniform(0.2, 0.8), second=0.03)
    channels = Channels(
        rate=500.0, lag=0.010, noise=1.5, jitter=4e-6, hum=1.5e-5, step=0.8, click=1e-5,
        drift=1.5, offset=chance.normal(22.0, 4.0),
    )  # fmt: skip
    return logged(adjustable(low, high, warmth=warmth), motion, channels, place)


def second_rig() -> Body:
    """A twin tube with play."""
    return Body(
        "twin_tube",
        Valve(bleed=4.2e4, leak=8e5, opening=9e5, cost=1.5e7, power=1.2),
        Valve(bleed=9e4, leak=1.5e6, opening=1.1e6, cost=3.2e7, power=1.2),
        check=Valve(opening=8e3, slope=2.4e5),
        rod=12.4e-3, piston=30e-3, length=90e-3, gas_pressure=5e5, gas_volume=3.5e-5,
        bulk=1.2e9, free_gas=5e-4, stiffness=6e5, play=6.7e-4, friction=24.0, breakaway=8.0,
        stribeck=0.01, seal=5e-6, presliding=1e-5, mass=0.4, drag=15.0,
    )  # fmt: skip


RIG_TESTS = tuple(
    (f, min(0.025, 0.34 / (2 * math.pi * f)))
    for f in (0.2, 0.3, 0.5, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0)
)


def magneto_rheological(current: float, frequency: float, seed: int) -> Logged:
    """Bouc-Wen on a viscous damper with a gas spring: a gel that bends 0.8 mm before it yields."""
    x, v = crank(frequency, 0.012, 8.3)
    z, bend = 0.0, np.empty(len(x))
    for k, speed in enumerate(v.tolist()):
        bend[k] = z
        z += FINE * (speed - abs(speed) * z / 8e-4)
    force = (60.0 + 420.0 * current) * bend / 8e-4 + (450.0 + 900.0 * current) * v + 1200.0 * x
    at = np.round(np.arange(0.0, (len(x) - 1) * FINE, 2e-3) / FINE).astype(int)
    chance = np.random.default_rng([seed, 3])
    return Logged(
        np.arange(len(at)) * 2e-3,
        x[at] + chance.normal(0.0, 5e-6, len(at)),
        force[at] + 8.0 + chance.normal(0.0, 3.0, len(at)),
        np.zeros((3, 0)),
    )


def text_of(log: Logged, setting: str) -> str:
    """The file."""
    rows = zip(log.time, 1e3 * log.displacement, log.force, strict=True)
    lines = "\n".join(f"{t:.6f},{x:.4f},{f:.2f}" for t, x, f in rows)
    return f"# setting: {setting}\ntime_s,displacement_mm,force_N\n{lines}\n"


def written_adjustable(folder: Path) -> Path:
    """All 14 logs of the adjustable damper, slow ones with `_slow` in their names."""
    folder.mkdir(parents=True, exist_ok=True)
    jobs = [(one, 1.0, "") for one in SETTINGS] + [(one, 0.2, "_slow") for one in SLOW]
    for place, ((low, high), frequency, word) in enumerate(jobs):
        log = logged_adjustable(low, high, frequency, place)
        name = f"damper_L{low:02}_H{high}{word}.csv"
        (folder / name).write_text(text_of(log, f"L{low} H{high}"), encoding="utf-8")
    return folder


def written_second_rig(folder: Path) -> Path:
    """The 13 tests of the second rig."""
    folder.mkdir(parents=True, exist_ok=True)
    for place, log in enumerate(_of_second_rig()):
        frequency = RIG_TESTS[place][0]
        (folder / f"rig_{place:02}_{frequency:g}Hz.csv").write_text(
            text_of(log, "1"), encoding="utf-8"
        )
    return folder


def _of_second_rig() -> Iterator[Logged]:
    for place, (frequency, amplitude) in enumerate(RIG_TESTS):
        channels = Channels(
            rate=1024.0, noise=4.0, jitter=4e-6, step=1.2, click=5e-6, drift=2.0, offset=-12.0
        )
        cycles = max(4.3, min(12.3, 4.0 * frequency + 0.3))
        motion = crank(frequency, amplitude, cycles, up=0.8, down=0.8)
        body = replace(second_rig(), drag=15.0 * math.exp(-0.01 * place))
        yield logged(body, motion, channels, 100 + place)


def main() -> None:
    """Write everything."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    written_adjustable(folder / "adjustable")
    written_second_rig(folder / "second_rig")
    rheological = folder / "magneto_rheological"
    rheological.mkdir(exist_ok=True)
    for place, current in enumerate((0.0, 0.5, 1.0, 1.5)):
        for frequency in (1.0, 2.5):
            log = magneto_rheological(current, frequency, place)
            name = f"mr_{current:g}A_{frequency:g}Hz.csv"
            (rheological / name).write_text(text_of(log, str(place + 1)), encoding="utf-8")


if __name__ == "__main__":
    main()
