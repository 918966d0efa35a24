"""What two runs differ in besides their numbers, and what may be the reason for a difference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Any

from damperfit.comparison.runs import SAME_MOTION
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.tables.columns import SCHEMA_VERSION
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.comparison.runs import ComparedRun
    from damperfit.damper.model import Model
    from damperfit.results import Run
    from damperfit.tested.setting import Setting
    from damperfit.units.shown_units import ShownUnits

__all__ = [
    "Circumstance",
    "circumstances",
    "have_common_logs",
    "identical_settings",
]


_SAME = 1e-9  # 4.6bara and 460000 are one pressure, but for the last digit
_WARMER = 2.0  # degC; forces fall as the oil thins
_GAS = ("gas_",)
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
    first: ComparedRun, second: ComparedRun, units: ShownUnits = SI
) -> tuple[Circumstance, ...]:
    """Return what two runs differ in, what matters most first.

    Parameters
    ----------
    first, second : ComparedRun
        The reference and the other.
    units : ShownUnits
        In which forces are told.
    """
    return (
        *_logs(first, second),
        *_identity(first, second),
        *_settings(first, second),
        *_damper(first, second, units),
        *_motion(first, second, units),
        *_temperature(first, second),
        *_how(first, second),
        *_version(first, second),
    )


def _differs(kind: str, what: str, a: object, b: object) -> Circumstance:
    return Circumstance(kind, str(a), str(b), f"{what}: {a}, then {b}")


def _logs(first: ComparedRun, second: ComparedRun) -> Iterator[Circumstance]:
    known = [_hashes(run) for run in (first, second)]
    common = known[0].keys() & known[1].keys()
    if common:
        names = _first_names(sorted(known[0][one] for one in common))
        yield Circumstance(
            "logs",
            first.name,
            second.name,
            f"both are based on the same logs ({names}): what differs there "
            "is how they were evaluated, and the errors, which are those of two tests, are too "
            "large",
        )
        yield from _directions(first, second)


def _directions(first: ComparedRun, second: ComparedRun) -> Iterator[Circumstance]:
    """Yield logs of both that were read with other signs; older runs do not tell theirs."""
    before, after = (_reversed(run) for run in (first, second))
    turned: dict[tuple[str, str], list[str]] = {}
    for one in before.keys() & after.keys():
        (name, signs), (_, others) = before[one], after[one]
        if signs != others:
            turned.setdefault((signs, others), []).append(name)
    for (signs, others), names in sorted(turned.items()):
        is_stroke = ("displacement" in signs) is not ("displacement" in others)
        yield Circumstance(
            "rig",
            signs,
            others,
            f"reversed as counted positive in bump: {signs} in {first.name}, {others} in "
            f"{second.name} ({_first_names(sorted(names))}): what is "
            f"{'rebound' if is_stroke else 'positive'} in one is "
            f"{'bump' if is_stroke else 'negative'} in the other; declare rig.reverse_displacement "
            "and rig.reverse_force",
        )


def _reversed(run: ComparedRun) -> dict[str, tuple[str, str]]:
    """Return name and reversed channels of each log, by its hash."""
    return {
        str(one["sha256"]): (
            str(one.get("log")),
            " and ".join(map(str, one["reversed"])) or "nothing",
        )
        for one in _inputs(run)
        if isinstance(one.get("reversed"), list)
    }


def _first_names(names: Sequence[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more


def have_common_logs(first: ComparedRun, second: ComparedRun) -> bool:
    """Whether any log stands behind both."""
    return bool(_hashes(first).keys() & _hashes(second).keys())


def identical_settings(runs: Sequence[ComparedRun], settings: Sequence[Setting]) -> list[Setting]:
    """Return the settings at which all runs have the same logs, byte for byte."""
    known: list[dict[int | str, set[str]]] = []
    for run in runs:
        known.append({})
        for one in _inputs(run):
            known[-1].setdefault(one["setting"], set()).add(str(one["sha256"]))
    first, *others = known
    return [
        setting
        for setting in settings
        if setting.cell in first
        and all(first[setting.cell] == one.get(setting.cell) for one in others)
    ]


def _hashes(run: ComparedRun) -> dict[str, str]:
    return {str(one["sha256"]): str(one.get("log")) for one in _inputs(run)}


def _inputs(run: ComparedRun) -> Iterator[Mapping[str, Any]]:
    """Yield the logs that a run is based on, as its record has them."""
    inputs = run.record.get("inputs")
    for one in inputs if isinstance(inputs, list) else ():
        if isinstance(one, dict) and one.get("sha256") and one.get("setting") is not None:
            yield one


def _identity(first: ComparedRun, second: ComparedRun) -> Iterator[Circumstance]:
    tested = [_section(run.record, "test") for run in (first, second)]
    for key in _WHOSE:
        a, b = (str(one.get(key) or "") for one in tested)
        if a and b and a != b:
            yield _differs("identity", key, a, b)


def _settings(first: ComparedRun, second: ComparedRun) -> Iterator[Circumstance]:
    alone = [set(a.settings) - set(b.settings) for a, b in ((first, second), (second, first))]
    names = [listed_settings(own) for own in alone]
    for run, own in zip((first, second), alone, strict=True):
        if own:
            sentence = f"{of_settings(own)} only in {run.name}: not compared"
            yield Circumstance("settings", names[0], names[1], sentence)


def _section(record: Mapping[str, Any], *path: str) -> Mapping[str, Any]:
    for key in path:
        found = record.get(key)
        record = found if isinstance(found, dict) else {}
    return record


def _damper(first: ComparedRun, second: ComparedRun, units: ShownUnits) -> Iterator[Circumstance]:
    if first.fitted is None or second.fitted is None:
        return
    a, b = first.fitted.damper, second.fitted.damper
    if a.name != b.name:
        sentence = f"model: {a.name}, then {b.name}: only forces are compared, not parameters"
        yield Circumstance("model", a.name, b.name, sentence)
        return
    yield from _quantities(first.fitted, second.fitted)
    for name, (_, _, unit) in a.ranges.items():
        here, there = (getattr(one, name, None) for one in (a, b))
        if isinstance(here, float) and isinstance(there, float):
            if math.isclose(here, there, rel_tol=_SAME):
                continue
            kind = "gas" if name.startswith(_GAS) else "damper"
            said = [f"{one:.6g} {unit}".strip() for one in (here, there)]
            yield _differs(kind, f"damper.{name}", said[0], said[1])
    yield from _gas_force(a, b, units)


def _quantities(first: Run, second: Run) -> Iterator[Circumstance]:
    names = [", ".join(one.damper.names) for one in (first, second)]
    if names[0] != names[1]:
        sentence = "the models have different quantities: those with the same name are compared"
        yield Circumstance("model", names[0], names[1], sentence)
    others = {one.name: one.unit for one in second.quantities}
    for one in first.quantities:
        other = others.get(one.name, one.unit)
        if one.unit != other:
            found = _differs("model", f"unit of {one.name}", one.unit, other)
            said = f"{found.sentence}: it is not compared"
            yield Circumstance("model", found.first, found.second, said)


def _gas_force(a: Model, b: Model, units: ShownUnits) -> Iterator[Circumstance]:
    forces = [float(one) for model in (a, b) if (one := model.rest_force(0.0)) is not None]
    if len(forces) < 2 or math.isclose(forces[0], forces[1], rel_tol=_SAME):
        return
    form = ".1f" if units.of("N") == "N" else ".3g"
    said = [units.write(one, "N", form) for one in forces]
    apart = units.write(forces[1] - forces[0], "N", f"+{form}")
    yield Circumstance(
        "gas",
        said[0],
        said[1],
        f"gas force at mid-stroke: {said[0]}, then {said[1]}: {apart} of "
        "every difference of force is the declared gas",
    )


def _motion(first: ComparedRun, second: ComparedRun, units: ShownUnits) -> Iterator[Circumstance]:
    settings = set(first.settings) & set(second.settings)
    motions = [
        [(t.amplitude, t.frequency) for s in settings for t in run.at(s)[:1]]
        for run in (first, second)
    ]
    if not all(motions):
        sines = [run.fitted.motion for run in (first, second) if run.fitted is not None]
        if len(sines) < len(motions):
            return
        motions = [[(sine.amplitude, sine.frequency)] for sine in sines]
    middle = [tuple(median(one[k] for one in tests) for k in (0, 1)) for tests in motions]
    if any(map(math.isnan, (*middle[0], *middle[1]))):
        return
    if any(abs(b / a - 1.0) > SAME_MOTION for a, b in zip(*middle, strict=True)):
        said = [units.say_lengths(f"{1e3 * a:.4g} mm at {f:.4g} Hz") for a, f in middle]
        yield Circumstance(
            "motion",
            said[0],
            said[1],
            f"motion: {said[0]}, then {said[1]}: what a model misses does not cancel",
        )


def _temperature(first: ComparedRun, second: ComparedRun) -> Iterator[Circumstance]:
    temperatures = [
        [test.temperature for test in run.tests if math.isfinite(test.temperature)]
        for run in (first, second)
    ]
    if all(temperatures):
        a, b = (sum(one) / len(one) for one in temperatures)
        if abs(a - b) > _WARMER:
            yield _differs("temperature", "temperature", f"{a:.1f} degC", f"{b:.1f} degC")


def _how(first: ComparedRun, second: ComparedRun) -> Iterator[Circumstance]:
    for (section, key), (kind, words) in _HOW.items():
        a, b = (_section(run.record, "configuration", section).get(key) for run in (first, second))
        if a is not None and b is not None and a != b:
            yield _differs(kind, words, _said(a), _said(b))


def _said(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{key} = {one}" for key, one in value.items()) or "none"
    return str(value)


def _version(first: ComparedRun, second: ComparedRun) -> Iterator[Circumstance]:
    for key, words in (("version", "damperfit"), ("schema_version", "schema of the results")):
        a, b = (run.record.get(key) for run in (first, second))
        if a is not None and b is not None and a != b:
            found = _differs("version", words, a, b)
            old = min((one for one in (a, b) if isinstance(one, int)), default=SCHEMA_VERSION)
            if key == "schema_version" and old < SCHEMA_VERSION:
                said = f"{found.sentence}; what the older run lacks is not compared"
                found = Circumstance("version", found.first, found.second, said)
            yield found
