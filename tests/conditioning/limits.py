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
from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfilt

from damperfit.conditioning import condition
from damperfit.conditioning.noise import noise_ratio
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import DamperfitError
from damperfit.identification import FitOptions, identify
from tests.conditioning.logs import changed
from tests.identification.rig import AMPLITUDE, FREQUENCY, recording

SETTINGS = (1, 10, 20)
NAMES = ("r_m1", "r_m2", "k_e")
KNOWN = FitOptions("plain", NAMES, {"r_m3": 2.597e6, "f_f": 50.0})
DURATION = 8.0
SEEDS = 3  # of random faults
STEPS = {"displacement": 1e-6, "force": 0.1}  # of a log's digits, m and N


def clipped(channel, share):
    """It stands at this share of its peaks."""
    return lambda log, _: changed(
        log, channel, lambda y: np.clip(y, share * y.min(), share * y.max())
    )


def stepped(channel, n):
    """It is rounded to so many steps over its range."""
    return lambda log, _: changed(
        log, channel, lambda y: np.ptp(y) / n * np.round(y / (np.ptp(y) / n))
    )


def drifting(channel, share):
    """Its middle drifts by this share of its peak, from the first cycle to the last."""
    return lambda log, _: changed(
        log, channel, lambda y: y + share * np.abs(y).max() * np.linspace(-0.5, 0.5, len(y))
    )


def spiked(count, size):
    """Single samples of the force are off by this share of its range."""

    def spoil(log, random):
        force = log.force.copy()
        at = random.choice(np.arange(500, len(force) - 500), count, replace=False)
        force[at] += size * np.ptp(force) * random.choice([-1.0, 1.0], count)
        return replace(log, force=force)

    return spoil


def gappy(log, random):
    """4 % of the rows are missing, one here and one there."""
    kept = random.uniform(size=len(log.time)) >= 0.04
    channels = {name: getattr(log, name)[kept] for name in ("time", "displacement", "force")}
    return replace(log, **channels)


def noisy(size):
    """White noise on the displacement, m rms."""
    return lambda log, random: changed(
        log, "displacement", lambda x: x + size * random.standard_normal(len(x))
    )


# What is done to a log (with random numbers, of which the worst of several seeds counts).
FAULTS = {
    "sound": None,
    **{f"force clipped at {s:g} %": clipped("force", s / 100.0) for s in (99, 98, 95)},
    **{f"displacement in {n} steps": stepped("displacement", n) for n in (1000, 500, 250)},
    **{f"force in {n} steps": stepped("force", n) for n in (250, 125, 62)},
    "1 spike of 100 % of the range": spiked(1, 1.0),
    "20 spikes of 10 %": spiked(20, 0.1),
    "5 spikes of 2 %": spiked(5, 0.02),
    **{f"force drifts by {s:g} %": drifting("force", s / 100.0) for s in (1, 3)},
    "4 % of the rows missing": gappy,
    "stroke drifts by 5 %": drifting("displacement", 0.05),
    **{f"{um} um on the displacement": noisy(1e-6 * um) for um in (20, 37, 67)},
    **{f"logged at {hz} Hz": None for hz in (250, 100, 66)},
}


def measured(name):
    """Return the largest error of each parameter, in per cent, and the findings."""
    worst, seen, spoil = dict.fromkeys(NAMES, 0.0), set(), FAULTS[name]
    rate = float(name.split()[2]) if name.startswith("logged") else 500.0
    is_random = any(word in name for word in ("spike", "missing", " um "))
    for setting in SETTINGS:
        truth = reference_parameters(setting)
        for seed in range(SEEDS if is_random else 1):
            log = recording(setting, rate=rate, duration=DURATION)
            if spoil is not None:
                log = spoil(log, np.random.default_rng([seed, setting]))
            trace = condition(log)
            seen |= {
                f"{one.name} ({one.severity})"
                for one in trace.findings
                if one.severity == "warning" or one.name in {"sample_rate", "force_spikes"}
            }
            (fit,) = identify([trace], PURDY_DAMPER, KNOWN).fits
            for parameter in NAMES:
                error = getattr(fit.parameters, parameter) / getattr(truth, parameter) - 1.0
                worst[parameter] = max(worst[parameter], 100.0 * abs(error))
    return worst, seen


def show_filters() -> None:
    """Print, by corner of a filter in the rig, the range of both channels' ratios of levels."""
    print("level just above the motion over that far above it, 300 to 1000 Hz, 0.3 to 4 N")
    for corner in (0.0, 30.0, 60.0):
        ranges = []
        for name, step in STEPS.items():
            ratios = []
            for rate in (300.0, 500.0, 1000.0):
                for noise in (0.3, 1.0, 4.0):
                    for setting in SETTINGS:
                        log = recording(setting, rate=rate, duration=DURATION, noise=noise)
                        values = getattr(log, name)
                        if corner:
                            values = sosfilt(butter(4, corner, fs=rate, output="sos"), values)
                        values = step * np.round(values / step)
                        starts = np.arange(0.0, len(values), rate / FREQUENCY)
                        ratios.append(noise_ratio(values, starts, 1.0 / rate))
            ranges.append(f"{name} {min(ratios):.3g} to {max(ratios):.3g}")
        print(f"{f'{corner:g} Hz' if corner else 'no filter':10s} {', '.join(ranges)}", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="cases whose name holds this")
    parser.add_argument("--filters", action="store_true", help="levels behind a rig filter")
    asked = parser.parse_args()
    if asked.filters:
        show_filters()
        return
    print(f"{AMPLITUDE * 1e3:g} mm, {FREQUENCY:g} Hz, settings {SETTINGS}; largest error in %")
    print(f"{'fault':32s} {'R_m1':>7s} {'R_m2':>7s} {'K_e':>7s}  findings")
    for name in (name for name in FAULTS if asked.only in name):
        try:
            worst, seen = measured(name)
        except DamperfitError as error:
            print(f"{name:32s} {error}", flush=True)
            continue
        numbers = " ".join(f"{worst[parameter]:7.2f}" for parameter in NAMES)
        print(f"{name:32s} {numbers}  {', '.join(sorted(seen)) or '-'}", flush=True)


if __name__ == "__main__":
    main()
