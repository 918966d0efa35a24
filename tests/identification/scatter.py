"""How far single logs scatter the parameters: the procedure over noise seeds.

    python -m tests.identification.scatter --seeds 12 --settings 1 10 20
    python -m tests.identification.scatter --in-the-rig causal

4 N of noise on the force and 8 um on the displacement, 10 s at 1 kHz. The last line makes logs
behind a 30 Hz filter that nobody declares; the mean is then what that costs.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfilt, sosfiltfilt

from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from tests.identification.rig import NAMES, errors, recording

RUNS = {"none": lambda _, x: x, "causal": sosfilt, "zero_phase": sosfiltfilt}


def main() -> None:
    """Print mean and standard deviation of the relative errors, in per cent."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--settings", type=int, nargs="+", default=list(range(1, 21)))
    parser.add_argument("--procedure", default="paper")
    parser.add_argument("--in-the-rig", choices=RUNS, default="none")
    given = parser.parse_args()
    sections, found = butter(4, 30.0, fs=1000.0, output="sos"), []
    for seed in range(given.seeds):
        logs = []
        for setting in given.settings:
            log, run = recording(setting, noise=4.0, seed=seed), RUNS[given.in_the_rig]
            x, force = (run(sections, one) for one in (log.displacement, log.force))
            logs.append(condition(replace(log, displacement=x, force=force)))
        fits = identify(logs, PURDY_DAMPER, FitOptions(given.procedure)).fits
        off = (errors(fit.parameters, reference_parameters(fit.setting)) for fit in fits)
        found.append([[100.0 * one[name] for name in NAMES] for one in off])
    mean, scatter = np.mean(found, axis=0), np.std(found, axis=0, ddof=1)
    print("relative error, mean +- standard deviation over seeds, per cent")
    print("setting" + "".join(f"{name:>17s}" for name in NAMES))
    for setting, *row in zip(given.settings, mean, scatter, strict=True):
        cells = (f"{m:+8.3f} +- {s:5.3f}" for m, s in zip(*row, strict=True))
        print(f"{setting:7d}{''.join(cells)}")


if __name__ == "__main__":
    main()
