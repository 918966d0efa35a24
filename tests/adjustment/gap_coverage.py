"""Does the interval of a setting between two tested ones hold it, where it was left out?

    python -m tests.adjustment.gap_coverage --draws 60

First of the shipped set: so many settings are drawn; which setting gives the force of each that
was not drawn, between two that are more than a click apart? At three speeds, in both strokes.
Then of dampers with a bleed and a blow-off in each stroke, both moved by the adjuster after laws
of their own, tested at three to six of 21 clicks: in many a valve opens between two of them, and
does not tell its preload where it stays closed.
"""

import argparse
from dataclasses import replace
from functools import cache

import numpy as np

from damperfit.adjustment.clicks import which_setting
from damperfit.adjustment.force_at import STROKES, Stage, force_at
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.quasi_static import quasi_static
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import VALUES, damper

SPEEDS = (0.05, 0.13, 0.3)
SETTINGS = range(1, 21)
STAGES = tuple(Stage(Setting.of(s), reference_parameters(s)) for s in SETTINGS)
DAMPER, CLICKS, NOISE = damper(), 20, 0.3
SIDES = {"rebound": "rebound", "bump": "compression"}
# Share of an area that is left, by the share of the way, and what is left when it is closed.
AREAS = {
    "linear": lambda way, left: 1.0 - way * (1.0 - left),
    "logarithmic": lambda way, left: left**way,
    "needle": lambda way, left: left + (1.0 - left) * (1.0 - way) ** 2,
    "late": lambda way, left: left + (1.0 - left) * (1.0 - way**2),
}
PRELOADS = {
    "fixed": lambda _way, _times: 1.0,
    "linear": lambda way, times: 1.0 + (times - 1.0) * way,
    "logarithmic": lambda way, times: times**way,
}


@cache
def forces_by_click():
    """Forces of all settings, with an error of 0.15 N, by speed and stroke."""
    table = {}
    for level in force_at(STAGES, PURDY_DAMPER, SPEEDS):
        by_setting = table.setdefault((level.speed, level.stroke), {})
        by_setting[level.setting.number("setting")] = replace(level, error=0.15)
    return tuple(table.values())


def covered(count, *, draws):
    """How many intervals hold, of how many."""
    random = np.random.default_rng(0)
    held = asked = 0
    known = {"stages": STAGES, "damper": PURDY_DAMPER}
    for by_click in forces_by_click():
        for _ in range(draws):
            chosen = sorted(random.choice(np.array(SETTINGS), count, replace=False).tolist())
            for left_out in set(range(chosen[0], chosen[-1])) - set(chosen):
                some = [by_click[s] for s in chosen]
                for answer in which_setting(some, by_click[left_out].force, **known).answers:
                    gap = answer.above.number("setting") - answer.below.number("setting")
                    if gap > 1:
                        asked += 1
                        held += answer.low <= left_out <= answer.high
    return held, asked


def stage_at(click, numbers, *, top, tied=()):
    """What logs up to a speed tell of one click: of a closed valve neither preload nor slope."""
    values, left_open = DAMPER.values(numbers), []
    for sign, side in zip((1.0, -1.0), SIDES.values(), strict=True):
        pressures = quasi_static(DAMPER, values, [sign * top]).pressures[:, 0]
        reached = float(np.ptp(pressures))
        if reached < values[f"{side}_opening"] and side not in tied:
            left_open += [(f"{side}_opening", (reached, 1e8)), (f"{side}_slope", (1e3, 1e11))]
            values = values.replace({f"{side}_opening": reached})
    return Stage(
        Setting.of(click), values, ("rebound_bleed", "compression_bleed"), (), 1e-6 * np.eye(2),
        top_speed=top, open_limits=tuple(left_open),
    )  # fmt: skip


def valve_dampers(count, *, seed=0):
    """Yield clicks that were tested, the numbers of each click, and up to which speed."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        slope = np.exp(random.uniform(np.log(2e6), np.log(2e7)))
        laws, tied = {}, []
        for side in SIDES.values():
            kind, law = random.choice(list(AREAS)), random.choice(list(PRELOADS))
            laws[side] = (
                AREAS[kind], PRELOADS[law], np.exp(random.uniform(np.log(0.5), np.log(4.0))),
                1.0 / random.uniform(3.0, 12.0), random.uniform(3e5, 2e6), random.uniform(1.0, 4.0),
            )  # fmt: skip
            tied += [side] * (law == "fixed")

        def numbers(click, laws=laws, slope=slope):
            found, way = dict(VALUES), click / CLICKS
            for side, (area, preload, size, left, least, times) in laws.items():
                found[f"{side}_bleed"] = 4e4 / (size * area(way, left))
                found[f"{side}_opening"] = least * preload(way, times)
                found[f"{side}_slope"] = slope
            return found

        drawn = random.choice(np.arange(CLICKS + 1), random.integers(3, 7), replace=False)
        yield sorted(drawn.tolist()), numbers, float(random.choice([0.1, 0.15, 0.26])), tied


def covered_of_valves(count, *, seed=0, speed=0.1):
    """Place of each untested click, its interval and the gap, (n, 4); a row of NaN: no answer."""
    rows = []
    for tested, numbers, top, tied in valve_dampers(count, seed=seed):
        stages = [stage_at(click, numbers(click), top=top, tied=tied) for click in tested]
        forces = [replace(f, error=NOISE, rest=NOISE) for f in force_at(stages, DAMPER, [speed])]
        for stroke in STROKES:
            mine = [one for one in forces if one.stroke == stroke]
            shown = np.array([one.force for one in mine])
            for click in set(range(tested[0], tested[-1])) - set(tested):
                signed = speed if stroke == STROKES[0] else -speed
                truth = quasi_static(DAMPER, DAMPER.values(numbers(click)), [signed]).forces[0]
                k = int(np.searchsorted(tested, click))
                if not shown[k - 1 : k + 1].min() < truth < shown[k - 1 : k + 1].max():
                    continue  # no such force between neighbours
                wanted = which_setting(mine, truth, stages=stages, damper=DAMPER)
                near = [a for a in wanted.answers if tested[k - 1] <= a.position <= tested[k]]
                rows.append(
                    (click, near[0].position, near[0].low, near[0].high, tested[k] - tested[k - 1])
                    if near
                    else (click, *[np.nan] * 4)
                )
    return np.array(rows)


def main():
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    print("settings  intervals  hold")
    for count in (2, 3, 4, 5, 7, 10):
        held, asked = covered(count, draws=max(given.draws // 10, 1))
        print(f"{count:8d} {asked:10d}  {100.0 * held / asked:.1f} %", flush=True)
    for speed in (0.03, 0.1):
        rows = covered_of_valves(given.draws, seed=given.seed, speed=speed)
        clicks, position, low, high, gap = rows.T
        print(
            f"valve dampers at {speed} m/s: {len(rows)} untested clicks, "
            f"{100.0 * np.mean((low <= clicks) & (clicks <= high)):.1f} % held; error "
            f"{np.nanmedian(np.abs(position - clicks) / gap):.3f} of the gap (median), "
            f"{np.nanmax(np.abs(position - clicks) / gap):.2f} at most; width of the interval "
            f"{np.nanmedian((high - low) / gap):.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
