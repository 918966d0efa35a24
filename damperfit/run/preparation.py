"""Logs before they are fitted: each damper's own, checked against each other, some held out.

Logs of several dampers get a result each, never one together. Copies count once, contradictions
cost their setting. Where the damper follows the temperature, the logs must show what it does. What
is held out is named by patterns: a pattern picks among the logs by name or path; one that picks
none names further files, which are read for prediction only. A range, as in `4Hz-10Hz` or
`0.2m/s-`, holds out the segments whose frequency or peak speed lies within it. The word
`transients` stands for what moves beside the steady cycles of the logs that are fitted: run-up,
coast-down, changes of speed. Where nothing else is held out, they are, in the logs that have them.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from damperfit.conditioning.duplicates import (
    REPEATS,
    contradiction,
    copies_in,
    is_same_test,
    rod_area_ratio,
)
from damperfit.conditioning.segments import TRANSIENTS, transients
from damperfit.configuration.options import Configuration
from damperfit.damper.temperature_law import BETA, WithTemperature
from damperfit.errors import ConfigurationError, ContradictionError, LogError, failure_of
from damperfit.identification.options import HoldOutOptions
from damperfit.identification.procedures import Campaign
from damperfit.identification.unlike_motions import contradictory_motions
from damperfit.problem import Failure, Option, Problem, counted, listed_names, note, warning
from damperfit.recording import Trace, natural_order
from damperfit.run.log_files import expand, real_path
from damperfit.run.logs import LogBatch
from damperfit.tested.setting import Setting
from damperfit.uncertainty.grades import Prediction, SegmentRange, split_cycles

_MANY = 20
_ROD_OFF = 0.05  # an area of the rod that is further off is another's
_GAS_OFF = 0.01  # of the pressure: below it no force differs that anyone would see
# K between the coldest and the warmest log. At 1 to 4 % a kelvin the viscosity then changes by 3 to
# 12 %, where settings repeat within a few per cent.
_LEAST_WARMING = 3.0


# Logs of several dampers


def by_damper(batch: LogBatch, *, is_one: bool = False) -> dict[str, LogBatch]:
    """Return the logs of each damper, by serial number or name; with ``is_one`` there may be one.

    Where no log or one damper alone is named there is one entry. Logs that say nothing then count
    as that damper's, which is said; beside several dampers they fail. A log that cannot be used
    makes no damper of its own.
    """
    owners = {log.log: log.identity.owner for log in batch.logs}
    usable = {log.identity.owner for log in batch.logs if log.failure is None}
    named = sorted(usable - {""}, key=natural_order)
    if len(named) <= 1:
        if named and "" in owners.values():
            logs = listed_names([log for log, owner in owners.items() if not owner], few=5)
            text = f"assumed to belong to damper {named[0]}, like the others"
            batch.remarks.append(warning("damper-assumed", text, logs))
        return {named[0] if named else "": batch}
    listed = listed_names(named, few=5)
    if is_one:
        raise ConfigurationError(
            f"logs of {len(named)} dampers: {listed}; give the logs of "
            "one, or let damperfit identify on the command line give each a result",
            code="several-dampers",
        )
    groups = {owner: LogBatch() for owner in named}
    first = groups[named[0]]
    first.remarks, first.notes, first.skipped = batch.remarks, batch.notes, batch.skipped
    text = (
        "the log does not say which damper it belongs to, and there are "
        f"{listed}; give it a line '# serial: {named[0]}' or a row in tests.csv"
    )
    # What is of none of the dampers stands behind the first one's own, and fails.
    others = [log for log in batch.logs if log.identity.owner not in groups]
    for log in (*(log for log in batch.logs if log.identity.owner in groups), *others):
        groups.get(log.identity.owner, first).logs.append(log)
    for trace in batch.traces:
        if owners[trace.name] in groups:
            groups[owners[trace.name]].traces.append(trace)
    for failure in sorted(batch.failures, key=lambda lost: owners.get(lost.log) not in groups):
        groups.get(owners.get(failure.log, ""), first).failures.append(failure)
    for log in (log for log in others if log.failure is None):
        whose = (LogError.__name__, log.log, log.path, log.facts.get("setting"))
        first.failures.append(Failure(Problem("no-owner", text, subject=log.log), *whose))
    return groups


def folder_name(owner: str) -> str:
    """Return the name of a damper's folder: its serial number, in letters that every disk takes.

    Examples
    --------
    >>> folder_name("SN 12/34"), folder_name("..")
    ('SN_12_34', 'damper')
    """
    return re.sub(r"[^\w.-]+", "_", owner).strip("._") or "damper"


# All steps, then each


def prepare(
    configuration: Configuration,
    batch: LogBatch,
    options: HoldOutOptions,
    named: Mapping[str, Sequence[Path]],
    *,
    is_law_open: bool = False,
) -> Configuration:
    """Part the logs of one damper, and leave out copies and contradictions among them.

    Returns the configuration with the temperature that resistances refer to. Where the law is
    open, what takes a model is left out.
    """
    part(batch, options, named)
    once_each(batch)
    if not is_law_open:
        check_temperatures(configuration, (*batch.traces, *batch.held_out))
    without_contradictions(batch, configuration, is_law_open=is_law_open)
    without_copies(batch)
    ratio = None if is_law_open else rod_area_ratio(batch.traces, configuration.damper)
    if ratio is not None and abs(ratio - 1.0) > _ROD_OFF:
        text = (
            "the level of the force over the gas pressures of the tests corresponds to a rod of "
            f"{ratio:.3g} times the declared area: check rod_diameter, the pressures, and whether "
            "the force was tared between the tests"
        )
        batch.remarks.append(warning("rod-area", text))
    stated = {log.gas_pressure for log in (*batch.traces, *batch.held_out)}
    if len(stated) == 1 and None not in stated and "gas_pressure" in configuration.undeclared:
        filled = configuration.with_damper(configuration.damper.filled_to(*stated))
        configuration = replace(filled, declared=filled.declared | {"damper.gas_pressure"})
        text = "damper.gas_pressure is that of the logs, which state one and the same"
        batch.remarks.append(note("gas-pressure", text))
    ours = getattr(configuration.damper, "gas_pressure", math.nan)
    tested = [log.gas_pressure for log in batch.traces if log.gas_pressure is not None]
    if tested and all(abs(pressure / ours - 1.0) > _GAS_OFF for pressure in tested):
        of_logs = " to ".join(dict.fromkeys(f"{1e-5 * f(tested):.3g}" for f in (min, max)))
        text = (
            f"the logs were tested with gas of {of_logs} bar absolute; forces at a speed are given "
            f"at the {1e-5 * ours:.3g} bar of damper.gas_pressure"
        )
        batch.remarks.append(warning("gas-pressure", text))
    hold_out_transients(batch, options)
    return configuration if is_law_open else with_reference(configuration, batch.traces)


def once_each(batch: LogBatch) -> None:
    """Keep each test once; a test under two settings is a failure of both."""
    copies = copies_in(batch.traces, {log.log: log.path for log in batch.logs})
    again = {id(copy) for several in copies.values() for copy in several}
    firsts = {trace.name: trace for trace in batch.traces if id(trace) not in again}
    remarks = []
    for name, several in copies.items():
        elsewhere = [copy for copy in several if copy.setting != firsts[name].setting]
        if elsewhere:
            tests = [f"{t.name} setting {t.setting}" for t in (firsts.pop(name), *elsewhere)]
            text = (
                f"the same test under several settings: {listed_names(tests)}; check which is "
                "right and leave out the rest"
            )
            failure = Failure(Problem("two-settings", text), ContradictionError.__name__)
            batch.failures.append(failure)
            continue
        n = len(several) - 1
        others = f" and {counted(n, 'other log')}" if n else ""
        text = f"the same test as {name}; it counts once"
        remarks.append(warning("duplicate", text, f"{several[0].name}{others}"))
    if (n := len(remarks) - _MANY) > 0:
        text = f"and so do {n} other tests that were given several times"
        remarks[_MANY:] = [warning("duplicate", text)]
    batch.traces = list(firsts.values())
    batch.remarks += remarks


def without_copies(batch: LogBatch) -> None:
    """Hold out no test that is fitted by another name."""
    kept = []
    for trace in batch.held_out:
        others = (other for other in batch.traces if other.name != trace.name)
        first = next((other for other in others if is_same_test(other, trace)), None)
        if first is None:
            kept.append(trace)
        else:
            text = f"the same test as {first.name}, which is fitted; it is not held out"
            batch.remarks.append(warning("duplicate", text, trace.name))
    batch.held_out = kept


# Findings of two settings in one record.
_LEVELS = "level_steps"
_TWO = {_LEVELS, "another_force"}
_MORE = "{}, more than their scatter"


def without_contradictions(
    batch: LogBatch, configuration: Configuration, *, is_law_open: bool = False
) -> None:
    """Leave out the settings whose logs contradict each other: of one motion, then of others.

    They fail or, where that is asked for, are averaged with a warning. Logs of different
    temperatures may differ where the effect of temperature is fitted.
    """
    damper, options, sentences = configuration.damper, configuration.identification, {}

    def by_setting() -> dict[Setting, list[Trace]]:
        groups: dict[Setting, list[Trace]] = defaultdict(list)
        for trace in batch.traces:
            if trace.setting is not None:
                groups[trace.setting].append(trace)
        return groups

    for setting, traces in by_setting().items():
        pairs = ((trace, finding) for trace in traces for finding in trace.findings)
        trace, parted = next((pair for pair in pairs if pair[1].code in _TWO), (None, None))
        worst = contradiction(traces, has_temperature_law=isinstance(damper, WithTemperature))
        is_worse = worst is not None and worst.excess > 1.0
        if trace and parted and (parted.code != _LEVELS or is_worse):
            sentences[setting] = f"{trace.name}: {parted.message()}"
        elif worst and is_worse:
            sentences[setting] = _MORE.format(worst.sentence)
        elif worst:
            text = (
                f"{worst.sentence}; fitted together, as one damper repeats "
                f"within {100.0 * REPEATS:g} %: leave one out if the setting or the damper differs"
            )
            batch.remarks.append(warning("logs-differ", text, f"setting {setting}"))
    _leave_out(batch, sentences, configuration)
    if not is_law_open:
        motions = {k: contradictory_motions(v, damper, options) for k, v in by_setting().items()}
        _leave_out(batch, {k: _MORE.format(v) for k, v in motions.items() if v}, configuration)


def _leave_out(
    batch: LogBatch, sentences: Mapping[Setting, str], configuration: Configuration
) -> None:
    if configuration.rig.contradictions == "average":
        batch.remarks += [
            warning("logs-differ", f"{text}; averaged", f"setting {setting}")
            for setting, text in sentences.items()
        ]
        return
    text = (
        "{sentence}; check whether the setting or the damper differs, leave one out, or fit them "
        "together by {average}"
    )
    average = Option("rig", "average", "contradictions")
    for setting, sentence in sentences.items():
        values = {"sentence": sentence, "average": average}
        problem = Problem("logs-differ", text, subject=f"setting {setting}", values=values)
        batch.failures.append(Failure(problem, ContradictionError.__name__, setting=setting))
    batch.traces = [trace for trace in batch.traces if trace.setting not in sentences]


# Logs of several temperatures


def _no_temperature(text: str, code: str = "no-temperature", **values: Any) -> ConfigurationError:
    where = Option("covariate", "temperature")
    return ConfigurationError(text, where=where, code=code, **values)


def check_temperatures(configuration: Configuration, traces: Iterable[Trace]) -> None:
    """Refuse logs without a temperature where the damper follows it.

    Before logs are asked whether they contradict each other: cold and warm ones do, unless it is
    known that they are.
    """
    lacking = [trace.name for trace in traces if trace.temperature is None]
    if lacking and isinstance(configuration.damper, WithTemperature):
        raise _no_temperature(
            f"{listed_names(lacking)} {'have' if len(lacking) > 1 else 'has'} no "
            "temperature; expected a channel, a line '# temperature: 31', a column of tests.csv or "
            "tested_at in a profile"
        )


def with_reference(configuration: Configuration, traces: Sequence[Trace]) -> Configuration:
    """Return the configuration with the temperature that the damper's resistances refer to.

    Refused are logs of nearly one temperature, or where whatever it does could be the setting's.
    """
    damper, options = configuration.damper, configuration.identification
    if not isinstance(damper, WithTemperature) or not traces:
        return configuration
    by_setting: dict[str, list[float]] = defaultdict(list)
    for trace in traces:
        if trace.temperature is not None:
            by_setting[str(trace.setting)].append(trace.temperature)
    temperatures = [value for several in by_setting.values() for value in several]
    if max(temperatures) - min(temperatures) < _LEAST_WARMING:
        limits = dict.fromkeys(f"{value:.1f}" for value in (min(temperatures), max(temperatures)))
        raise _no_temperature(
            f"the logs are {'all ' * (len(limits) == 1)}of {' to '.join(limits)} degC; "
            f"the effect of temperature cannot be determined over less than "
            f"{_LEAST_WARMING:g} K: test colder or warmer too, or leave the option out"
        )
    alone = [name for name, own in by_setting.items() if max(own) - min(own) < _LEAST_WARMING]
    if BETA.name not in options.fixed and options.procedure == "plain" and alone:
        raise _no_temperature(
            f"setting {alone[0]} was tested within {_LEAST_WARMING:g} K, "
            "and procedure plain fits each setting by itself, so that beta cannot be determined "
            "there: take procedure joint, with one beta for all settings, or leave the option out",
            "other-procedure",
        )
    adjusters = next((trace.setting.adjusters for trace in traces if trace.setting), ())
    is_open = BETA.name in options.fixed or bool(options.follows) or options.detects(adjusters)
    is_own = {*(options.share or ()), *options.fixed}.isdisjoint(damper.viscous)
    if options.procedure == "joint" and len(alone) == len(by_setting) and is_own and not is_open:
        raise _no_temperature(
            f"each setting was tested within {_LEAST_WARMING:g} K, and "
            f"{' and '.join(damper.viscous)} are each setting's own, so that beta cannot be "
            "determined: test one setting cold and warm, or share one of them ({share})",
            share=Option("share"),
        )
    reference = damper.reference
    if math.isnan(reference):
        reference = round(sum(temperatures) / len(temperatures), 1)
    document = dict(configuration.document)
    document["damper"] = {**document["damper"], "reference_temperature": reference}
    return replace(configuration, damper=replace(damper, reference=reference), document=document)


# What is held out


def named_files(patterns: Iterable[str], paths: Sequence[Path]) -> dict[str, tuple[Path, ...]]:
    """Return the files that each pattern names: among the logs, else beside them.

    A pattern that names neither is not refused here: it may fit one test of a file of several.
    """
    originals = {real_path(path): path for path in paths}
    named: dict[str, tuple[Path, ...]] = {}
    for pattern in filter(_is_of_files, patterns):
        named[pattern] = tuple(path for path in paths if _is_named(pattern, path.name, str(path)))
        if not named[pattern]:
            with suppress(ConfigurationError):
                others = expand([pattern])
                named[pattern] = tuple(originals.get(real_path(path), path) for path in others)
    return named


def fitting(
    batch: LogBatch, options: HoldOutOptions, named: Mapping[str, Sequence[Path]]
) -> HoldOutOptions:
    """Return the options with the patterns alone that fit a log of the batch."""

    def fits(pattern: str) -> bool:
        is_hit = pattern == TRANSIENTS or bool(_hits(pattern, batch, named))
        return is_hit or bool(_segments(batch.traces, pattern)[1])

    return replace(options, patterns=tuple(filter(fits, options.patterns)))


def part(batch: LogBatch, options: HoldOutOptions, named: Mapping[str, Sequence[Path]]) -> None:
    """Part what was read into what is fitted and what is predicted, but for transients."""
    names: set[str] = set()
    of_files = [pattern for pattern in options.patterns if _is_of_files(pattern)]
    for pattern in of_files:
        hits = _hits(pattern, batch, named)
        if not hits:
            raise ConfigurationError(
                "matches no log and names no other file; quote a pattern, as "
                "in {hold_out}, and leave the held-out logs among LOGS or out of them",
                hold_out=Option("hold_out", "'*_16mm.csv'"),
                where=Option("hold_out", pattern),
                code="no-such-file",
            )
        names |= hits
    held_out = [trace for trace in batch.traces if trace.name in names]
    remaining = [trace for trace in batch.traces if trace.name not in names]
    for pattern in options.patterns:
        if pattern == TRANSIENTS or pattern in of_files:
            continue
        remaining, within = _segments(remaining, pattern)
        if not within:
            where = Option("hold_out", pattern)
            text = "no log has a segment within these limits"
            raise ConfigurationError(text, where=where, code="no-segment")
        held_out += within
    if (held_out and not remaining) or (names and names == {log.log for log in batch.logs}):
        text = "hold-out: every log is held out; none is left to fit"
        raise ConfigurationError(text, code="nothing-to-fit")
    fitted: list[Trace] = []
    failures = []
    for trace in remaining:
        try:
            rest, last = split_cycles(trace, options.cycles) if options.cycles else (trace, None)
        except Exception as error:  # noqa: BLE001 - the other logs go on
            failure = failure_of(error, f"holding out cycles of {trace.name}")
            failures.append(_of_log(failure, trace, batch))
            continue
        fitted.append(rest)
        held_out += [] if last is None else [last]
    batch.traces, batch.held_out, batch.failures = fitted, held_out, [*batch.failures, *failures]


def hold_out_transients(batch: LogBatch, options: HoldOutOptions) -> None:
    """Hold out what moves beside the steady cycles of the logs that are left to fit.

    After copies and contradictions are gone, for a log that is not fitted has no rest to predict.
    """
    is_asked = TRANSIENTS in options.patterns
    if not is_asked and (options.patterns or options.cycles):
        return
    moving = [trace for trace in map(transients, batch.traces) if trace is not None]
    if is_asked and batch.traces and not moving:
        raise ConfigurationError(
            "hold-out transients: no log has a run-up or coast-down from or to rest, or changes "
            "its speed between steady cycles; give one that does, or hold out another log",
            code="no-transients",
        )
    batch.held_out, batch.is_asked = [*batch.held_out, *moving], is_asked


def note_unpredicted(
    batch: LogBatch,
    campaign: Campaign,
    predictions: Sequence[Prediction],
    reported: Sequence[Failure] = (),
) -> None:
    """Put the held-out logs that could not be predicted among the failures of the batch.

    Logs of which it is known already why are not said again. What is held out by default is no
    failure: a remark says so, where the setting is fitted.
    """
    done = {id(prediction.trace) for prediction in predictions}
    failed = {failure.log for failure in reported}
    fitted = {fit.setting for fit in campaign.fits}
    options = {
        "joint": Option("procedure", "joint", is_aside=True),
        "cycles": Option("hold_out_cycles", is_aside=True),
    }
    for trace in (trace for trace in batch.held_out if id(trace) not in done):
        kind, why = "SimulationError", "cannot be simulated on it"
        if trace.setting not in fitted:
            kind = "PredictionError"
            why = (
                "has no fit, and no joint fit of others that have its clicks; fit settings that "
                "have them together{joint}, give another log of it to fit, or hold out some of its "
                "cycles{cycles}"
            )
        if batch.is_asked and trace.name not in failed:
            text = f"held out, but cannot be predicted: setting {trace.setting} {why}"
            problem = Problem("not-predicted", text, subject=trace.name, values=options)
            batch.failures.append(_of_log(Failure(problem, kind), trace, batch))
        elif not batch.is_asked and trace.setting in fitted:
            text = (
                "the motion beside its steady cycles cannot be simulated with the fitted "
                "parameters, so it is not predicted"
            )
            batch.remarks.append(warning("not-predicted", text, trace.name))


def _of_log(failure: Failure, trace: Trace, batch: LogBatch) -> Failure:
    return replace(failure, log=trace.name, path=batch.path_of(trace.name), setting=trace.setting)


def _is_of_files(pattern: str) -> bool:
    return pattern != TRANSIENTS and SegmentRange.parse(pattern) is None


def _hits(pattern: str, batch: LogBatch, named: Mapping[str, Sequence[Path]]) -> set[str]:
    files = {str(path) for path in named.get(pattern, ())}
    return {log.log for log in batch.logs if log.path in files or _is_named(pattern, log.log)}


def _is_named(pattern: str, *names: str) -> bool:
    return any(name == pattern or fnmatchcase(name, pattern) for name in names)


def _segments(traces: Sequence[Trace], pattern: str) -> tuple[list[Trace], list[Trace]]:
    """Return the logs without the segments of a range, and with these alone."""
    limits = SegmentRange.parse(pattern)
    if limits is None or not traces:
        return list(traces), []
    parts = [limits.split(trace) for trace in traces]
    fitted, held = ([trace for trace in side if trace] for side in zip(*parts, strict=True))
    return fitted, held
