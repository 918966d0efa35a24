"""Logs of a valve damper with two adjusters, for the tests: each moves what it is told to move."""

import itertools
from collections.abc import Mapping
from functools import cache

import numpy as np

from damperfit.conditioning import ConditionOptions, OffsetFacts, condition
from damperfit.damper.mounting import NONE, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.recording import Trace
from damperfit.simulation import SolverOptions, simulate
from damperfit.tested.setting import Setting
from tests.identification.rig import recorded
from tests.laws.valve_logs import moved

LOW, HIGH = "low_speed", "high_speed"
DAMPER = ThroughFlow(
    rod_diameter=0.0101, piston_diameter=0.0248, chamber_1_length=0.082, chamber_2_length=0.082,
    gas_pressure=7.28e5, gas_volume=6e-5, compression=Valve("orifice", "none"),
    mounting=Mounting(NONE, NONE, NONE),
)  # fmt: skip
TRUTH = {
    "rebound_bleed": 4e4, "rebound_opening": 4e5, "rebound_slope": 5e6, "compression_bleed": 3e4,
    "k_e": 2e8, "f_f": 20.0, "f_0": 8.0,
}  # fmt: skip
# Factors of the values above, by click of the adjuster.
FACTORS = {LOW: {6: 1.0, 14: 0.6, 20: 0.4}, HIGH: {1: 1.0, 3: 2.0}}
FOLLOWS = {"rebound_bleed": (LOW,), "compression_bleed": (LOW,), "rebound_opening": (HIGH,)}


def at(low: int, high: int) -> Setting:
    """A setting."""
    return Setting(((LOW, low), (HIGH, high)))


SETTINGS = tuple(itertools.starmap(at, itertools.product((6, 14), (1, 3))))


def numbers(setting: Setting, follows: Mapping[str, tuple[str, ...]] = FOLLOWS) -> dict[str, float]:
    """What the damper is at a setting."""
    found = dict(TRUTH)
    for name, adjusters in follows.items():
        for one in adjusters:
            found[name] *= FACTORS[one][setting.place(one)]  # type: ignore[index]
    return found


def log(
    setting: Setting, *, follows: Mapping[str, tuple[str, ...]] = FOLLOWS, seed: int = 1,
    noise: float = 1.5, speeds: tuple[float, ...] = (0.05, 0.2), cycles: int = 2,
    damper: ThroughFlow = DAMPER, **other: float,
) -> Trace:  # fmt: skip
    """The conditioned log of a setting; two speeds, noise in N, and none of the displacement."""
    motion = moved(speeds, cycles=cycles)
    values = damper.values(numbers(setting, follows) | other)
    force = simulate(values, damper, motion, options=SolverOptions(tolerance=1e-4)).force
    random = np.random.default_rng([seed, *(int(place) for _, place in setting.places)])
    force = force + noise * random.standard_normal(len(force))
    name = f"{setting.slug}.csv" if speeds == (0.05, 0.2) else f"{setting.slug}_{speeds[0]:g}.csv"
    rate = 1.0 / motion.interval
    recording = recorded(motion.displacement, force, rate, setting=setting, name=name)
    return condition(recording, ConditionOptions(offset=OffsetFacts(is_known=True)))


@cache
def logs() -> tuple[Trace, ...]:
    """Those of all four settings."""
    return tuple(log(one) for one in SETTINGS)
