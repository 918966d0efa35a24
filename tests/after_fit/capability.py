"""Whether Cp, Cpk and the run rules of a fleet are right: python -m tests.after_fit.capability.

Fleets are drawn of dampers whose force has a known mean and spread, measured with a known error;
the intervals must hold the true Cp and Cpk in 95 of 100 fleets, a steady force must break a rule
about as often as the manual says, and a shift of two sigmas from the middle damper on must be told.
"""

import argparse
from datetime import date, timedelta

import numpy as np

from damperfit.fleets.survey import capability, fleet_against_bands, run_rules, survey
from tests.fleet.test_survey import nominal, of_force

MEAN, LOW, HIGH = 1000.0, 940.0, 1030.0


def main() -> None:
    """Print how many intervals hold the truth, the means, and how many fleets break a rule."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fleets", type=int, default=400)
    parser.add_argument("--dampers", type=int, default=30)
    parser.add_argument("--spread", type=float, default=8.0)
    given = parser.parse_args()
    random, s, n = np.random.default_rng(1), given.spread, given.dampers
    cp, cpk = (HIGH - LOW) / (6.0 * s), min(HIGH - MEAN, MEAN - LOW) / (3.0 * s)
    bands = nominal("1", 0.26, "rebound", LOW, HIGH)
    for error in (0.0, 0.5 * s, s):
        found, held = [], np.zeros(2)
        for _ in range(given.fleets):
            forces = MEAN + random.normal(size=n) * s + random.normal(size=n) * error
            seen = survey(of_force(forces, error))
            (row,) = capability(seen, fleet_against_bands(seen, bands))
            if row["cp"] is None:
                continue
            most = np.inf if row["cp_ci_high"] is None else row["cp_ci_high"]
            held += [row["cp_ci_low"] <= cp <= most, row["cpk_ci_low"] <= cpk <= row["cpk_ci_high"]]
            found.append((row["cp"], row["cpk"]))
        shares, middle = 100.0 * held / len(found), np.median(found, axis=0)
        print(
            f"measurement {error:g} N: Cp {cp:.2f}, median {middle[0]:.2f}, interval holds it in "
            f"{shares[0]:.0f} %; Cpk {cpk:.2f}, {middle[1]:.2f}, {shares[1]:.0f} % of {len(found)}",
            flush=True,
        )
    days = [str(date(2026, 1, 1) + timedelta(days=k)) for k in range(n)]
    for shift in (0.0, 2.0):
        told = 0
        for _ in range(given.fleets):
            forces = MEAN + s * (random.normal(size=n) + shift * (np.arange(n) >= n // 2))
            told += bool(run_rules(survey(of_force(forces, dates=days)))[0])
        print(f"shift of {shift:g} sigmas: {told} of {given.fleets} fleets of {n} break a rule")


if __name__ == "__main__":
    main()
