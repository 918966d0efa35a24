"""What is done with the logs that were read before they are fitted: sorted, checked, held out.

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
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from damperfit.conditioning import TRANSIENTS, transients
from damperfit.conditioning.duplicates import (
    REPEATS,
    contradiction,
    copies_in,
    is_same_test,
    rod_area_ratio,
)
from damperfit.damper.warmed import BETA, Warmed
from damperfit.errors import ConfigurationError, ContradictionError, LogError, mishap_of
from damperfit.identification.unlike_motions import contradictory_motions
from damperfit.problem import Failure, Option, Problem, listed_names
from damperfit.recording import natural_order
from damperfit.run.log_files import expand, real_path
from damperfit.run.logs import LogBatch
from damperfit.uncertainty import SegmentRange, split_cycles

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model
    from damperfit.identification import Campaign
    from damperfit.recording import Trace
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import HoldOutOptions, Prediction


_MANY = 20
_ROD_OFF = 0.05  # an area of the rod that is further off is another's
# K between the coldest and the warmest log. At 1 to 4 % a kelvin the viscosity then changes by 3 to
# 12 %, where settings repeat within a few per cent.
_LEAST_WARMING = 3.0
_COVARIATE = Option("covariate", "temperature")
_NO_FIT = (
    "has no fit, and no joint fit of others that have its clicks; fit settings that have them "
    "together{joint}, give another log of it to fit, or hold out some of its cycles{cycles}"
)


# Logs of several dampers


def by_damper(batch: LogBatch) -> dict[str, LogBatch]:
    """Return the logs of each damper, by serial number or name.

    Where no log or one damper alone is named there is one entry. Logs that say nothing then count
    as that damper's, which is said; beside several dampers they fail.

    Parameters
    ----------
    batch : LogBatch
        Everything that was read.
    """
    owners = {
        log.log: identity.owner if (identity := batch.identities.get(log.log)) else ""
        for log in batch.logs
    }
    named = sorted(set(owners.values()) - {""}, key=natural_order)
    nameless = {log: owner for log, owner in owners.items() if not owner}
    if len(named) <= 1:
        remarks = batch.remarks
        if named and nameless:
            logs = listed_names(list(nameless), few=5)
            remark = f"{logs}: assumed to belong to damper {named[0]}, like the others"
            remarks = (*remarks, remark)
        return {named[0] if named else "": replace(batch, remarks=remarks)}
    failed = {failure.log for failure in batch.failures}
    lost = [
        Failure(
            Problem(
                "no-owner",
                "the log does not say which damper it belongs to, and there are "
                f"{listed_names(named, few=5)}; give it a line '# serial: {named[0]}' or a row in "
                "tests.csv",
                subject=log.log,
            ),
            *(LogError.__name__, log.log, log.path, log.facts.get("setting")),
        )
        for log in batch.logs
        if log.log in nameless and log.log not in failed
    ]
    groups = {}
    for owner in named:
        mine = {log for log, whose in owners.items() if whose == owner}
        failures = tuple(failure for failure in batch.failures if failure.log in mine)
        groups[owner] = LogBatch(
            tuple(trace for trace in batch.traces if trace.name in mine),
            tuple(log for log in batch.logs if log.log in mine),
            failures,
            n_good=len(mine) - len(failures),
            identities={log: one for log, one in batch.identities.items() if log in mine},
        )
    first = groups[named[0]]
    nobodys = (failure for failure in batch.failures if failure.log in nameless)
    groups[named[0]] = replace(
        first,
        failures=(*first.failures, *nobodys, *lost),
        remarks=batch.remarks,
        notes=batch.notes,
        skipped=batch.skipped,
        logs=(*first.logs, *(log for log in batch.logs if log.log in nameless)),
    )
    return groups


def of_one_damper(batch: LogBatch) -> LogBatch:
    """Return the batch where its logs are of one damper.

    Raises
    ------
    ConfigurationError
        They are of several.
    """
    groups = by_damper(batch)
    if len(groups) > 1:
        raise ConfigurationError(
            f"logs of {len(groups)} dampers: {listed_names(list(groups), few=5)}; give the logs of "
            "one, or let damperfit identify on the command line give each a result"
        )
    return next(iter(groups.values()))


def folder_name(owner: str) -> str:
    """Return the name of a damper's folder: its serial number, in letters that every disk takes.

    Examples
    --------
    >>> folder_name("SN 12/34"), folder_name("..")
    ('SN_12_34', 'damper')
    """
    return re.sub(r"[^\w.-]+", "_", owner).strip("._") or "damper"


# Logs of one setting beside each other


def once_each(batch: LogBatch) -> LogBatch:
    """Return the batch with each test once; a test under two settings is a failure of both."""
    copies = copies_in(batch.traces, {log.log: log.path for log in batch.logs})
    again = {id(copy) for several in copies.values() for copy in several}
    firsts = {trace.name: trace for trace in batch.traces if id(trace) not in again}
    failures, remarks = [], []
    for name, several in copies.items():
        elsewhere = [copy for copy in several if copy.setting != firsts[name].setting]
        if elsewhere:
            tests = [f"{copy.name} setting {copy.setting}" for copy in (firsts[name], *elsewhere)]
            text = (
                f"the same test under several settings: {listed_names(tests)}; check which is "
                "right and leave out the rest"
            )
            failures.append(Failure(Problem("two-settings", text), ContradictionError.__name__))
            del firsts[name]
            continue
        n = len(several) - 1
        others = f" and {n} other log{'s' * (n > 1)}" if n else ""
        remarks.append(f"{several[0].name}{others}: the same test as {name}; it counts once")
    if (n := len(remarks) - _MANY) > 0:
        more = f"and so do {n} other tests that were given several times"
        remarks[_MANY:] = [more]
    return replace(
        batch,
        traces=tuple(firsts.values()),
        failures=(*batch.failures, *failures),
        remarks=(*batch.remarks, *remarks),
    )


def without_copies(
    batch: LogBatch, held_out: Sequence[Trace]
) -> tuple[LogBatch, tuple[Trace, ...]]:
    """Return the batch, and what is held out without the tests that are fitted by another name."""
    kept, remarks = [], list(batch.remarks)
    for trace in held_out:
        others = (one for one in batch.traces if one.name != trace.name)
        first = next((one for one in others if is_same_test(one, trace)), None)
        if first is None:
            kept.append(trace)
            continue
        remarks.append(
            f"{trace.name}: the same test as {first.name}, which is fitted; it is not held out"
        )
    return replace(batch, remarks=tuple(remarks)), tuple(kept)


def without_contradictions(
    batch: LogBatch, *, is_averaging: bool, is_warmed: bool = False
) -> LogBatch:
    """Return the batch without the settings whose logs contradict each other, which fail.

    Parameters
    ----------
    batch : LogBatch
        What was read.
    is_averaging : bool
        Such logs are to be fitted together all the same; then it is only said.
    is_warmed : bool
        What temperature does is fitted: logs of different temperatures may differ.
    """
    sentences, remarks = {}, list(batch.remarks)
    for setting, traces in _by_setting(batch).items():
        worst = contradiction(traces, is_warmed=is_warmed)
        if worst and worst.excess > 1.0:
            sentences[setting] = worst.sentence
        elif worst:
            remarks.append(
                f"setting {setting}: {worst.sentence}; fitted together, as one damper repeats "
                f"within {100.0 * REPEATS:g} %: leave one out if the setting or the damper differs"
            )
    batch = replace(batch, remarks=tuple(remarks))
    return _without(batch, sentences, is_averaging=is_averaging)


def without_contradictory_motions(batch: LogBatch, configuration: Configuration) -> LogBatch:
    """Return the batch without the settings whose logs of other motions contradict each other.

    Parameters
    ----------
    batch : LogBatch
        What was read; logs of one motion have been compared.
    configuration : Configuration
        The model, how it is fitted, and whether such logs are averaged.
    """
    damper, options = configuration.damper, configuration.identification
    sentences = {
        setting: sentence
        for setting, traces in _by_setting(batch).items()
        if (sentence := contradictory_motions(traces, damper, options))
    }
    return _without(batch, sentences, is_averaging=configuration.rig.is_averaging)


def _by_setting(batch: LogBatch) -> dict[Setting, list[Trace]]:
    groups: dict[Setting, list[Trace]] = defaultdict(list)
    for trace in batch.traces:
        if trace.setting is not None:
            groups[trace.setting].append(trace)
    return groups


def _without(batch: LogBatch, sentences: Mapping[Setting, str], *, is_averaging: bool) -> LogBatch:
    """Return the batch without these settings, which fail, or with a word on them."""
    if is_averaging:
        remarks = (f"setting {one}: {sentence}; averaged" for one, sentence in sentences.items())
        return replace(batch, remarks=(*batch.remarks, *remarks))
    average = Option("rig", "average", "contradictions")
    failures = [
        Failure(
            Problem(
                "logs-differ",
                "{sentence}, more than their scatter; check whether the setting or the damper "
                "differs, leave one out, or fit them together by {average}",
                subject=f"setting {setting}",
                values={"sentence": sentence, "average": average},
            ),
            ContradictionError.__name__,
            setting=setting,
        )
        for setting, sentence in sentences.items()
    ]
    kept = tuple(trace for trace in batch.traces if trace.setting not in sentences)
    return replace(batch, traces=kept, failures=(*batch.failures, *failures))


def with_rod_remark(batch: LogBatch, damper: Model) -> LogBatch:
    """Return the batch with a word where the pressures tell of another rod than is declared."""
    ratio = rod_area_ratio(batch.traces, damper)
    if ratio is None or abs(ratio - 1.0) <= _ROD_OFF:
        return batch
    remark = (
        "the level of the force over the gas pressures of the tests corresponds to a rod of "
        f"{ratio:.3g} times the declared area: check rod_diameter, the pressures, and whether the "
        "force was tared between the tests"
    )
    return replace(batch, remarks=(*batch.remarks, remark))


# Logs of several temperatures


def check_temperatures(configuration: Configuration, traces: Iterable[Trace]) -> None:
    """Refuse logs without a temperature where the damper follows it.

    Before logs are asked whether they contradict each other: cold and warm ones do, unless it is
    known that they are.

    Raises
    ------
    ConfigurationError
        A log has no temperature.
    """
    lacking = [trace.name for trace in traces if trace.temperature is None]
    if lacking and isinstance(configuration.damper, Warmed):
        more = f" and {len(lacking) - 1} more" if len(lacking) > 1 else ""
        raise ConfigurationError(
            f"{lacking[0]}{more} {'have' if more else 'has'} no "
            "temperature; expected a channel, a line '# temperature: 31', a column of tests.csv or "
            "tested_at in a profile",
            where=_COVARIATE,
        )


def with_reference(configuration: Configuration, traces: Sequence[Trace]) -> Configuration:
    """Return the configuration with the temperature that the damper's resistances are told for.

    Parameters
    ----------
    configuration : Configuration
        Of a damper that follows the temperature, or of any other, which stays as it is.
    traces : sequence of Trace
        What is fitted; each has a temperature.

    Raises
    ------
    ConfigurationError
        All logs have nearly the same temperature, or whatever it does could be the setting's.
    """
    damper = configuration.damper
    if not isinstance(damper, Warmed) or not traces:
        return configuration
    by_setting: dict[str, list[float]] = defaultdict(list)
    for trace in traces:
        if trace.temperature is not None:
            by_setting[str(trace.setting)].append(trace.temperature)
    temperatures = [one for several in by_setting.values() for one in several]
    if _reach(temperatures) < _LEAST_WARMING:
        ends = dict.fromkeys(f"{one:.1f}" for one in (min(temperatures), max(temperatures)))
        raise ConfigurationError(
            f"the logs are {'all ' * (len(ends) == 1)}of {' to '.join(ends)} degC; "
            f"the effect of temperature cannot be determined over less than "
            f"{_LEAST_WARMING:g} K: test colder or warmer too, or leave the option out",
            where=_COVARIATE,
        )
    _check_determined(configuration, damper, by_setting)
    reference = damper.reference
    if math.isnan(reference):
        reference = round(sum(temperatures) / len(temperatures), 1)
    document = dict(configuration.document)
    document["damper"] = {**document["damper"], "reference_temperature": reference}
    return replace(configuration, damper=replace(damper, reference=reference), document=document)


def _reach(temperatures: Sequence[float]) -> float:
    return max(temperatures) - min(temperatures)


def _check_determined(
    configuration: Configuration, damper: Warmed, by_setting: Mapping[str, Sequence[float]]
) -> None:
    """Refuse logs in which whatever temperature does could as well be the setting's."""
    options = configuration.identification
    if BETA.name in options.fixed:
        return
    alone = [one for one, known in by_setting.items() if _reach(known) < _LEAST_WARMING]
    if options.procedure == "plain" and alone:
        raise ConfigurationError(
            f"setting {alone[0]} was tested within {_LEAST_WARMING:g} K, "
            "and procedure plain fits each setting by itself, so that beta cannot be determined "
            "there: take procedure joint, with one beta for all settings, or leave the option out",
            where=_COVARIATE,
        )
    is_open = options.is_detecting or bool(options.follows)
    names = damper.viscous
    is_own = {*(options.share or ()), *options.fixed}.isdisjoint(names)
    if options.procedure == "joint" and len(alone) == len(by_setting) and is_own and not is_open:
        raise ConfigurationError(
            f"each setting was tested within {_LEAST_WARMING:g} K, and "
            f"{' and '.join(names)} are each setting's own, so that beta cannot be determined: "
            "test one setting cold and warm, or share one of them ({share})",
            share=Option("share"),
            where=_COVARIATE,
        )


