"""Logs of one damper as a workshop tests it: many valvings, pressures and speeds, all in one go.

    python -m tests.rig_like.campaign FOLDER      # writes the logs of both mountings, for the eye

Five valvings of `dampers.adjustable`, whose laws are none of the library's, at 50 to 150 psi and
0.2, 1.05 and 1.26 Hz from a slider-crank, one log each, a cell zeroed anew before each, with the
noise of a rig of 300 Hz. Two logs are of a damper that previous cycles have warmed. One slow log
is held out. The mounting is stiff, or rubber that holds 60 N whichever way it was bent last.
"""

import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.rig_like.dampers import adjustable, text_of
from tests.rig_like.rig import AMBIENT, Body, Channels, crank, logged

PSI = 6894.757
MOUNTINGS = {"stiff": (4.5e5, 0.0), "rubber": (1.6e5, 60.0)}  # N/m, N
TOML = """[damper]
rod_diameter = "8.9mm"
piston_diameter = "25mm"
chamber_1_length = "60mm"
chamber_2_length = "60mm"
gas_volume = "20cm3"
gas_exponent = 1.3
oil_density = "850kg/m3"
"""


class Test(NamedTuple):
    """One log: clicks, Hz, psi of the gauge, K above the first log, whether it is held out."""

    low: int
    high: int
    frequency: float
    psi: float
    warmth: float = 0.0
    is_held_out: bool = False


TESTS = (
    Test(18, 2, 1.05, 50.0),
    Test(18, 3, 1.05, 50.0),
    Test(18, 3, 1.05, 50.0, 33.0),
    Test(14, 1, 1.05, 50.0),
    Test(14, 1, 1.26, 100.0),
    Test(14, 1, 1.05, 150.0),
    Test(14, 1, 0.2, 50.0),
    Test(14, 2, 1.05, 50.0),
    Test(6, 2, 1.05, 50.0, 26.0),
    Test(18, 3, 0.2, 50.0, is_held_out=True),
)


def body_of(test: Test, mounting: str) -> Body:
    """The damper and its mounting in a test."""
    stiffness, rubber = MOUNTINGS[mounting]
    return replace(
        adjustable(test.low, test.high, warmth=test.warmth),
        gas_pressure=test.psi * PSI + AMBIENT, stiffness=stiffness, rubber=rubber,
    )  # fmt: skip


def written(folder: Path, mounting: str) -> Path:
    """All logs, and what the damper's owner knows of it."""
    folder.mkdir(parents=True, exist_ok=True)
    for place, test in enumerate(TESTS):
        chance = np.random.default_rng([place, 34])
        cycles = (9.0 if test.frequency > 0.5 else 4.0) + chance.uniform(0.2, 0.8)
        channels = Channels(
            rate=300.0, lag=0.008, noise=1.5, jitter=4e-6, hum=1.5e-5, step=0.8, click=1e-5,
            drift=1.0, offset=chance.normal(15.0, 4.0),
        )  # fmt: skip
        motion = crank(test.frequency, 0.0187, cycles, second=0.03)
        log = logged(body_of(test, mounting), motion, channels, 340 + place)
        facts = f"L{test.low} H{test.high}\n# gas_pressure: {test.psi:g}psig"
        word = "_unseen" if test.is_held_out else ""
        name = f"t{place + 1:02}_L{test.low:02}_H{test.high}{word}.csv"
        (folder / name).write_text(text_of(log, facts), encoding="utf-8")
    (folder / "damper.toml").write_text(TOML, encoding="utf-8")
    return folder


if __name__ == "__main__":
    for name in MOUNTINGS:
        written(Path(sys.argv[1]) / name, name)
