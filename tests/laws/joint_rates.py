"""How often one model of several settings is larger than the truth, and how often it lacks a part.

    python -m tests.laws.joint_rates --dampers 40 --seed 1

The dampers of `rates`, every second with what settings have in common and single ones hardly tell:
a port behind the blow-offs, blow-offs that lift gradually, friction that builds up over a distance.
A bleed has two clicks and a preload two, three settings in all; what has one of the two has three
clicks. Three speeds of each setting are logged with 4 N and 8 um of noise at 1 kHz, a fourth is
held out. The law is chosen setting by setting, then as one model, as `identify --model auto
--procedure joint` does; what is wrong before and after is counted, larger laws and layouts too.
Missed is told in two counts: all laws that lack a part, and those of them that the rule of
`choosing` forbids to be any larger, for their MSE is below 0.02 % and no force nor held-out log is
off. Of one model the true law is fitted from the truth too, and held against the chosen one: what
the rule would not take from there, no search can find.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from damperfit.configuration.loading import load_configuration
from damperfit.damper.friction import Friction
from damperfit.damper.mounting import FIT
from damperfit.identification.sharing import unknowns_of
from damperfit.laws import SettingLogs, fit_law, judged, search_laws
from damperfit.laws.choosing import OfOneModel
from damperfit.laws.elsewhere import freed_of, had_by
from damperfit.laws.law_of_all import as_one_model
from damperfit.laws.together import _Course
from damperfit.run.auto_model import _follows, _softest_and_stiffest, at_every_setting, told_as_one
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests.laws.rates import CHECK, FITTED, Drawn, draw, known_of, logged, verdict_on
from tests.laws.valve_logs import moved

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.laws import LawSearch, Tried, Verdict

__all__ = ["drawn", "evidence_of", "held_against_truth", "settings_of", "told"]

SOLVER = SolverOptions()

MORE = ("", "port", "", "rounded", "", "presliding")
# What clicks do to a bleed's orifice, beside a blow-off and alone, and to a preload.
CLOSED, CLOSED_ALONE, PRELOADED = 6.0, 1.6, 2.5
BOTH = ((6, 1), (6, 3), (18, 1))
BLEED_ALONE, BLOW_OFF_ALONE = ((6, 1), (12, 1), (18, 1)), ((6, 1), (6, 2), (6, 3))
ADJUSTERS = {
    "l": ["rebound.bleed", "compression.bleed"],
    "h": ["rebound.opening", "compression.opening"],
}


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


def told(one: Drawn, evidence: Sequence[SettingLogs]) -> tuple[LawSearch, LawSearch]:
    """Return what single settings tell of a damper, and what they do as one model."""
    paper, layouts = known_of(one)
    compared = _softest_and_stiffest(evidence)
    elsewhere = [logs for logs in evidence if logs not in compared]
    search = search_laws(paper, layouts, compared, solver=SOLVER, jobs=2, elsewhere=elsewhere)
    fits = at_every_setting(search.chosen, evidence, SOLVER, jobs=2)
    together, _ = told_as_one(
        configured(), search, [fit for fit in fits if fit is not None], evidence,
        layouts=layouts, jobs=2, on_law=lambda _: None,
    )  # fmt: skip
    return search, together


def configured() -> Configuration:
    """With the adjusters declared, and nothing of the law."""
    overlay = {"identification": {"procedure": "joint"}, "adjusters": ADJUSTERS}
    return load_configuration(None, overlay=overlay, is_law_open=True)


def held_against_truth(
    one: Drawn, search: LawSearch, evidence: Sequence[SettingLogs]
) -> tuple[Verdict, Tried]:
    """Return whether the rule takes the true law for a chosen one that lacks a part, and that law.

    It is fitted from the true numbers, with what the chosen one has freed.
    """
    chosen, freed = search.chosen, had_by(one.model, freed_of(search.chosen))
    there = settings_of(one)
    fits = [
        fit_law(
            one.model, logs, freed=freed, solver=SOLVER,
            near=one.model.values({
                q.name: there[logs.setting].values.get(q.name, q.default)
                for q in one.model.quantities
            }),
        )
        for logs in evidence
    ]  # fmt: skip
    follows = _follows(configured(), fits, evidence, jobs=2)
    known = {logs.setting: logs for logs in evidence}
    law = as_one_model(fits, known, follows, SOLVER, 2)
    true = _Course(evidence, follows, SOLVER, 2, lambda _: None).tried(law)
    first = chosen.fits[0]
    own = unknowns_of(first.free, follows(first.model, first.free), law.one.settings)
    more = OfOneModel(law.n_unknowns - len(own))
    return judged(chosen, true, search.n_eff, of_one_model=more), true


def said_of(
    place: int, one: Drawn, search: LawSearch, evidence: Sequence[SettingLogs]
) -> Iterator[str]:
    """Print what is wrong with a choice; yield "not told" where the rule has it so."""
    law, wrong = search.chosen, verdict_on(one, search)
    print(f"{place} {', '.join(wrong)}: {law.title}, MSE {law.mse_percent:.3g} %; {one.words}",
          flush=True)  # fmt: skip
    if "missed" not in wrong or "larger" in wrong:
        return
    verdict, true = held_against_truth(one, search, evidence)
    if not verdict.takes_larger:
        yield "not told"
    said = "it would be taken" if verdict.takes_larger else verdict.reason
    print(f"  the true law leaves {true.mse_percent:.2g} %, {true.left_over:.2f} of what is enough "
          f"where this leaves {law.left_over:.2f}; MSE {verdict.gain:.2f} times, BIC "
          f"{verdict.bic:+.0f}: {said}", flush=True)  # fmt: skip


def main() -> None:
    """Count, and say of each wrong choice what it was."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="the place of the first of them")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    counts = Counter[str](), Counter[str]()
    begin = time.process_time()
    for place in range(options.first, options.first + options.dampers):
        one = drawn(place, options.seed)
        evidence = evidence_of(one, 1000 * options.seed + place)
        for n, search in zip(counts, told(one, evidence), strict=True):
            wrong = verdict_on(one, search)
            n.update((*wrong, "all"))
            if "missed" in wrong and not search.chosen.leaves_something:
                n.update(["too little"])
            if search.is_of_one_model:
                n.update(["told as one"])
            if wrong and n is counts[1]:
                n.update(said_of(place, one, search, evidence))
    for words, n in zip(("setting by setting", "as one model"), counts, strict=True):
        print(f"{words}: {n['all']}, {n['told as one']} of them told as one; larger {n['larger']}, "
              f"missed {n['missed']} (too little left for any larger law at {n['too little']}), "
              f"another layout {n['layout']}, told to be alike {n['told alike']}")  # fmt: skip
    print(f"of those missed as one model the rule would not take the true law at "
          f"{counts[1]['not told']}")  # fmt: skip
    print(f"{(time.process_time() - begin) / max(options.dampers, 1):.1f} s of the processor each")


if __name__ == "__main__":
    main()