# What is held out


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Parted:
    """Logs in two parts.

    Attributes
    ----------
    batch : LogBatch
        All logs; its traces are those to fit, its failures hold the logs that could not be parted.
    held_out : tuple of Trace
        To be predicted.
    is_asked : bool
        Whether the user said what to hold out; else it is what moves beside the steady cycles.
    """

    batch: LogBatch
    held_out: tuple[Trace, ...] = ()
    is_asked: bool = True


def named_files(patterns: Iterable[str], paths: Sequence[Path]) -> dict[str, tuple[Path, ...]]:
    """Return the files that each pattern names: among the logs, else beside them.

    A pattern that names neither is not refused here: it may fit one test of a file of several.

    Parameters
    ----------
    patterns : iterable of str
        What to hold out.
    paths : sequence of pathlib.Path
        The logs.
    """
    known = {real_path(path): path for path in paths}
    named: dict[str, tuple[Path, ...]] = {}
    for pattern in filter(_is_of_files, patterns):
        named[pattern] = tuple(path for path in paths if _fits(pattern, path.name, str(path)))
        if not named[pattern]:
            try:
                beside = expand([pattern])
            except ConfigurationError:
                continue
            named[pattern] = tuple(known.get(real_path(path), path) for path in beside)
    return named


def fitting(
    batch: LogBatch, options: HoldOutOptions, named: Mapping[str, Sequence[Path]]
) -> HoldOutOptions:
    """Return the options with the patterns alone that fit a log of the batch."""
    patterns = tuple(
        one
        for one in options.patterns
        if one == TRANSIENTS or _hits(one, batch, named) or _segments(batch.traces, one)[1]
    )
    return replace(options, patterns=patterns)


