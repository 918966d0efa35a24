"""What two runs differ in besides their numbers, and what may be the reason for a difference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import fmean, median
from typing import TYPE_CHECKING, Any

from damperfit.comparison.measured import SAME_MOTION, tests_at
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.tables.columns import SCHEMA_VERSION
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.results import Run
    from damperfit.tested.setting import Setting
    from damperfit.units.shown_units import ShownUnits

_SAME = 1e-9  # 4.6bara and 460000 are one pressure, but for the last digit
_WARMER = 2.0  # degC; forces fall as the oil thins
_WHOSE = ("damper", "serial", "customer", "operator", "date", "rig")
# Keys of the run's configuration, with words for people, that change what comes of the same logs.
_HOW = {
    ("rig", "filter"): ("filter", "filter in the rig"),
    ("rig", "filter_corner"): ("filter", "corner of the filter in the rig"),
    ("rig", "filter_order"): ("filter", "order of the filter in the rig"),
    ("rig", "centre"): ("rig", "x = 0"),
    ("rig", "skew"): ("rig", "declared delay of the force"),
    ("conditioning", "filter"): ("filter", "damperfit's filter"),
    ("conditioning", "filter_corner"): ("filter", "corner of damperfit's filter"),
    ("conditioning", "filter_order"): ("filter", "order of damperfit's filter"),
    ("identification", "procedure"): ("procedure", "procedure"),
    ("identification", "free"): ("procedure", "free parameters"),
    ("identification", "fix"): ("procedure", "held parameters"),
    ("identification", "share"): ("procedure", "shared parameters"),
    ("identification", "bulk_modulus"): ("procedure", "bulk modulus"),
}


@dataclass(frozen=True, slots=True)
class Circumstance:
    """One thing that two runs differ in.

    Attributes
    ----------
    kind : str
        "logs", "identity", "settings", "model", "damper", "gas", "motion", "temperature", "rig",
        "filter", "procedure", "version".
    first, second : str
        As it is in each.
    sentence : str
        For people.
    """

    kind: str
    first: str
    second: str
    sentence: str

    @property
    def is_alike(self) -> bool:
        """Whether it is what both have in common."""
        return self.kind == "logs"


def circumstances(
    first: Run, second: Run, units: ShownUnits = SI, *, is_bare: bool = False
) -> tuple[Circumstance, ...]:
    """Return what two runs differ in, what matters most first.

    Parameters
    ----------
    first, second : Run
        The reference and the other.
    units : ShownUnits
        In which forces are told.
    is_bare : bool
        Measured curves alone are compared.
    """
    return (
        *_logs(first, second),
        *_identity(first, second),
        *_settings(first, second, is_bare=is_bare),
        *(() if is_bare else _damper(first, second, units)),
        *_motion(first, second, units, is_bare=is_bare),
        *_temperature(first, second),
        *_how(first, second),
        *_version(first, second),
    )


def _differs(kind: str, what: str, a: str, b: str, *, more: str = "") -> Circumstance:
    return Circumstance(kind, a, b, f"{what}: {a}, then {b}{more}")


def _logs(first: Run, second: Run) -> Iterator[Circumstance]:
    """Yield that logs are in both, and which of these were read with other signs."""
    known = [{str(log["sha256"]): log for log in _inputs(run)} for run in (first, second)]
    common = known[0].keys() & known[1].keys()
    if not common:
        return
    names = _first_names([known[0][one] for one in common])
    yield Circumstance(
        "logs",
        first.name,
        second.name,
        f"both are based on the same logs ({names}): what differs there is how they were "
        "evaluated, and the errors, which are those of two tests, are too large",
    )
    turned: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for one in common:
        signs = [logs[one].get("reversed") for logs in known]
        if all(isinstance(channels, list) for channels in signs) and signs[0] != signs[1]:
            a, b = (" and ".join(map(str, channels or ())) or "nothing" for channels in signs)
            turned.setdefault((a, b), []).append(known[0][one])
    for (a, b), logs in sorted(turned.items()):
        is_stroke = ("displacement" in a) is not ("displacement" in b)
        words = ("rebound", "bump") if is_stroke else ("positive", "negative")
        yield Circumstance(
            "rig",
            a,
            b,
            f"reversed as counted positive in bump: {a} in {first.name}, {b} in {second.name} "
            f"({_first_names(logs)}): what is {words[0]} in one is {words[1]} in the other; "
            "declare rig.reverse_displacement and rig.reverse_force",
        )


def _first_names(logs: Sequence[Mapping[str, Any]]) -> str:
    names = sorted(str(log.get("log")) for log in logs)
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _inputs(run: Run) -> Iterator[Mapping[str, Any]]:
    """Yield the logs that a run is based on, as its record has them."""
    inputs = run.record.get("inputs")
    for log in inputs if isinstance(inputs, list) else ():
        if isinstance(log, dict) and log.get("sha256") and log.get("setting") is not None:
            yield log


def have_common_logs(first: Run, second: Run) -> bool:
    """Whether any log stands behind both."""
    hashes = [{str(log["sha256"]) for log in _inputs(run)} for run in (first, second)]
    return bool(hashes[0] & hashes[1])


def identical_settings(runs: Sequence[Run], settings: Sequence[Setting]) -> list[Setting]:
    """Return the settings at which all runs have the same logs, byte for byte."""
    hashes = [
        [
            {str(log["sha256"]) for log in _inputs(run) if log["setting"] == setting.cell}
            for run in runs
        ]
        for setting in settings
    ]
    return [
        setting
        for setting, of_runs in zip(settings, hashes, strict=True)
        if of_runs[0] and all(own == of_runs[0] for own in of_runs)
    ]


def settings_of(run: Run, *, is_bare: bool) -> tuple[Setting, ...]:
    """Return the settings that were measured, or those that have parameters."""
    if is_bare:
        return tuple(sorted({test.setting for test in run.tests}))
    return tuple(stage.setting for stage in run.settings)


def _identity(first: Run, second: Run) -> Iterator[Circumstance]:
    for key in _WHOSE:
        a, b = (run.identity.get(key) for run in (first, second))
        if a and b and a != b:
            yield _differs("identity", key, a, b)


def _settings(first: Run, second: Run, *, is_bare: bool) -> Iterator[Circumstance]:
    known = [set(settings_of(run, is_bare=is_bare)) for run in (first, second)]
    alone = [known[0] - known[1], known[1] - known[0]]
    names = [listed_settings(own) for own in alone]
    for run, own in zip((first, second), alone, strict=True):
        if own:
            sentence = f"{of_settings(own)} only in {run.name}: not compared"
            yield Circumstance("settings", names[0], names[1], sentence)


def gas_force(run: Run) -> float:
    """Return the force of the declared gas at mid-stroke, N, to nine digits; NaN: none is known."""
    force = run.damper.rest_force(0.0)
    return math.nan if force is None else float(f"{float(force):.9g}")


def _damper(first: Run, second: Run, units: ShownUnits) -> Iterator[Circumstance]:
    a, b = first.damper, second.damper
    if a.name != b.name:
        more = ": only forces are compared, not parameters"
        yield _differs("model", "model", a.name, b.name, more=more)
        return
    names = [", ".join(model.names) for model in (a, b)]
    if names[0] != names[1]:
        sentence = "the models have different quantities: those with the same name are compared"
        yield Circumstance("model", names[0], names[1], sentence)
    units_of = {one.name: one.unit for one in second.quantities}
    for one in first.quantities:
        if one.unit != (unit := units_of.get(one.name, one.unit)):
            yield _differs(
                "model", f"unit of {one.name}", one.unit, unit, more=": it is not compared"
            )
    for name, (_, _, unit) in a.ranges.items():
        here, there = (getattr(model, name, None) for model in (a, b))
        if not (isinstance(here, float) and isinstance(there, float)):
            continue
        if not math.isclose(here, there, rel_tol=_SAME):
            kind = "gas" if name.startswith("gas_") else "damper"
            values = [f"{value:.6g} {unit}".strip() for value in (here, there)]
            yield _differs(kind, f"damper.{name}", *values)
    forces = [gas_force(run) for run in (first, second)]
    if math.isfinite(sum(forces)) and not math.isclose(*forces, rel_tol=_SAME):
        form = ".1f" if units.of("N") == "N" else ".3g"
        shown = [units.write(force, "N", form) for force in forces]
        apart = units.write(forces[1] - forces[0], "N", f"+{form}")
        more = f": {apart} of every difference of force is the declared gas"
        yield _differs("gas", "gas force at mid-stroke", *shown, more=more)


def _motion(first: Run, second: Run, units: ShownUnits, *, is_bare: bool) -> Iterator[Circumstance]:
    known = [settings_of(run, is_bare=is_bare) for run in (first, second)]
    motions = [
        [
            (test.amplitude, test.frequency)
            for setting in known[0]
            if setting in known[1]
            for test in tests_at(run, setting)[:1]
        ]
        for run in (first, second)
    ]
    if not all(motions):
        if is_bare:
            return
        motions = [[(run.motion.amplitude, run.motion.frequency)] for run in (first, second)]
    (a, f), (b, g) = (tuple(median(one[k] for one in tests) for k in (0, 1)) for tests in motions)
    if abs(b / a - 1.0) > SAME_MOTION or abs(g / f - 1.0) > SAME_MOTION:
        shown = [
            units.say_lengths(f"{1e3 * size:.4g} mm at {rate:.4g} Hz")
            for size, rate in ((a, f), (b, g))
        ]
        yield _differs("motion", "motion", *shown, more=": what a model misses does not cancel")


def _temperature(first: Run, second: Run) -> Iterator[Circumstance]:
    known = [
        [test.temperature for test in run.tests if math.isfinite(test.temperature)]
        for run in (first, second)
    ]
    if all(known) and abs(fmean(known[0]) - fmean(known[1])) > _WARMER:
        yield _differs("temperature", "temperature", *(f"{fmean(one):.1f} degC" for one in known))


def _how(first: Run, second: Run) -> Iterator[Circumstance]:
    documents = [run.record.get("configuration") for run in (first, second)]
    for (section, key), (kind, words) in _HOW.items():
        values: list[Any] = []
        for document in documents:
            own = document.get(section) if isinstance(document, dict) else None
            values.append(own.get(key) if isinstance(own, dict) else None)
        if None not in values and values[0] != values[1]:
            yield _differs(kind, words, *map(_shown, values))


def _shown(value: object) -> str:
    if isinstance(value, dict):
        value = [f"{key} = {one}" for key, one in value.items()]
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    return str(value)


def _version(first: Run, second: Run) -> Iterator[Circumstance]:
    for key, words in (("version", "damperfit"), ("schema_version", "schema of the results")):
        values = [run.record.get(key) for run in (first, second)]
        if None not in values and values[0] != values[1]:
            old = min((one for one in values if isinstance(one, int)), default=SCHEMA_VERSION)
            is_older = key == "schema_version" and old < SCHEMA_VERSION
            more = "; what the older run lacks is not compared" if is_older else ""
            yield _differs("version", words, *map(str, values), more=more)
