"""Are three cycles at 5 to 10 Hz told as well as three cycles can be?

    python -m tests.uncertainty.few_cycles --seeds 40

Setting 10, 1024 Hz, 4 N and 3 um of noise, 0.3 m/s, all five parameters free. A log of so many
cycles begins and ends in the midst of the motion. Each line: how many intervals hold the
truth, the scatter found, over the error given, over that of 30 cycles times the square root of the
cycles, and the mean error.
"""

import argparse
import math
from functools import cache

import numpy as np

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.recording import Recording
from damperfit.synthetic import steady_cycle
from damperfit.uncertainty import assess

NAMES = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
RATE, SPEED, SETTING = 1024.0, 0.3, 10


@cache
def _steady(frequency):
    amplitude = SPEED / (2.0 * math.pi * frequency)
    truth = reference_parameters(SETTING)
    return steady_cycle(truth, PURDY_DAMPER, amplitude=amplitude, frequency=frequency)


def logged(frequency, cycles, *, seed, force_noise=4.0, displacement_noise=3e-6):
    """A raw log of so many cycles of a steady sine, from the midst of it."""
    random, steady = np.random.default_rng(seed), _steady(frequency)
    time = np.arange(round(cycles / frequency * RATE)) / RATE
    phase = random.uniform() + frequency * time
    x = steady.displacement(phase) + displacement_noise * random.standard_normal(len(time))
    force = steady.force(phase) + force_noise * random.standard_normal(len(time))
    return Recording(f"{frequency:g} Hz", "", "", SETTING, time, x, force)


def deviations(recording):
    """The trace, ln(found/true) of each parameter, and its standard error."""
    trace = condition(recording, ConditionOptions(centre=0.0))
    campaign = identify([trace], PURDY_DAMPER, FitOptions(procedure="plain"))
    (known,) = assess(campaign, PURDY_DAMPER).uncertainties
    found, truth = campaign.fits[0].parameters, reference_parameters(SETTING)
    off = [math.log(getattr(found, name) / getattr(truth, name)) for name in NAMES]
    errors = {name: one.error / getattr(found, name) for name, one in known.intervals.items()}
    return trace, off, [errors.get(name, math.nan) for name in NAMES]


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=40)
    seeds = range(parser.parse_args().seeds)
    for frequency in (5.0, 7.0, 10.0):
        of_many = math.nan
        for cycles in (30.0, 3.0):
            table = [deviations(logged(frequency, cycles, seed=seed)) for seed in seeds]
            traces, *columns = zip(*table, strict=True)
            off, errors = map(np.array, columns)
            scatter, given = np.sqrt(np.mean(off**2, axis=0)), np.nanmean(errors, axis=0)
            of_many = scatter if cycles == 30.0 else of_many * math.sqrt(27.0 / 3.0)
            hits = np.count_nonzero(np.abs(off) <= 1.959964 * errors, axis=0)
            n = np.mean([trace.n_cycles for trace in traces])
            print(f"{frequency:g} Hz, {cycles:g} cycles, {n:.2f} compared")
            for k, name in enumerate(NAMES):
                print(
                    f"  {name}: {hits[k]} of {len(seeds)}, scatter {100.0 * scatter[k]:.2f} %, "
                    f"over error {scatter[k] / given[k]:.2f}, over theory "
                    f"{scatter[k] / of_many[k]:.2f}, mean {100.0 * np.mean(off[:, k]):+.2f} %"
                )


if __name__ == "__main__":
    main()