def part(batch: LogBatch, options: HoldOutOptions, named: Mapping[str, Sequence[Path]]) -> Parted:
    """Part what was read into what is fitted and what is predicted, but for transients.

    Parameters
    ----------
    batch : LogBatch
        Everything that was read.
    options : HoldOutOptions
        What to hold out.
    named : mapping of str to sequence of pathlib.Path
        What `named_files` found for the patterns; all of it was read.

    Raises
    ------
    ConfigurationError
        A pattern fits nothing, or no log is left to fit.
    """
    names: set[str] = set()
    for pattern in filter(_is_of_files, options.patterns):
        hits = _hits(pattern, batch, named)
        if not hits:
            raise ConfigurationError(
                "matches no log and names no other file; quote a pattern, as "
                "in {hold_out}, and leave the held-out logs among LOGS or out of them",
                hold_out=Option("hold_out", "'*_16mm.csv'"),
                where=Option("hold_out", pattern),
            )
        names |= hits
    held_out = [trace for trace in batch.traces if trace.name in names]
    remaining = [trace for trace in batch.traces if trace.name not in names]
    for pattern in options.patterns:
        if pattern == TRANSIENTS or _is_of_files(pattern):
            continue
        remaining, within = _segments(remaining, pattern)
        if not within:
            raise ConfigurationError(
                "no log has a segment within these limits", where=Option("hold_out", pattern)
            )
        held_out += within
    if (held_out and not remaining) or (names and names == {log.log for log in batch.logs}):
        raise ConfigurationError("hold-out: every log is held out; none is left to fit")
    fitted: list[Trace] = []
    failures = list(batch.failures)
    for trace in remaining:
        try:
            rest, last = split_cycles(trace, options.cycles) if options.cycles else (trace, None)
        except Exception as error:  # noqa: BLE001 - the other logs go on
            failures.append(
                _failure(batch, trace, mishap_of(error, f"holding out cycles of {trace.name}"))
            )
            continue
        fitted.append(rest)
        held_out.extend([last] if last is not None else [])
    left = replace(batch, traces=tuple(fitted), failures=tuple(failures))
    return Parted(left, tuple(held_out))


