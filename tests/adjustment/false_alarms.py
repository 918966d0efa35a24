"""How often a setting is called off the trend that is not, and how often one that is, is found.

    python -m tests.adjustment.false_alarms --draws 100

Every shape of `made_up_trends.SMOOTH`, also turned round, over every subset of settings, with an
error of 0.1 % and a scatter of 0 to 10 %; then the reference set with its setting 20.
"""

from __future__ import annotations

import argparse
from collections import Counter

from damperfit.damper.purdy.reference import reference_parameters
from tests.adjustment.made_up_trends import SMOOTH, SUBSETS, trend_of

SCATTERS = (0.0, 0.005, 0.02, 0.1)
ORDERLY = (0.0, 0.005, 0.01)  # well below the 2 % beyond which values count as mixed up


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20)
    draws = parser.parse_args().draws
    alarms, shapes = Counter(), Counter()
    cells = [(subset, scatter) for subset in SUBSETS for scatter in SCATTERS]
    for subset, scatter in cells:
        places = [setting - 1 for setting in SUBSETS[subset]]
        for shape, values in SMOOTH.items():
            for seed in range(draws):
                found = trend_of(
                    (values if seed % 2 else values[::-1])[places],
                    SUBSETS[subset],
                    scatter=scatter,
                    seed=seed,
                )
                alarms[subset, scatter] += bool(found.outliers)
                shapes[shape] += bool(found.outliers)
    n = draws * len(SMOOTH)
    print("False alarms, per cent of parameters, by subset and scatter")
    for subset in SUBSETS:
        row = (f"{100.0 * alarms[subset, scatter] / n:6.2f}" for scatter in SCATTERS)
        print(f"  {subset:14}", *row)
    for shape, count in shapes.items():
        print(f"  {shape:24} {100.0 * count / (draws * len(cells)):6.2f}")
    print(f"  all {100.0 * alarms.total() / (n * len(cells)):.2f}")
    print("Smooth shapes whose order is not passed, per cent, by subset, for scatter", *ORDERLY)
    for subset, settings in SUBSETS.items():
        places = [setting - 1 for setting in settings]
        row = []
        for scatter in ORDERLY:
            found = (
                trend_of(values[::sign][places], settings, scatter=scatter, seed=seed).monotone
                for values in SMOOTH.values()
                for seed in range(draws)
                for sign in (1, -1)
            )
            row.append(f"{100.0 * sum(one is not True for one in found) / (2 * n):6.2f}")
        print(f"  {subset:14}", *row)
    print("Setting 20 found, per cent, by parameter and subset, for scatter", *SCATTERS[:3])
    for name in ("r_m1", "r_m2"):
        for subset, settings in SUBSETS.items():
            values = [getattr(reference_parameters(setting), name) for setting in settings]
            row = []
            for scatter in SCATTERS[:3]:
                trends = (
                    trend_of(values, settings, name=name, scatter=scatter, seed=seed)
                    for seed in range(draws)
                )
                hits = sum([o.setting for o in trend.outliers] == [20] for trend in trends)
                row.append(f"{100.0 * hits / draws:6.0f}")
            print(f"  {name} {subset:14}", *row)


if __name__ == "__main__":
    main()
