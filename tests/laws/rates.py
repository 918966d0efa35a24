"""How often the search takes a law that is larger than the truth, and how often it misses a part.

    python -m tests.laws.rates --dampers 100 --disturbed 40 --seed 1

Dampers of every layout, valve and mounting are drawn by chance, logged at three speeds with 4 N and
8 um of noise at 1 kHz, and a fourth speed and stroke is held out. The disturbed ones follow a law
that is none of the library's: friction that rises by a third below 10 mm/s with a seal's drag, or a
stack of shims that opens by a power of the pressure. They may be told as friction that is larger at
rest, and as a blow-off that lifts gradually, by a power, or has a port; nothing else must be
invented to take their place. What a law holds at another value than the truth's (the oil's bulk
modulus, the returns) may be freed. A plain blow-off for one that lifts gradually, or a bleed that
is a gap or an orifice for one that is both, lacks a number: it is missed, and nothing is larger.
Another layout is counted apart: forces alone do not always tell it. `--turning` dampers have
friction that turns within a speed. `--several` dampers are logged at three settings, every second
with what settings have in common and single ones hardly tell: a port behind the blow-offs,
blow-offs that lift gradually, friction that builds up over a distance. A bleed has two clicks and a
preload two; what has one of the two has three clicks. Of what is missed it is said where the law
leaves too little for the rule to ask for more.
"""

import argparse
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from damperfit.conditioning import condition
from damperfit.conditioning.polarity import YIELDS, held_share
from damperfit.damper.model import Model
from damperfit.damper.mounting import FIT, NONE, Friction, Mounting, behind_lag
from damperfit.damper.network import Network, Passage, Valve, simulate_network
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube, ValveDamper
from damperfit.laws.law_fit import Candidate, LawSearch, SettingLogs
from damperfit.laws.search import search_laws
from damperfit.recording import Recording, Trace
from damperfit.simulation import Motion
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import moved

KINDS = (ThroughFlow, TwinTube, Monotube)
VALVES = {
    "bleed": Valve("orifice", "none"),
    "blow-off": Valve("none", "linear"),
    "bleed, blow-off": Valve("orifice", "linear"),
    "laminar bleed": Valve("leak", "none"),
    "laminar bleed, blow-off": Valve("leak", "linear"),
    "part-laminar bleed, blow-off": Valve("long", "linear"),
}
RIGS = ((), ("lag",), ("play",), ("play", "lag"))
DISTURBANCES = ("stribeck", "shim")
TURNING, SEVERAL = "turning", "several settings"
FITTED, CHECK = (0.06, 0.13, 0.24), 0.17
TOP = max(FITTED)
FORCE_NOISE, DISPLACEMENT_NOISE = 4.0, 8e-6
# Of a stack of shims: w grows by this power of the pressure beyond the preload.
POWER = 1.6
STEPS = 5
# Kinds of a valve's part that others are with a number less: a part missed, and none too many.
PLAINER = {
    "linear": ("rounded", "port", "power"),
    "orifice": ("long",),
    "leak": ("long",),
}
ALONE = Setting.of(1)
MORE = ("", "port", "", "rounded", "", "presliding")
# What clicks do to a bleed's orifice, beside a blow-off and alone, and to a preload.
CLOSED, CLOSED_ALONE, PRELOADED = 6.0, 1.6, 2.5
BOTH = ((6, 1), (6, 3), (18, 1))
BLEED_ALONE, BLOW_OFF_ALONE = ((6, 1), (12, 1), (18, 1)), ((6, 1), (6, 2), (6, 3))


@dataclass(frozen=True)
class Drawn:
    """A damper, its numbers, and what disturbs it."""

    model: ValveDamper
    values: Mapping[str, float]
    disturbance: str = ""

    @property
    def words(self) -> str:
        shown = {k: f"{v:.3g}" for k, v in self.values.items() if k not in {"f_0", "return_slope"}}
        return f"{self.model.name} {self.disturbance} {shown}"