def with_transients(parted: Parted, options: HoldOutOptions) -> Parted:
    """Hold out what moves beside the steady cycles of the logs that are left to fit.

    After copies and contradictions are gone, for a log that is not fitted has no rest to predict.

    Raises
    ------
    ConfigurationError
        Transients are asked for, and no log has any.
    """
    is_asked = TRANSIENTS in options.patterns
    if not is_asked and (options.patterns or options.cycles):
        return parted
    fitted = parted.batch.traces
    beside = tuple(one for one in map(transients, fitted) if one is not None)
    if is_asked and fitted and not beside:
        raise ConfigurationError(
            "hold-out transients: no log has a run-up or coast-down from or to rest, or changes "
            "its speed between steady cycles; give one that does, or hold out another log"
        )
    return replace(parted, held_out=(*parted.held_out, *beside), is_asked=is_asked)


def note_unpredicted(
    parted: Parted,
    campaign: Campaign,
    predictions: Sequence[Prediction],
    known: Sequence[Failure] = (),
) -> LogBatch:
    """Return the batch with the held-out logs that could not be predicted among its failures.

    Logs of which it is known already why are not said again. What nobody asked to hold out is no
    failure: a remark says so, where the setting is fitted.
    """
    batch = parted.batch
    done = {id(prediction.trace) for prediction in predictions}
    failed = {failure.log for failure in known}
    fitted = {fit.setting for fit in campaign.fits}
    lost = [trace for trace in parted.held_out if id(trace) not in done]
    if not parted.is_asked:
        remarks = (
            f"{trace.name}: the motion beside its steady cycles cannot be simulated with the "
            "fitted parameters, so it is not predicted"
            for trace in lost
            if trace.setting in fitted
        )
        return replace(batch, remarks=(*batch.remarks, *remarks))
    failures = (
        _failure(batch, trace, _unpredicted(trace, is_fitted=trace.setting in fitted))
        for trace in lost
        if trace.name not in failed
    )
    return replace(batch, failures=(*batch.failures, *failures))


