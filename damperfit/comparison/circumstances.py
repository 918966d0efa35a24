"""What two runs differ in besides their numbers, which may be the reason why these differ."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from statistics import fmean, median
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.comparison.measured import SAME_MOTION, tests_at
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.problem import listed_names
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.tested.setting import Setting

_TEMPERATURES_DIFFER = 2.0  # degC; forces fall as the oil thins
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
# Kinds of what differs, what matters most first.
_ORDER = (
    *("logs", "rig", "identity", "settings", "model", "damper", "gas", "motion", "temperature"),
    *("filter", "procedure", "version"),
)


class Circumstance(NamedTuple):
    """One thing that two runs differ in, or have in common, with the value of each."""

    kind: str  # logs, identity, settings, model, damper, gas, motion, temperature, rig, filter, ...
    first: str
    second: str
    sentence: str


def circumstances(
    first: Run, second: Run, units: ShownUnits = SI, *, is_bare: bool = False
) -> tuple[Circumstance, ...]:
    """Return what two runs differ in, what matters most first; is_bare: measured curves alone."""
    runs = (first, second)
    listed = [*_of_logs(first, second)]

    def differs(kind: str, name: str, a: str, b: str, consequence: str = "") -> None:
        listed.append(Circumstance(kind, a, b, f"{name}: {a}, then {b}{consequence}"))

    of_one_model = not is_bare and first.damper.name == second.damper.name
    facts, other_facts = (
        {
            name: fact
            for name, *fact in _facts(run, units, is_bare=is_bare, of_one_model=of_one_model)
        }
        for run in runs
    )
    for name, (kind, text, consequence) in facts.items():
        if name in other_facts and other_facts[name][1] != text:
            differs(kind, name, text, other_facts[name][1], consequence)
    tested = [settings_of(run, is_bare=is_bare) for run in runs]
    alone = [[setting for setting in tested[k] if setting not in tested[1 - k]] for k in (0, 1)]
    for run, settings in zip(runs, alone, strict=True):
        if settings:
            sentence = f"{of_settings(settings)} only in {run.name}: not compared"
            a, b = map(listed_settings, alone)
            listed.append(Circumstance("settings", a, b, sentence))
    common = [setting for setting in tested[0] if setting in tested[1]]
    motions = [
        [(test.amplitude, test.frequency) for s in common for test in tests_at(run, s)[:1]]
        for run in runs
    ]
    if not all(motions) and not is_bare:
        motions = [[(run.motion.amplitude, run.motion.frequency)] for run in runs]
    if all(motions):
        medians = [list(map(median, zip(*of_run, strict=True))) for of_run in motions]
        if any(abs(b / a - 1.0) > SAME_MOTION for a, b in zip(*medians, strict=True)):
            a, b = (
                f"{units.write_length(amplitude, '.4g')} at {frequency:.4g} Hz"
                for amplitude, frequency in medians
            )
            differs("motion", "motion", a, b, ": what a model misses does not cancel")
    logged = [[t.temperature for t in run.tests if math.isfinite(t.temperature)] for run in runs]
    means = [fmean(temperatures) for temperatures in logged if temperatures]
    if len(means) == len(runs) and abs(means[0] - means[1]) > _TEMPERATURES_DIFFER:
        differs("temperature", "temperature", *(f"{mean:.1f} degC" for mean in means))
    return tuple(sorted(listed, key=lambda fact: _ORDER.index(fact.kind)))


def _facts(  # noqa: C901, PLR0912 - one kind after the other
    run: Run, units: ShownUnits, *, is_bare: bool, of_one_model: bool
) -> Iterator[tuple[str, str, str, str]]:
    """Yield what may differ between runs: its name, kind and value, and what follows from it."""
    for key in _WHOSE:
        if owner := run.identity.get(key):
            yield key, "identity", str(owner), ""
    if not is_bare:  # of measured curves the damper need not be known
        yield "model", "model", run.damper.name, ": only forces are compared, not parameters"
    if of_one_model:
        damper = run.damper
        consequence = ": those with the same name are compared"
        yield f"quantities of {damper.name}", "model", ", ".join(damper.names), consequence
        for quantity in run.quantities:
            yield f"unit of {quantity.name}", "model", quantity.unit, ": it is not compared"
        for name, (_, _, unit) in damper.ranges.items():
            if isinstance(size := getattr(damper, name, None), float):
                kind = "gas" if name.startswith("gas_") else "damper"
                yield f"damper.{name}", kind, f"{size:.6g} {unit}".strip(), ""
    if not is_bare and math.isfinite(gas := gas_force(run)):
        force = units.write(gas, "N", ".1f" if units.of("N") == "N" else ".3g")
        consequence = ": this difference is part of every difference of force"
        yield "gas force at mid-stroke", "gas", force, consequence
    document = run.record.get("configuration")
    for (section, key), (kind, words) in _HOW.items():
        keys = document.get(section) if isinstance(document, dict) else None
        value: Any = keys.get(key) if isinstance(keys, dict) else None
        if isinstance(value, dict):
            value = [f"{name} = {_plain(entry)}" for name, entry in value.items()]
        if isinstance(value, list):
            value = ", ".join(map(_plain, value)) or "none"
        if value is not None:
            yield words, kind, _plain(value), ""
    consequence = "; what the older run lacks is not compared"
    for name, words, suffix in (
        ("version", "damperfit", ""), ("schema_version", "schema of the results", consequence),
    ):  # fmt: skip
        if (number := run.record.get(name)) is not None:
            yield words, "version", str(number), suffix


def _plain(value: object) -> str:
    """A value of a configuration: 60 and 60.0 are one."""
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def inputs_of(run: Run) -> list[tuple[str, dict[str, Any]]]:
    """Return the hash of each log that a run is based on, and the log as its record has it."""
    logs = [log for log in run.inputs if log.get("sha256") and log.get("setting") is not None]
    return [(str(log["sha256"]), log) for log in logs]


def _of_logs(first: Run, second: Run) -> Iterator[Circumstance]:
    """Yield that logs are in both, and which of these were read with other signs."""
    by_digest = [dict(inputs_of(run)) for run in (first, second)]
    common = by_digest[0].keys() & by_digest[1].keys()

    def named(digests: Sequence[str]) -> str:
        return listed_names(sorted(str(by_digest[0][digest].get("log")) for digest in digests))

    if common:
        all_logs = f"both are based on the same logs ({named([*common])})"
        some_logs = f"some logs are in both ({named([*common])}), where"
        is_all = by_digest[0].keys() == by_digest[1].keys()
        sentence = (
            f"{f'{all_logs}:' if is_all else some_logs} differences come from the evaluation only, "
            "and the errors, which assume two tests, are too large"
        )
        yield Circumstance("logs", first.name, second.name, sentence)
    turned: dict[tuple[str, str], list[str]] = {}
    for digest in common:
        signs = [logs[digest].get("reversed") for logs in by_digest]
        if all(isinstance(channels, list) for channels in signs) and signs[0] != signs[1]:
            a, b = (" and ".join(map(str, channels or ())) or "none" for channels in signs)
            turned.setdefault((a, b), []).append(digest)
    for (a, b), digests in sorted(turned.items()):
        is_stroke = ("displacement" in a) is not ("displacement" in b)
        words = ("rebound", "compression") if is_stroke else ("positive", "negative")
        yield Circumstance(
            "rig",
            a,
            b,
            f"reversed channels: {a} in {first.name}, {b} in {second.name} ({named(digests)}), so "
            f"that {words[0]} in one is {words[1]} in the other; "
            "declare rig.reverse_displacement and rig.reverse_force",
        )


def settings_of(run: Run, *, is_bare: bool) -> tuple[Setting, ...]:
    """Return the settings that were measured, or those that have parameters."""
    if is_bare:
        return tuple(sorted({test.setting for test in run.tests}))
    return tuple(stage.setting for stage in run.settings)


def gas_force(run: Run) -> float:
    """Return the force of the declared gas at mid-stroke, N, to nine digits; NaN: none is known."""
    force = run.damper.rest_force(0.0)
    return math.nan if force is None else float(f"{float(force):.9g}")
