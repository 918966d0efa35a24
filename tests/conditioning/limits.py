"""What faults cost near the limits of their findings: the figures in the findings' module texts.

    python -m tests.conditioning.limits                  # all, about a minute
    python -m tests.conditioning.limits --only clipped   # cases whose name holds this
    python -m tests.conditioning.limits --filters        # levels by which a rig filter is seen

One line a fault: the largest error in per cent of R_m1, R_m2 and K_e, with R_m3 and f_f known, over
settings 1, 10 and 20 of the reference set, and what `inspect` finds. Logs without noise, 8 s at
500 Hz, but where the case says otherwise.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, sosfilt

from damperfit.conditioning import condition
from damperfit.conditioning.noise import noise_ratio
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import DamperfitError
from damperfit.identification import FitOptions, identify
from damperfit.recording import Recording
from tests.identification.rig import AMPLITUDE, FREQUENCY, recording

SETTINGS = (1, 10, 20)
NAMES = ("r_m1", "r_m2", "k_e")
KNOWN = FitOptions("plain", NAMES, {"r_m3": 2.597e6, "f_f": 50.0})
DURATION = 8.0
SEEDS = 3  # of random faults
STEPS = {"displacement": 1e-6, "force": 0.1}  # of a log's digits, m and N


@dataclass(frozen=True)
class Fault:
    """One fault at one size.

    Attributes
    ----------
    name : str
        What and how much.
    spoil : callable
        Log and random numbers to the faulty log.
    rate : float
        Of the log, Hz.
    is_random : bool
        The worst of several seeds counts.
    """

    name: str
    spoil: Callable[[Recording, np.random.Generator], Recording]
    rate: float = 500.0
    is_random: bool = False


def clipped(channel: str, share: float) -> Callable[..., Recording]:
    """The channel stands at this share of its peaks."""

    def spoil(log: Recording, _: np.random.Generator) -> Recording:
        values = getattr(log, channel)
        return replace(
            log, **{channel: np.clip(values, share * values.min(), share * values.max())}
        )

    return spoil


def stepped(channel: str, steps: float) -> Callable[..., Recording]:
    """The channel is rounded to so many steps over its range."""

    def spoil(log: Recording, _: np.random.Generator) -> Recording:
        values = getattr(log, channel)
        step = np.ptp(values) / steps
        return replace(log, **{channel: step * np.round(values / step)})

    return spoil


def spiked(count: int, size: float) -> Callable[..., Recording]:
    """Single samples of the force are off by this share of its range."""

    def spoil(log: Recording, random: np.random.Generator) -> Recording:
        force = log.force.copy()
        at = random.choice(np.arange(500, len(force) - 500), count, replace=False)
        force[at] += size * np.ptp(force) * random.choice([-1.0, 1.0], count)
        return replace(log, force=force)

    return spoil


def drifting(channel: str, share: float) -> Callable[..., Recording]:
    """The channel's middle drifts by this share of its peak, from the first cycle to the last."""

    def spoil(log: Recording, _: np.random.Generator) -> Recording:
        values = getattr(log, channel)
        ramp = share * np.abs(values).max() * np.linspace(-0.5, 0.5, len(values))
        return replace(log, **{channel: values + ramp})

    return spoil


def gappy(share: float) -> Callable[..., Recording]:
    """This share of the rows is missing, one here and one there."""

    def spoil(log: Recording, random: np.random.Generator) -> Recording:
        kept = random.uniform(size=len(log.time)) >= share
        channels = {name: getattr(log, name)[kept] for name in ("time", "displacement", "force")}
        return replace(log, **channels)

    return spoil


def noisy(size: float) -> Callable[..., Recording]:
    """White noise on the displacement, m rms."""

    def spoil(log: Recording, random: np.random.Generator) -> Recording:
        noise = size * random.standard_normal(len(log.time))
        return replace(log, displacement=log.displacement + noise)

    return spoil


def as_it_is(log: Recording, _: np.random.Generator) -> Recording:
    """Nothing but the rate is at fault."""
    return log