def draw(place: int, seed: int, disturbance: str = "") -> Drawn:
    """Return the damper of a place in the round of layouts, valves and mountings."""
    chance = np.random.default_rng([seed, place, len(disturbance)])
    kind = KINDS[place % 3]
    valve = VALVES[list(VALVES)[place // 3 % len(VALVES)]]
    if disturbance == "shim":
        valve = VALVES["bleed, blow-off"]
    rig = RIGS[place // (3 * len(VALVES)) % len(RIGS)]
    parts = {"play": FIT if "play" in rig else NONE, "lag": FIT if "lag" in rig else NONE}
    model = kind(
        rod_diameter=chance.uniform(9e-3, 12.5e-3),
        piston_diameter=chance.uniform(24e-3, 32e-3),
        chamber_1_length=0.085,
        chamber_2_length=0.085,
        gas_pressure=chance.uniform(18e5, 25e5) if kind is Monotube else chance.uniform(5e5, 8e5),
        gas_volume=chance.uniform(2e-5, 4e-5),
        rebound=valve,
        compression=valve,
        mounting=Mounting(FIT, **parts),
    )
    values = {
        "k_e": chance.uniform(0.8e9, 1.2e9),
        "k_s": chance.uniform(2e5, 8e5),
        "play": chance.uniform(3e-4, 1e-3),
        "lag": chance.uniform(6e-3, 14e-3),
        "f_f": chance.uniform(12.0, 30.0),
        "f_0": chance.uniform(-20.0, 20.0),
        "drag": chance.uniform(10.0, 25.0) if disturbance == "stribeck" else 0.0,
        "return_slope": chance.uniform(1.5e5, 3e5),
        "gas_volume": model.gas_volume,
    }
    force = chance.uniform(400.0, 1200.0)
    forces = force, chance.uniform(0.4, 0.8) * force
    strokes = zip(("rebound", "compression"), model.pressed_areas, forces, strict=True)
    for stroke, area, top in strokes:
        values |= {f"{stroke}_{k}": v for k, v in _valve(model, area, top, chance).items()}
    if disturbance == TURNING:
        model = replace(model, friction=Friction(turning_speed=FIT))
        values["turning_speed"] = chance.uniform(5e-3, 20e-3)
        values["f_f"] *= 1.5
    return Drawn(model, {k: v for k, v in values.items() if k in model.names}, disturbance)


def _valve(
    model: ValveDamper, area: float, force: float, chance: np.random.Generator
) -> dict[str, float]:
    """A valve with this force at the highest speed, whose parts all carry some of the oil."""
    highest, flow = force / area, model.oil_density * area * TOP
    valve = model.rebound
    share = chance.uniform(0.3, 0.7) if valve.bleed != "none" else 0.0
    share = 1.0 if valve.blow_off == "none" else share
    opening = chance.uniform(0.25, 0.6) * highest
    found = {"opening": opening, "slope": (highest - opening) / (flow * max(1.0 - share, 1e-9))}
    through = flow * max(share, 1e-9)
    laminar = {"leak": 1.0, "long": chance.uniform(0.3, 0.7)}.get(valve.bleed, 0.0)
    return found | {
        "leak": laminar * highest / through,
        "bleed": math.sqrt((1.0 - laminar) * highest) / through,
    }


def _network(one: Drawn) -> tuple[Network, dict[str, float]]:
    """The passages; of a shim stack several blow-offs that open one after the other."""
    network, numbers = one.model.network, dict(one.values)
    if one.disturbance != "shim":
        return network, numbers
    passages: list[Passage] = []
    for passage in network.passages:
        if not passage.opening:
            passages.append(passage)
            continue
        p, slope = numbers.pop(passage.opening), numbers.pop(passage.resistance)
        top = 1.5 * p
        # w = ((D - p)/top)^n top/slope by straight pieces: each adds what the slope grows by.
        knots = np.linspace(0.0, 2.0, STEPS + 1)
        slopes = np.diff(np.diff(knots**POWER) / np.diff(knots), prepend=0.0)
        for k, more in enumerate(slopes.tolist()):
            names = f"{passage.opening}_{k}", f"{passage.resistance}_{k}"
            numbers |= {names[0]: p + knots[k] * top, names[1]: slope / more}
            passages.append(passage._replace(opening=names[0], resistance=names[1]))
    return replace(network, passages=tuple(passages)), numbers


def logged(one: Drawn, motion: Motion, seed: int, setting: Setting = ALONE) -> Trace:
    """The log of a motion, with noise."""
    network, numbers = _network(one)
    own = {name: number for name, number in numbers.items() if name != "lag"}
    force = simulate_network(network, own, one.model, motion).force
    if one.disturbance == "stribeck":
        more = np.exp(-np.abs(motion.velocity) / 0.01) * np.sign(motion.velocity)
        force = force + 0.35 * numbers["f_f"] * more
    if "lag" in numbers:
        force = behind_lag(force[None, :], motion.interval, numbers["lag"])[0]
    noise = np.random.default_rng(seed)
    n = len(force)
    return condition(
        Recording(
            name=f"{seed}.csv",
            path=f"{seed}.csv",
            sha256="",
            setting=setting,
            time=motion.interval * np.arange(n),
            displacement=motion.displacement + noise.normal(0.0, DISPLACEMENT_NOISE, n),
            force=force + noise.normal(0.0, FORCE_NOISE, n),
        )
    )


def known_of(one: Drawn) -> tuple[Model, list[ValveDamper]]:
    """What its owner knows of a damper: the paper's and the layouts that it may have."""
    geometry = {
        name: getattr(one.model, name)
        for name in ("rod_diameter", "piston_diameter", "chamber_1_length", "chamber_2_length",
                     "oil_density", "gas_pressure", "gas_volume", "gas_exponent")
    }  # fmt: skip
    paper = replace(PURDY_DAMPER, **{k: v for k, v in geometry.items() if k != "gas_volume"})
    return paper, [kind(**geometry) for kind in KINDS]


def alone(one: Drawn, seed: int) -> list[SettingLogs]:
    """The logs of a damper with one setting."""
    fitted = logged(one, moved(FITTED, rate=1000.0, cycles=5), seed)
    check = logged(one, moved((CHECK,), amplitude=0.012, rate=1000.0), seed + 1)
    return [SettingLogs(ALONE, (fitted,), (check,))]


def of_several(place: int, seed: int) -> Drawn:
    """Return the damper of a place at its softest setting."""
    one, chance = draw(place, seed), np.random.default_rng([seed, place, 5])
    # The kinds of valves and mountings take turns more slowly: each meets each.
    more = MORE[(place + place // len(MORE)) % len(MORE)]
    model, values = one.model, dict(one.values)
    if more == "presliding":
        model = replace(model, friction=Friction(presliding=FIT))
        values["presliding"] = chance.uniform(1e-4, 3e-4)
    elif more and model.rebound.blow_off == "linear":
        valve = replace(model.rebound, blow_off=more)
        model = replace(model, rebound=valve, compression=valve)
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
        found[Setting((("l", low), ("h", high)))] = replace(one, values=values)
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


def searched(one: Drawn, evidence: Sequence[SettingLogs], jobs: int = 1) -> LawSearch:
    """Return the search over the logs of a damper."""
    paper, layouts = known_of(one)
    share = held_share(evidence[0].fitted[0]) if len(evidence) == 1 else 0.0
    held = share if share >= YIELDS else math.nan
    return search_laws(paper, layouts, evidence, held_share=held, jobs=jobs)


def parts_of(law: Candidate) -> frozenset[str]:
    """Return what a law is made of, layout aside; the paper's model is none of these."""
    fit = law.fits[0]
    if not isinstance(fit.model, ValveDamper):
        return frozenset({"paper"})
    own = set(_of_model(fit.model))
    return frozenset(own | {n for n in fit.free if fit.model.quantity(n).default is not None})


def _of_model(model: ValveDamper) -> Iterator[str]:
    for stroke, valve in (("rebound", model.rebound), ("compression", model.compression)):
        yield from (f"{stroke} {one}" for one in (valve.bleed, valve.blow_off) if one != "none")
    mounting = model.mounting
    parts = zip(
        ("k_s", "play", "lag"),
        (mounting.series_stiffness, mounting.play, mounting.lag),
        strict=True,
    )
    yield from (name for name, kind in parts if kind != NONE)
    friction = {one.name: getattr(model.friction, one.name) for one in fields(model.friction)}
    yield from (name for name, kind in friction.items() if kind != NONE)


def _may_be_freed(one: Drawn) -> set[str]:
    """What a law holds at another value than the truth's."""
    held = {q.name: q.default for q in one.model.quantities if q.default is not None}
    return {
        name
        for name, value in held.items()
        if abs(value - one.values.get(name, value)) > 1e-3 * value
    }


def _plainer_of(part: str) -> set[str]:
    """The parts that a valve's part is, without one of their numbers."""
    stroke, _, kind = part.rpartition(" ")
    return {f"{stroke} {more}" for more in PLAINER.get(kind, ())} if stroke else set()


def verdict_on(one: Drawn, search: LawSearch) -> tuple[str, ...]:
    """Return what is wrong with a choice, of "larger", "missed", "layout" and "told alike"."""
    law = search.chosen
    true, found = frozenset(_of_model(one.model)), parts_of(law) - _may_be_freed(one)
    if found == {"paper"}:
        return ("missed",)
    if one.disturbance == "shim":  # which lifts gradually
        found = frozenset(
            part.replace("rounded", "linear").replace("port", "linear").replace("power", "linear")
            for part in found
        )
    elif one.disturbance == "stribeck":  # whose friction is larger at rest
        found -= {"breakaway", "stribeck_speed"}
    wrong = []
    if any(not _plainer_of(part) & true for part in found - true):
        wrong.append("larger")
    if true - found:
        wrong.append("missed")
    if law.fits[0].model.name != one.model.name:
        wrong.append("told alike" if one.model.name in search.alike else "layout")
    return tuple(wrong)


def main() -> None:
    """Count, and say of each wrong choice what it was."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dampers", type=int, default=36, help="in a law of the library's")
    parser.add_argument("--disturbed", type=int, default=12, help="in a law of another form")
    parser.add_argument("--turning", type=int, default=0, help="friction turns within a speed")
    parser.add_argument("--several", type=int, default=0, help="logged at several settings")
    parser.add_argument("--first", type=int, default=0, help="place that each round begins at")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    seed, first = options.seed, options.first
    rounds = {
        "laws of the library's": (options.dampers, draw),
        "laws of another form": (
            options.disturbed,
            lambda k, seed: draw(k, seed, DISTURBANCES[k % 2]),
        ),
        "friction that turns within a speed": (
            options.turning,
            lambda k, seed: draw(k, seed, TURNING),
        ),
        SEVERAL: (options.several, of_several),
    }
    begin = time.process_time()
    lines = [
        _counted(title, range(first, first + n), drawn, seed)
        for title, (n, drawn) in rounds.items()
        if n
    ]
    print("\n".join(lines))
    n_dampers = max(sum(n for n, _ in rounds.values()), 1)
    print(f"{(time.process_time() - begin) / n_dampers:.1f} s of the processor each")


def _counted(title: str, places: range, drawn: Callable[[int, int], Drawn], seed: int) -> str:
    """Say of each wrong choice what it was, and return the counts."""
    n: Counter[str] = Counter()
    for place in places:
        one = drawn(place, seed)
        if title == SEVERAL:
            search = searched(one, evidence_of(one, 1000 * seed + place), jobs=2)
        else:
            search = searched(one, alone(one, 1000 * seed + 2 * place))
        law, wrong = search.chosen, verdict_on(one, search)
        n.update(wrong)
        if "missed" in wrong and not law.leaves_something:
            n["too little"] += 1
        if wrong:
            print(f"{place} {', '.join(wrong)}: {law.title}, MSE {law.mse_percent:.3g} %, "
                  f"{law.left_over:.2f} of what is enough; {one.words}", flush=True)  # fmt: skip
    return (f"{title}: {len(places)}; larger {n['larger']}, missed {n['missed']} (too little left "
            f"at {n['too little']}), another layout {n['layout']}, told to be alike "
            f"{n['told alike']}")  # fmt: skip


if __name__ == "__main__":
    main()
