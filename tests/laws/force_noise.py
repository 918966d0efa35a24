"""By how much forces at speeds are off in the true law: noise, and no part of a damper.

    python -m tests.laws.force_noise --dampers 12

The dampers of `rates`, fitted in the law that made their logs. Where a stroke is off by more of its
errors than `_BY_NOISE` of `laws/missed.py` allows, a part that is not there may be taken for it.
"""

from __future__ import annotations

import argparse
from unittest.mock import patch

from damperfit.laws import SettingLogs, fit_law, missed
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests.laws.rates import FITTED, _may_be_freed, draw, logged
from tests.laws.valve_logs import moved

REAL = missed._times_noise
# per cent: a fit that leaves more has ended elsewhere, and tells nothing of noise
MOST = 0.01


def main() -> None:
    """Print a line for each damper, and the worst of all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    times: list[float] = []
    worst = 0.0
    for place in range(options.dampers):
        one = draw(place, options.seed)
        log = logged(one, moved(FITTED, rate=1000.0, cycles=5), 1000 * options.seed + 2 * place)
        logs = SettingLogs(Setting.of(1), (log,))
        freed = tuple(name for name in one.model.names if name in _may_be_freed(one))
        found: list[float] = []

        def told(*given: object, found: list[float] = found) -> float:
            found.append(REAL(*given))
            return found[-1]

        fit = fit_law(one.model, logs, freed=freed)
        with patch.object(missed, "_times_noise", told):
            missed.misses(one.model, fit.values, logs.fitted, SolverOptions())
        said = " ".join(f"{x:.1f}" for x in found)
        print(f"{fit.mse_percent:.4f} %, force {fit.worst_force_percent:.2f} %, errors {said}")
        if fit.mse_percent <= MOST:
            times += found
            worst = max(worst, fit.worst_force_percent)
    print(f"{len(times)} strokes: off by at most {max(times, default=0.0):.1f} of their errors, "
          f"single forces by {worst:.1f} %")  # fmt: skip


if __name__ == "__main__":
    main()