FAULTS = (
    Fault("sound", as_it_is),
    *(Fault(f"force clipped at {s:g} %", clipped("force", s / 100.0)) for s in (99, 98, 95)),
    *(Fault(f"displacement in {n} steps", stepped("displacement", n)) for n in (1000, 500, 250)),
    *(Fault(f"force in {n} steps", stepped("force", n)) for n in (250, 125, 62)),
    Fault("1 spike of 100 % of the range", spiked(1, 1.0), is_random=True),
    Fault("20 spikes of 10 %", spiked(20, 0.1), is_random=True),
    Fault("5 spikes of 2 %", spiked(5, 0.02), is_random=True),
    *(Fault(f"force drifts by {s:g} %", drifting("force", s / 100.0)) for s in (1, 3)),
    Fault("4 % of the rows missing", gappy(0.04), is_random=True),
    Fault("stroke drifts by 5 %", drifting("displacement", 0.05)),
    *(
        Fault(f"{um} um on the displacement", noisy(1e-6 * um), is_random=True)
        for um in (20, 37, 67)
    ),
    *(Fault(f"logged at {hz} Hz", as_it_is, rate=float(hz)) for hz in (250, 100, 66)),
)


def measured(fault: Fault) -> tuple[dict[str, float], set[str]]:
    """Return the largest error of each parameter, in per cent, and the findings."""
    worst = dict.fromkeys(NAMES, 0.0)
    seen: set[str] = set()
    for setting in SETTINGS:
        truth = reference_parameters(setting)
        for seed in range(SEEDS if fault.is_random else 1):
            log = recording(setting, rate=fault.rate, duration=DURATION)
            log = fault.spoil(log, np.random.default_rng([seed, setting]))
            trace = condition(log)
            seen |= {
                f"{one.name} ({one.severity})"
                for one in trace.findings
                if one.severity == "warning" or one.name in {"sample_rate", "force_spikes"}
            }
            (fit,) = identify([trace], PURDY_DAMPER, KNOWN).fits
            for name in NAMES:
                error = getattr(fit.parameters, name) / getattr(truth, name) - 1.0
                worst[name] = max(worst[name], 100.0 * abs(error))
    return worst, seen


def rows(only: str = "") -> Iterator[str]:
    """Yield one line a fault."""
    for fault in FAULTS:
        if only in fault.name:
            try:
                worst, seen = measured(fault)
            except DamperfitError as error:
                yield f"{fault.name:32s} {error}"
                continue
            numbers = " ".join(f"{worst[name]:7.2f}" for name in NAMES)
            yield f"{fault.name:32s} {numbers}  {', '.join(sorted(seen)) or '-'}"


def filter_rows() -> Iterator[str]:
    """Yield, by corner of a filter in the rig, the range of both channels' ratios of levels."""
    for corner in (0.0, 30.0, 60.0):
        falls: dict[str, list[float]] = {"displacement": [], "force": []}
        for rate in (300.0, 500.0, 1000.0):
            for noise in (0.3, 1.0, 4.0):
                for setting in SETTINGS:
                    log = recording(setting, rate=rate, duration=DURATION, noise=noise)
                    for name, found in falls.items():
                        values = getattr(log, name)
                        if corner:
                            values = sosfilt(butter(4, corner, fs=rate, output="sos"), values)
                        values = STEPS[name] * np.round(values / STEPS[name])
                        starts = np.arange(0.0, len(values), rate / FREQUENCY)
                        found.append(noise_ratio(values, starts, 1.0 / rate))
        ranges = (f"{name} {min(found):.3g} to {max(found):.3g}" for name, found in falls.items())
        yield f"{f'{corner:g} Hz' if corner else 'no filter':10s} {', '.join(ranges)}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="cases whose name holds this")
    parser.add_argument("--filters", action="store_true", help="levels behind a rig filter")
    asked = parser.parse_args()
    if asked.filters:
        print("level just above the motion over that far above it, 300 to 1000 Hz, 0.3 to 4 N")
        for row in filter_rows():
            print(row, flush=True)
        return
    print(f"{AMPLITUDE * 1e3:g} mm, {FREQUENCY:g} Hz, settings {SETTINGS}; largest error in %")
    print(f"{'fault':32s} {'R_m1':>7s} {'R_m2':>7s} {'K_e':>7s}  findings")
    for row in rows(asked.only):
        print(row, flush=True)


if __name__ == "__main__":
    main()
