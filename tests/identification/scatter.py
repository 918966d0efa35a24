"""How far single logs scatter the parameters: the procedure over noise seeds.

    python -m tests.identification.scatter --seeds 12 --settings 1 10 20
    python -m tests.identification.scatter --procedure plain --fix r_m3=2.597e6 --fix f_f=50
    python -m tests.identification.scatter --in-the-rig causal --declared none

4 N of noise on the force and 8 um on the displacement, 10 s at 1 kHz. The last line makes logs
behind a 30 Hz filter that nobody declares; the mean is then what that costs.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfilt, sosfiltfilt

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.recording import Recording, Trace
from tests.identification.rig import errors, recording

NAMES = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
RUNS = {"causal": sosfilt, "zero_phase": sosfiltfilt}


def behind_the_filter(log: Recording, kind: str) -> Recording:
    """Return what a rig with a 30 Hz filter of 4th order would have logged."""
    if kind == "none":
        return log
    rate = 1.0 / (log.time[1] - log.time[0])
    sections = butter(4, 30.0, fs=rate, output="sos")
    run = RUNS[kind]
    return replace(
        log, displacement=run(sections, log.displacement), force=run(sections, log.force)
    )


def campaign_errors(given: argparse.Namespace, seed: int) -> tuple[np.ndarray, list[float]]:
    """Return relative errors (settings, names) and the MSE of each setting."""
    options = ConditionOptions(rig_filter=given.declared)
    traces: list[Trace] = []
    for setting in given.settings:
        log = recording(setting, noise=given.noise, seed=seed)
        traces.append(condition(behind_the_filter(log, given.in_the_rig), options))
    fixed = {name: float(value) for name, _, value in (text.partition("=") for text in given.fix)}
    fit_options = FitOptions(given.procedure, fixed=fixed)
    campaign = identify(traces, PURDY_DAMPER, fit_options, jobs=given.jobs)
    rows = []
    for fit in campaign.fits:
        found = errors(fit.parameters, reference_parameters(fit.setting))
        rows.append([found[name] for name in NAMES])
    return np.array(rows), [fit.mse_percent for fit in campaign.fits]


def main() -> None:
    """Print mean and standard deviation of the relative errors, in per cent."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--settings", type=int, nargs="+", default=list(range(1, 21)))
    parser.add_argument("--noise", type=float, default=4.0)
    parser.add_argument("--procedure", default="paper")
    parser.add_argument("--fix", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--in-the-rig", choices=["none", *RUNS], default="none")
    parser.add_argument("--declared", choices=["none", *RUNS], default=None)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    given.declared = given.in_the_rig if given.declared is None else given.declared
    found, squares = zip(
        *(campaign_errors(given, seed) for seed in range(given.seeds)), strict=True
    )
    mean, scatter = np.mean(found, axis=0), np.std(found, axis=0, ddof=1)
    print("relative error, mean +- standard deviation over seeds, per cent; largest MSE")
    print("setting" + "".join(f"{name:>17s}" for name in NAMES) + "      MSE")
    for i, setting in enumerate(given.settings):
        cells = "".join(
            f"{100 * m:+8.3f} +- {100 * s:5.3f}" for m, s in zip(mean[i], scatter[i], strict=True)
        )
        print(f"{setting:7d}{cells} {max(mse[i] for mse in squares):8.4f}")


if __name__ == "__main__":
    main()
