"""The chosen structure in sentences: the physics that it sees, what the logs leave open."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from damperfit.damper.model import FRICTION, STIFFNESS, Model, Values
from damperfit.damper.mounting import NONE
from damperfit.damper.network import BLOW_OFF_PARTS
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.identification.outcome import Status
from damperfit.identification.procedures import Campaign
from damperfit.identification.sharing import of_settings
from damperfit.laws.law_fit import Exchange, LawFit, LawSearch, SettingLogs
from damperfit.laws.structures import in_other_layouts
from damperfit.recording import Segment
from damperfit.tested.setting import Setting

_UNDETERMINED = (frozenset({Status.NOT_IDENTIFIABLE, Status.ABSENT}), frozenset({Status.AT_BOUND}))
_NAMED = 3  # settings; of more only the number is given
_SHOWN_FLOW = 1e-5  # m3/s, at which the pressure of a laminar passage is printed


@dataclass(frozen=True, slots=True)
class LawAt:
    """A law at one setting, as far as sentences say it."""

    setting: Setting
    model: Model
    values: Values
    undetermined: tuple[str, ...]  # by the logs
    at_bound: tuple[str, ...]


def described_again(choice: Mapping[str, Any], campaign: Campaign, model: Model) -> dict[str, Any]:
    """Return what is kept of a choice, with the physics in the numbers of the fits after it.

    The search knows its law at a few settings and a coarser tolerance; tables are of the fits.
    """
    fits = [
        LawAt(
            fit.setting, model, fit.parameters, *(_with(fit.status, few) for few in _UNDETERMINED)
        )
        for fit in campaign.fits
    ]
    alike = choice.get("layouts_alike") or ()
    is_told = choice.get("sentences") and not choice.get("doubt")
    again = physics_in(fits, alike) if fits and is_told else ()
    return {**choice, "sentences": list(again)} if again else dict(choice)


def _with(status: Mapping[str, Status], wanted: frozenset[Status]) -> tuple[str, ...]:
    return tuple(name for name, state in status.items() if state in wanted)


def physics_in(fits: Sequence[LawFit | LawAt], layouts: Sequence[str] = ()) -> tuple[str, ...]:
    """Return one sentence for each part that the law has.

    With the valves' numbers in layouts that the logs do not separate from its own.
    """
    if not hasattr(fits[0].model, "rebound"):
        return ()
    model: ValveDamper = fits[0].model  # type: ignore[assignment]

    def orifice(resistance: float) -> float:
        return 1e6 / (resistance * math.sqrt(2.0 * model.oil_density))

    def laminar(resistance: float) -> float:
        return 1e-5 * resistance * model.oil_density * _SHOWN_FLOW

    sentences = []
    for stroke, area in zip(("rebound", "compression"), model.pressed_areas, strict=True):
        valve = getattr(model, stroke)
        if valve.blow_off != "none":
            name = f"{stroke}_opening"
            openings = _determined(fits, name)
            forces = [area * pressure for pressure in openings]
            sentences.append(
                f"in {stroke} a blow-off opens at {_range(forces)} N "
                f"({_range([1e-5 * pressure for pressure in openings])} bar"
                f"{_elsewhere(model, layouts, name, lambda pressure: 1e-5 * pressure, openings)})"
                f"{_where(fits, name)}"
                if openings
                else f"in {stroke} these logs do not determine where a blow-off opens"
            )
        kind = "laminar" if valve.bleed == "leak" else "part-laminar"
        parts = (
            ("bleed", orifice, "the bleed is an orifice of {} mm2 (C_d A)"),
            ("leak", laminar, f"the {kind} bleed takes {{}} bar at 10 cm3/s of flow"),
            ("port", orifice, "a port behind the blow-off is an orifice of {} mm2 (C_d A)"),
            ("power", float, "beyond its opening the pressure goes with the flow to the power {}"),
        )  # fmt: skip
        for part, shown, words in parts:
            name = f"{stroke}_{part}"
            values = _determined(fits, name) if name in model.names else []
            if values:
                numbers = _range([shown(value) for value in values])
                others = _elsewhere(model, layouts, name, shown, values)
                also = f" ({others.removeprefix('; ')})" if others else ""
                sentences.append(f"in {stroke} {words.format(numbers)}{also}{_where(fits, name)}")
    names = fits[0].values.names
    beside = (
        ("k_s", 1e-3, "{} N/mm of elasticity in series with the damper"),
        ("play", 1e3, "{} mm of play at the joints"),
        ("rubber", 1.0, "rubber in the mounting holds {} N, with the sign of its last motion"),
        ("rubber_bend", 1e3, "this force reverses over {} mm of deflection"),
        ("lag", 1e3, "the force is read {} ms late"),
        ("moving_mass", 1.0, "a mass of {} kg moves between load cell and damper"),
        *((q.name, 1.0, "{} N of friction") for q in model.quantities if q.is_friction),
        ("presliding", 1e6, "friction builds up over {} um"),
        ("breakaway", 1.0, "friction at rest is {} N above that of sliding"),
        ("seal_area", 1e6, "friction grows with the pressure, as on {} mm2 of a seal"),
        ("turning_speed", 1e3, "friction reverses within ±{} mm/s"),
        ("free_gas", 1e2, "{} % of the oil's volume is gas at rest"),
        ("drag", 1.0, "viscous drag of the seals is {} N s/m"),
    )
    for name, factor, words in beside:
        least = model.quantity(name).plausible[0] if name in names else 0.0  # held at nothing
        known = [x for x in (_determined(fits, name) if name in names else []) if x > least]
        if known:
            sentences.append(words.format(_range([factor * x for x in known])) + _where(fits, name))
    for quantity in model.quantities:  # the oil, where it is not that of the default
        stiff = _determined(fits, quantity.name) if quantity.role == STIFFNESS else []
        if known := [value for value in stiff if value != quantity.default]:
            numbers = _range([1e-9 * value for value in known])
            where = _where(fits, quantity.name)
            sentences.append(f"the bulk modulus of oil and chambers is {numbers} GPa{where}")
    sentences.extend(_of_gas(model, fits))
    sentences.extend(
        f"the {q.label} is not determined: 0 is used, and the intervals allow for up to "
        f"{2.0 * q.ignorance:.2g} {q.shown_unit}"
        for q in model.quantities
        if q.ignorance and q.may_vanish and not any(getattr(at.values, q.name) for at in fits)
    )
    return tuple(f"{sentence[0].upper()}{sentence[1:]}." for sentence in sentences)


def _elsewhere(
    model: ValveDamper,
    layouts: Sequence[str],
    name: str,
    shown: Callable[[float], float],
    values: Sequence[float],
) -> str:
    """Return what a number of a valve is in layouts that the logs do not exclude."""
    return "".join(
        f"; {_range([shown(times * value) for value in values])} in a {layout}"
        for layout, times in in_other_layouts(layouts, model, name)
    )


def _of_gas(model: ValveDamper, fits: Sequence[LawFit | LawAt]) -> list[str]:
    """Return what a gas volume that was found says of what was declared, if one was found."""
    known = [value for value in _determined(fits, "gas_volume") if value != model.gas_volume]
    if not known:
        return []
    times = model.gas_volume / float(np.median(known))
    others = [f"{1e-5 * times * model.gas_pressure:.3g} bar"]
    exponent, (least, most) = times * model.gas_exponent, model.quantity("gas_exponent").believable
    if least < exponent < most:
        others.append(f"an exponent of {exponent:.2f}")
    others.append(f"a rod {times**0.25:.3g} times as thick")
    same = f"{', '.join(others[:-1])} or {others[-1]} would do the same"
    seen = f"{_range([1e6 * x for x in known])} cm3 at {1e-5 * model.gas_pressure:.4g} bar"
    taken = f"[damper] has {1e6 * model.gas_volume:.3g} cm3"
    return [f"the gas spring is that of {seen}; {taken}; {same}: measure with gauge and callipers"]


def _determined(fits: Sequence[LawFit | LawAt], name: str) -> list[float]:
    """Return the values at the settings whose logs determine it."""
    return [float(getattr(fit.values, name)) for fit in fits if _is_determined(fit, name)]


def _is_determined(fit: LawFit | LawAt, name: str) -> bool:
    return name not in fit.undetermined and name not in fit.at_bound


def _where(fits: Sequence[LawFit | LawAt], name: str) -> str:
    """Return at which settings that is, where those of the others do not determine it."""
    known = [fit.setting for fit in fits if _is_determined(fit, name)]
    if len(known) == len(fits):
        return ""
    few = f"setting{'s' if len(known) > 1 else ''} {', '.join(map(str, known))}"
    many = f"{len(known)} of {len(fits)} settings"
    return (
        f" at {few if len(known) <= _NAMED else many}; the logs of the others do not determine it"
    )


def _range(values: Sequence[float]) -> str:
    """Return one number, or the least and the largest where they differ by more than 5 %."""
    low, high = float(np.min(values)), float(np.max(values))
    middle = 0.5 * (low + high)
    if high - low <= 0.05 * abs(middle):
        return _digits(middle)
    return f"{_digits(low)} to {_digits(high)}"


def _digits(value: float) -> str:
    """Return three digits, without a power of ten."""
    return f"{float(f'{value:.3g}'):.15g}"


# What the logs cannot decide of the law that was taken, and which test would.

# Frequencies within this factor of each other are one.
_ONE_FREQUENCY = 1.25
# Of the force's deviation: what a kilogram must take at the ends of the strokes to be asked for.
_FELT = 0.02
# Of the damper's travel: as far as a test goes.
_TRAVEL = 0.8


@dataclass(frozen=True, slots=True)
class _Tests:
    """What was tested: frequencies in Hz, speeds in m/s, half of the longest stroke in m."""

    slowest: float
    fastest: float
    lowest_frequency: float
    highest_frequency: float
    amplitude: float
    repeats: bool

    @property
    def has_one_frequency(self) -> bool:
        # What does not repeat has many, of which a segment has the mean.
        return self.repeats and self.highest_frequency <= _ONE_FREQUENCY * self.lowest_frequency

    @property
    def faster(self) -> str:
        return f"a test faster than the {self.fastest:.2g} m/s of these"

    @property
    def slower(self) -> str:
        tested, wanted = self.slowest, 0.2 * self.slowest
        return f"a test slower than the {tested:.2g} m/s of these, at {wanted:.2g} m/s,"


def undecided(
    search: LawSearch,
    fits: Sequence[LawFit],
    evidence: Sequence[SettingLogs],
    *,
    has_parts_alone: bool = False,
) -> tuple[str, ...]:
    """Return one sentence for each thing that the logs leave open, with the test to decide it.

    Of parts alone: those of the law that may be taken for each other.
    """
    segments = [part for logs in evidence for log in logs.fitted for part in log.segments]
    if not segments:
        return ()
    speeds = [segment.peak_speed for segment in segments]
    frequencies = [segment.frequency for segment in segments]
    longest = max(segment.amplitude for segment in segments)
    repeats = not any(segment.kind == "moving" for segment in segments)
    tests = _Tests(min(speeds), max(speeds), min(frequencies), max(frequencies), longest, repeats)
    parts = (
        *_of_other_structures(search, tests),
        *_of_mounting(fits[0], tests),
        *_of_moving_mass(fits[0], evidence),
    )
    if has_parts_alone:
        return parts
    others = _of_quantities(fits, tests), _of_refused(search, tests), _of_prediction(fits, tests)
    return (*parts, *chain(*others))


def _of_other_structures(search: LawSearch, tests: _Tests) -> Iterator[str]:
    if search.also:
        yield (
            f"Whether oil passes valves or something yields before it slides, as a "
            "magneto-rheological fluid or dry friction does: the logs hold "
            f"{100.0 * search.held_share:.0f} % of their force down to a tenth of the speed, and "
            f"{search.also} fits and predicts that about as well. Another speed decides it, "
            f"{0.3 * tests.slowest:.2g} m/s, with what moves beside the steady cycles in the log."
        )
    if search.alike:
        model, test = search.chosen.fits[0].model, tests.faster
        names = [model.name, *search.alike]
        listed = " and ".join(name.replace("_", " ") for name in names)
        if "monotube" in names and isinstance(model, ValveDamper):
            force = float(f"{model.gas_pressure * model.annulus_area:.2g}")
            test = (
                f"a test with more than {force:.0f} N of damping in compression (faster, or with "
                "less gas), where the rod side of a monotube cavitates"
            )
        yield (
            f"The layout ({listed} fit and predict alike). Pressures and orifices of the valves "
            "depend on it (their intervals cover both), forces hardly. What decides it: the "
            f"maker's drawing (declare damper.model), or {test}."
        )
    others: dict[str, list[Exchange]] = defaultdict(list)
    for exchange in search.exchanges:
        others[exchange.part].append(exchange)
    for part, known in others.items():
        times = max(exchange.times for exchange in known)
        fits = f"fits with {times:.2g} times the MSE" if times > 1.05 else "fits as well"
        yield (
            f"Whether it is {part}: with {' or '.join(x.instead for x in known)} instead the "
            f"model {fits}, and the intervals cover both. {tests.faster[0].upper()}"
            f"{tests.faster[1:]}, another gas pressure, or a rigid bar in the damper's place would "
            "decide it."
        )


def _of_mounting(fit: LawFit, tests: _Tests) -> Iterator[str]:
    fitted = [name for name in ("k_s", "lag") if name in fit.free]
    if fitted and tests.has_one_frequency:
        yield (
            "Whether the force is late or the mounting elastic: at one frequency they look alike. "
            f"A second speed decides it, at {0.3 * tests.lowest_frequency:.2g} or "
            f"{3.0 * tests.highest_frequency:.3g} Hz beside the {tests.highest_frequency:.3g} Hz."
        )
    if "moving_mass" in fit.free:
        instead, second = " or the displacement is read late", ""
        if tests.has_one_frequency:
            instead = ", the displacement is read late or the gas spring is softer"
            second = f", or a second speed, at {0.3 * tests.lowest_frequency:.2g} Hz"
        yield (
            f"Whether a mass moves with the load cell{instead}: they look alike. Weighing the mass "
            f"decides it{second}."
        )


def _of_moving_mass(fit: LawFit, evidence: Sequence[SettingLogs]) -> Iterator[str]:
    if not isinstance(fit.model, ValveDamper) or fit.model.mounting.moving_mass != NONE:
        return
    felt = [
        (_a_kilogram(part) / deviation, part)
        for logs in evidence
        for log in logs.fitted
        for part in log.segments
        if part.kind == "steady" and (deviation := float(np.std(log.force[part.window]))) > 0.0
    ]
    share, part = max(felt, key=lambda item: item[0], default=(0.0, None))
    if part is not None and share > _FELT:
        yield (
            f"Which mass moves between load cell and damper: at {part.frequency:.3g} Hz a kilogram "
            f"takes {_a_kilogram(part):.2g} N at the ends of the stroke, and may pass for a lag, "
            "friction or a blow-off. Weighing it decides it (damper.mounting.moving_mass); a load "
            "cell at the fixed end reads none of it."
        )


def _a_kilogram(part: Segment) -> float:
    """What a kilogram takes at the ends of a stroke, N."""
    return (2.0 * math.pi * part.frequency) ** 2 * part.amplitude


def _of_quantities(fits: Sequence[LawFit], tests: _Tests) -> Iterator[str]:
    where: dict[tuple[str, str], list[Setting]] = defaultdict(list)
    for fit in fits:
        known = (_asked(fit, name, tests) for name in (*fit.undetermined, *fit.at_bound))
        for asked in dict.fromkeys(question for question in known if question is not None):
            where[asked].append(fit.setting)
    for (what, test), settings in where.items():
        place = f" at {of_settings(settings)}" if len(fits) > 1 else ""
        yield f"{what[0].upper()}{what[1:]}{place}: {test} would decide it."


def _asked(fit: LawFit, name: str, tests: _Tests) -> tuple[str, str] | None:
    """What is not known, and the test."""
    stroke, _, part = name.partition("_")
    is_of_valve = stroke in ("rebound", "compression")
    if is_of_valve and part in BLOW_OFF_PARTS:
        return f"where the blow-off opens in {stroke}, and how it goes on", tests.faster
    if is_of_valve:
        return f"how large the bleed of {stroke} is", tests.slower
    stroke_mm = 1e3 * min(2.0 * tests.amplitude, _TRAVEL * fit.model.travel)
    bar = "a rigid bar in the damper's place, pushed and pulled,"
    role = fit.model.quantity(name).role
    of_role = {
        FRICTION: ("the friction", f"a test below {0.2 * tests.slowest:.1g} m/s"),
        STIFFNESS: ("how stiff the oil is beside its mounting", "a test on a stiffer mounting")
        if "k_s" in fit.model.names
        else ("how stiff the oil is", tests.faster),  # which presses it more
    }
    if role in of_role:
        return of_role[role]
    known = {
        "k_s": ("how elastic the mounting is", bar),
        "play": ("how much play there is", bar),
        "rubber": ("what the rubber of the mounting holds", bar),
        "rubber_bend": ("over which deflection the force of the rubber reverses", bar),
        "lag": ("how late the force is", tests.faster),
        "moving_mass": ("which mass moves with the load cell", tests.faster),
        "drag": ("the drag of the seals", tests.slower),
        "presliding": ("over which distance friction builds up", "a stroke of 1 mm at low speed"),
        "breakaway": ("how much larger friction is at rest", tests.slower),
        "stribeck_speed": ("at which speed friction is down to that of sliding", tests.slower),
        "seal_area": ("how friction grows with the pressure", "another gas pressure"),
        "turning_speed": ("within which speed friction reverses", tests.slower),
        "free_gas": ("how much gas the oil holds", "another gas pressure"),
        "gas_volume": ("the gas volume", f"a stroke of {stroke_mm:.2g} mm to both sides"),
        "return_slope": ("what the return checks resist", tests.faster),
    }
    return known.get(name)


def _of_refused(search: LawSearch, tests: _Tests) -> Iterator[str]:
    """Parts that would be worth having but for their price or what they predict."""
    for law in search.laws:
        is_larger = law.change.startswith("with ")
        if is_larger and not law.is_taken and law.gain > 1.5 and law.bic <= 0.0:
            yield (
                f"Whether the damper has {law.change.removeprefix('with ')}: the MSE falls by a "
                f"factor of {law.gain:.2g}, but these logs are too few for it. A second speed, "
                f"{0.3 * tests.slowest:.2g} or {2.0 * tests.fastest:.2g} m/s, would decide it."
            )


def _of_prediction(fits: Sequence[LawFit], tests: _Tests) -> Iterator[str]:
    if any(fit.held_out == "logs" for fit in fits):
        return
    which = (
        "only run-up, coast-down and changes of speed of these logs were predicted"
        if any(fit.held_out for fit in fits)
        else "nothing was held out"
    )
    speed = math.sqrt(tests.slowest * tests.fastest)
    if tests.fastest < _ONE_FREQUENCY * tests.slowest:
        speed = 0.3 * tests.fastest
    yield (
        f"How well the model predicts another test: {which}. One more log would show it, held "
        f"out, with {speed:.2g} m/s at an amplitude of {0.6e3 * tests.amplitude:.2g} mm."
    )
