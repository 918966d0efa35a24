"""What faults cost near the limits of their findings: the figures in the findings' module texts.

    python -m tests.conditioning.limits                  # all, about a minute
    python -m tests.conditioning.limits --only clipped   # cases whose name holds this

One line a fault: the largest error in per cent of R_m1, R_m2 and K_e, with R_m3 and f_f known, over
settings 1, 10 and 20 of the reference set, and what `inspect` finds. Logs without noise, 8 s at
500 Hz, but where the case says otherwise.
"""

import argparse
from dataclasses import replace

import numpy as np

from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import DamperfitError
from damperfit.identification import FitOptions, identify
from tests.conditioning.logs import changed
from tests.identification.rig import recording

SETTINGS = (1, 10, 20)
NAMES = ("r_m1", "r_m2", "k_e")
KNOWN = FitOptions("plain", NAMES, {"r_m3": 2.597e6, "f_f": 50.0})
SEEDS = 3  # of random faults


def fault(channel, change, *, share):
    """What changes a channel by a share; with random numbers, of which the worst counts."""
    return lambda log, random: changed(log, channel, lambda y: change(y, share, random))


def clipped(y, share, _):
    return np.clip(y, share * y.min(), share * y.max())


def stepped(y, n, _):
    return np.ptp(y) / n * np.round(y / (np.ptp(y) / n))


def drifting(y, share, _):
    """Its middle drifts by this share of its peak, from the first cycle to the last."""
    return y + share * np.abs(y).max() * np.linspace(-0.5, 0.5, len(y))


def spiked(y, count_and_size, random):
    """So many single samples are off by a share of its range."""
    count, size = count_and_size
    at = random.choice(np.arange(500, len(y) - 500), count, replace=False)
    y[at] += size * np.ptp(y) * random.choice([-1.0, 1.0], count)
    return y


def noisy(y, size, random):
    return y + size * random.standard_normal(len(y))


def gappy(log, random):
    """4 % of the rows are missing, one here and one there."""
    kept = random.uniform(size=len(log.time)) >= 0.04
    channels = ("time", "displacement", "force")
    return replace(log, **{name: getattr(log, name)[kept] for name in channels})


FORCE, PLACE = "force", "displacement"
FAULTS = {
    "sound": None,
    **{f"force clipped at {s:g} %": fault(FORCE, clipped, share=s / 100) for s in (99, 98, 95)},
    **{f"displacement in {n} steps": fault(PLACE, stepped, share=n) for n in (1000, 500, 250)},
    **{f"force in {n} steps": fault(FORCE, stepped, share=n) for n in (250, 125, 62)},
    "1 spike of 100 % of the range": fault(FORCE, spiked, share=(1, 1.0)),
    "20 spikes of 10 %": fault(FORCE, spiked, share=(20, 0.1)),
    "5 spikes of 2 %": fault(FORCE, spiked, share=(5, 0.02)),
    **{f"force drifts by {s:g} %": fault(FORCE, drifting, share=s / 100) for s in (1, 3)},
    "4 % of the rows missing": gappy,
    "stroke drifts by 5 %": fault(PLACE, drifting, share=0.05),
    **{f"{um} um on the displacement": fault(PLACE, noisy, share=1e-6 * um) for um in (20, 37, 67)},
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
            log = recording(setting, rate=rate, duration=8.0)
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


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="cases whose name holds this")
    asked = parser.parse_args()
    print(f"{f'settings {SETTINGS}':32s} {'R_m1':>7s} {'R_m2':>7s} {'K_e':>7s} %  findings")
    for name in (name for name in FAULTS if asked.only in name):
        try:
            worst, seen = measured(name)
        except DamperfitError as error:
            print(f"{name:32s} {error}", flush=True)
            continue
        numbers = " ".join(f"{worst[parameter]:7.2f}" for parameter in NAMES)
        print(f"{name:32s} {numbers}    {', '.join(sorted(seen)) or '-'}", flush=True)


if __name__ == "__main__":
    main()
