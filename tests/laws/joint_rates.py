"""How often the choice at several settings is larger than the truth, and how often it lacks parts.

    python -m tests.laws.joint_rates --dampers 40 --seed 1

The dampers of `rates`, every second with what settings have in common and single ones hardly tell:
a port behind the blow-offs, blow-offs that lift gradually, friction that builds up over a distance.
A bleed has two clicks and a preload two, three settings in all; what has one of the two has three
clicks. Three speeds of each setting are logged with 4 N and 8 um of noise at 1 kHz, a fourth is
held out.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.mounting import FIT, Friction
from damperfit.laws.law_fit import SettingLogs
from damperfit.laws.search import search_laws
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests.laws.rates import CHECK, FITTED, Drawn, draw, known_of, logged, verdict_on
from tests.laws.valve_logs import moved

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.laws.law_fit import LawSearch

__all__ = ["drawn", "evidence_of", "searched", "settings_of"]

SOLVER = SolverOptions()

MORE = ("", "port", "", "rounded", "", "presliding")
# What clicks do to a bleed's orifice, beside a blow-off and alone, and to a preload.
CLOSED, CLOSED_ALONE, PRELOADED = 6.0, 1.6, 2.5
BOTH = ((6, 1), (6, 3), (18, 1))
BLEED_ALONE, BLOW_OFF_ALONE = ((6, 1), (12, 1), (18, 1)), ((6, 1), (6, 2), (6, 3))


def drawn(place: int, seed: int) -> Drawn:
    """Return the damper of a place at its softest setting."""
    one, chance = draw(place, seed), np.random.default_rng([seed, place, 5])
    # The kinds of valves and mountings take turns more slowly: each meets each.
    more = MORE[(place + place // len(MORE)) % len(MORE)]
    model, values = one.model, dict(one.values)
    if more == "presliding":
        model = dataclasses.replace(model, friction=Friction(presliding=FIT))
        values["presliding"] = chance.uniform(1e-4, 3e-4)
    elif more and model.rebound.blow_off == "linear":
        valve = dataclasses.replace(model.rebound, blow_off=more)
        model = dataclasses.replace(model, rebound=valve, compression=valve)
        for stroke in ("rebound", "compression"):
            opening, slope = values[f"{stroke}_opening"], values[f"{stroke}_slope"]
            # At the flow at which it costs what the preload is, the port adds a half as much.
            values[f"{stroke}_port"] = chance.uniform(0.6, 0.8) * slope / opening**0.5
            values[f"{stroke}_width"] = chance.uniform(0.2, 0.4) * opening
    return Drawn(model, {k: v for k, v in values.items() if k in model.names})


def settings_of(one: Drawn) -> dict[Setting, Drawn]:
    """The damper at each of its settings."""
    valve = one.model.rebound
    at = BLEED_ALONE if valve.blow_off == "none" else BOTH
    at = BLOW_OFF_ALONE if valve.bleed == "none" else at
    closed, found = CLOSED_ALONE if at is BLEED_ALONE else CLOSED, {}
    for low, high in at:
        factors = dict.fromkeys(("bleed", "leak"), closed ** ((low - 6) / 12))
        factors["leak"] **= 2.0  # a pressure by the flow, not by its square
        factors["opening"] = PRELOADED ** ((high - 1) / 2)
        values = {n: x * factors.get(n.partition("_")[2], 1.0) for n, x in one.values.items()}
        found[Setting((("l", low), ("h", high)))] = dataclasses.replace(one, values=values)
    return found


def evidence_of(one: Drawn, seed: int) -> list[SettingLogs]:
    """The logs of a damper at each of its settings."""
    evidence = []
    for number, (setting, there) in enumerate(settings_of(one).items()):
        fitted = moved(FITTED, rate=1000.0, cycles=5)
        check = moved((CHECK,), amplitude=0.012, rate=1000.0)
        logs = [
            (logged(there, motion, 10 * seed + 2 * number + k, setting),)
            for k, motion in enumerate((fitted, check))
        ]
        evidence.append(SettingLogs(setting, *logs))
    return evidence


def searched(one: Drawn, evidence: Sequence[SettingLogs]) -> LawSearch:
    """Return the search over all settings of a damper."""
    paper, layouts = known_of(one)
    return search_laws(paper, layouts, evidence, solver=SOLVER, jobs=2)


def main() -> None:
    """Count, and say of each wrong choice what it was."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="the place of the first of them")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    counts = Counter[str]()
    begin = time.process_time()
    for place in range(options.first, options.first + options.dampers):
        one = drawn(place, options.seed)
        search = searched(one, evidence_of(one, 1000 * options.seed + place))
        wrong, law = verdict_on(one, search), search.chosen
        counts.update(wrong)
        if wrong:
            print(f"{place} {', '.join(wrong)}: {law.title}, MSE {law.mse_percent:.3g} %, held out "
                  f"{law.held_out_percent:.3g} %; {one.words}", flush=True)  # fmt: skip
    print(f"{options.dampers} dampers: larger {counts['larger']}, missed {counts['missed']}, "
          f"another layout {counts['layout']}, alike {counts['told alike']}")  # fmt: skip
    seconds = (time.process_time() - begin) / max(options.dampers, 1)
    print(f"{seconds:.1f} s of the processor each")


if __name__ == "__main__":
    main()
