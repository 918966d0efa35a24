"""How far the noise of the displacement bends friction and K_e, by its size and the sample rate.

    python -m tests.conditioning.drive_bias --seeds 8

Sines of the standard test (setting 10, 10 s, 4 N of noise at 1 kHz and as dense at other rates),
all five parameters free. Mean error over the seeds in per cent, with the corner of the drive; and
the same for a triangle beside another speed, where the corner rises.
"""

from __future__ import annotations

import argparse

import numpy as np

from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from tests.oracles.motions import MOTIONS, logged

NOISES = (0.0, 1e-6, 3e-6, 5e-6, 8e-6, 10e-6)
RATES = (300.0, 500.0, 1000.0, 2000.0, 5000.0)


def errors(motion, rate, noise, seed, setting):
    """Relative errors of f_f and K_e in per cent, and the corner of the drive."""
    trace = condition(
        logged(
            motion,
            setting,
            seed=seed,
            rate=rate,
            displacement_noise=noise,
            force_noise=4.0 * np.sqrt(rate / 1000.0),
        )
    )
    fit = identify([trace], PURDY_DAMPER, FitOptions(procedure="plain")).fits[0]
    truth = reference_parameters(setting)
    found = [
        100.0 * (getattr(fit.parameters, name) / getattr(truth, name) - 1.0)
        for name in ("f_f", "k_e")
    ]
    return found, trace.drive.corner


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--setting", type=int, default=10)
    parser.add_argument("--motions", default="sine", help=f"of {', '.join(MOTIONS)}; by comma")
    given = parser.parse_args()
    for motion in given.motions.split(","):
        print(f"{motion}, setting {given.setting}: mean error of f_f / K_e in %, corner in Hz")
        print("noise um " + "".join(f"{rate:>22.0f} Hz" for rate in RATES))
        for noise in NOISES:
            cells = []
            for rate in RATES:
                runs = [
                    errors(motion, rate, noise, seed, given.setting) for seed in range(given.seeds)
                ]
                friction, modulus = np.mean([found for found, _ in runs], axis=0)
                corner = np.mean([corner for _, corner in runs])
                cells.append(f"{friction:+8.2f} /{modulus:+6.2f} {corner:6.0f}  ")
            print(f"{1e6 * noise:8.0f} " + "".join(cells), flush=True)


if __name__ == "__main__":
    main()