def _is_of_files(pattern: str) -> bool:
    return pattern != TRANSIENTS and SegmentRange.parse(pattern) is None


def _hits(pattern: str, batch: LogBatch, named: Mapping[str, Sequence[Path]]) -> set[str]:
    files = {str(path) for path in named.get(pattern, ())}
    return {log.log for log in batch.logs if log.path in files or _fits(pattern, log.log)}


def _fits(pattern: str, *names: str) -> bool:
    return any(name == pattern or fnmatchcase(name, pattern) for name in names)


def _segments(traces: Sequence[Trace], pattern: str) -> tuple[list[Trace], list[Trace]]:
    """Return the logs without the segments of a range, and with these alone."""
    limits = SegmentRange.parse(pattern)
    if limits is None:
        return list(traces), []
    parts = [limits.split(trace) for trace in traces]
    fitted, held = ([trace for trace in side if trace] for side in zip(*parts, strict=True))
    return fitted, held


def _unpredicted(trace: Trace, *, is_fitted: bool) -> Failure:
    kind, why = "PredictionError", _NO_FIT
    if is_fitted:
        kind, why = "SimulationError", "cannot be simulated on it"
    text = f"held out, but cannot be predicted: setting {trace.setting} {why}"
    ways = {
        "joint": Option("procedure", "joint", is_aside=True),
        "cycles": Option("hold_out_cycles", is_aside=True),
    }
    return Failure(Problem("not-predicted", text, subject=trace.name, values=ways), kind)


def _failure(batch: LogBatch, trace: Trace, mishap: Failure) -> Failure:
    return replace(mishap, log=trace.name, path=batch.path_of(trace.name), setting=trace.setting)
