"""Does the interval of a setting between two tested ones hold it, where it was left out?

    python -m tests.adjustment.gap_coverage --draws 60

Of the shipped set so many settings are drawn; which setting gives the force of each that was not
drawn, between two that are more than a click apart? At three speeds, in both strokes.
"""

import argparse
from dataclasses import replace
from functools import cache

import numpy as np

from damperfit.adjustment.clicks import which_setting
from damperfit.adjustment.force_at import Stage, force_at
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.tested.setting import Setting

SPEEDS = (0.05, 0.13, 0.3)
SETTINGS = range(1, 21)


@cache
def forces_by_click():
    """Forces of all settings, with an error of 0.15 N, by speed and stroke."""
    stages = [Stage(Setting.of(s), reference_parameters(s)) for s in SETTINGS]
    found = force_at(stages, PURDY_DAMPER, SPEEDS)
    table = {}
    for level in found:
        by_setting = table.setdefault((level.speed, level.stroke), {})
        by_setting[level.setting.number("setting")] = replace(level, error=0.15)
    return tuple(table.values())


def covered(count, *, draws):
    """How many intervals hold, of how many."""
    random = np.random.default_rng(0)
    held = asked = 0
    for by_click in forces_by_click():
        for _ in range(draws):
            chosen = sorted(random.choice(np.array(SETTINGS), count, replace=False).tolist())
            for left_out in set(range(chosen[0], chosen[-1])) - set(chosen):
                wanted = which_setting([by_click[s] for s in chosen], by_click[left_out].force)
                for answer in wanted.answers:
                    gap = answer.above.number("setting") - answer.below.number("setting")
                    if gap > 1:
                        asked += 1
                        held += answer.low <= left_out <= answer.high
    return held, asked


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=60)
    given = parser.parse_args()
    print("settings  intervals  hold")
    for count in (2, 3, 4, 5, 7, 10):
        held, asked = covered(count, draws=given.draws)
        print(f"{count:8d} {asked:10d}  {100.0 * held / asked:.1f} %", flush=True)


if __name__ == "__main__":
    main()
