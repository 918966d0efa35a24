"""Log files to traces, each read and conditioned; what cannot be becomes a `Failure` by itself."""

from __future__ import annotations

import logging
import os
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from damperfit.conditioning import examine_raw
from damperfit.conditioning.polarity import CONTRADICTED, UNKNOWN, reversed_in
from damperfit.errors import (
    ConfigurationError,
    InstallationError,
    LogError,
    QualityError,
    TimelessError,
    mishap_of,
)
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.io import is_tests_table, read_curves, read_logs
from damperfit.io.files import sha256_of
from damperfit.io.formats import FORMATS
from damperfit.problem import Failure, Option, Problem
from damperfit.recording import Finding
from damperfit.run.labelling import FROM_NAME, GUESSED, labels_for
from damperfit.run.own_tables import is_own_table
from damperfit.run.tested_at import conditioned_as_tested, facts_of
from damperfit.tables.documents import json_values
from damperfit.tested.identity import Identity
from damperfit.workers import apart

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.recording import Recording, Trace
    from damperfit.run.labelling import Labels
    from damperfit.tested.setting import Setting

_LOGGER = logging.getLogger(__name__)
_LARGE = 1_000_000  # bytes
_MANY = 20  # files that are no logs and are named one by one
_READ_IN_CHILD = {suffix for known in FORMATS if known.in_child for suffix in known.suffixes}


class Ending(Enum):
    """How a command that reads logs ended; the value is its exit code."""

    COMPLETE = 0
    SOME_FAILED = 1
    ALL_FAILED = 3
    GATE_MISSED = 4
    INTERRUPTED = 130


class Purpose(Enum):
    """What logs are read for: to be fitted, compared as measured, or looked at."""

    FIT = "fit"  # each must have a setting
    COMPARE = "compare"
    INSPECT = "inspect"  # no samples are kept


@dataclass(frozen=True, slots=True)
class LogFacts:
    """What run.json and `inspect` tell about one log; never the samples.

    Attributes
    ----------
    log, path, sha256 : str
        Name for tables, path as given, hash of the bytes (empty when unreadable).
    facts : dict
        JSON values: samples, rate, cycles, frequency, amplitude, notes, findings, and the
        verdict: "good", "warnings" (it is used, read them) or "refused".
    """

    log: str
    path: str
    sha256: str
    facts: dict[str, Any]

    def describe(self) -> dict[str, Any]:
        """Return the log as run.json lists it."""
        facts = {key: value for key, value in self.facts.items() if key != "name"}
        return {"log": self.log, "path": self.path, "sha256": self.sha256, **facts}


@dataclass(frozen=True, slots=True, eq=False)
class LogBatch:
    """All logs of a run.

    Attributes
    ----------
    traces : tuple of Trace
        The good logs, in the order of their names.
    logs : tuple of LogFacts
        Every log, the failed ones too.
    failures : tuple of Failure
        Logs that cannot be used.
    skipped : tuple of str
        Files that are no logs and are not meant to be.
    n_good : int
        Logs that can be used, whether or not their traces were kept.
    remarks : tuple of Problem or str
        How settings were found, where that is more than reading them.
    notes : tuple of str
        Tables of tests that were used.
    identities : mapping of str to Identity
        Whose test each log is, by its name.
    """

    traces: tuple[Trace, ...]
    logs: tuple[LogFacts, ...]
    failures: tuple[Failure, ...]
    skipped: tuple[str, ...]
    n_good: int
    remarks: tuple[Problem | str, ...] = ()
    notes: tuple[str, ...] = ()
    identities: Mapping[str, Identity] = field(default_factory=dict)

    @property
    def skipped_files(self) -> Iterator[str]:
        """Which files are no logs, a sentence each; of many, the first and how many."""
        if len(self.skipped) > _MANY:
            n = len(self.skipped) - 1
            yield f"{self.skipped[0]} and {n} other files: written by damperfit, not logs; skipped"
            return
        for path in self.skipped:
            yield f"{path}: written by damperfit, not a log; skipped"

    @property
    def ending(self) -> Ending:
        """How reading alone ended."""
        if any(not failure.is_left_out for failure in self.failures):
            return Ending.SOME_FAILED if self.n_good else Ending.ALL_FAILED
        return Ending.GATE_MISSED if self.failures else Ending.COMPLETE

    def document(self) -> dict[str, Any]:
        """Return what `inspect` tells, as JSON values."""
        document: dict[str, Any] = json_values(
            {
                "logs": [log.describe() for log in self.logs],
                "skipped": list(self.skipped),
                "failures": [failure.describe() for failure in self.failures],
            }
        )
        return document


def read_batch(  # noqa: PLR0913 - one more than usual, for what is done beside it
    paths: Sequence[Path],
    configuration: Configuration,
    *,
    jobs: int,
    setting: Setting | None = None,
    purpose: Purpose = Purpose.FIT,
    cancelled: Callable[[], bool] = lambda: False,
    beside: Callable[[], object] = lambda: None,
) -> LogBatch:
    """Read and condition logs, several at a time.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        Log files.
    configuration : Configuration
        How to read and condition them.
    jobs : int
        Workers.
    setting : Setting, optional
        Of logs that do not give one.
    purpose : Purpose
        To be inspected, curves without time are facts too, not failures.
    cancelled : callable
        Asked before each log; once it says True, the remaining logs are left out.
    beside : callable
        What this process does while others read.
    """
    is_table = {path: is_own_table(path) for path in paths}
    logs = [path for path in paths if not is_table[path] and not is_tests_table(path)]
    labels = labels_for(logs, configuration, setting=setting)
    labelled = _Labelled(labels, is_needed=purpose is Purpose.FIT)
    keeps_traces = purpose is not Purpose.INSPECT

    def one(pair: tuple[Path, str]) -> list[_Taken]:
        (path, name), begin = pair, perf_counter()
        taken = [] if cancelled() else _take_file(path, name, configuration, labelled)
        for part in taken:
            _note(part, perf_counter() - begin)
        if not keeps_traces and [part.kind for part in taken] == [TimelessError.__name__]:
            taken = [_take_curves(path, taken[0].facts, configuration)]
        return taken if keeps_traces else [replace(part, trace=None) for part in taken]

    threads = jobs if any(_gains_by_threads(path) for path in logs) else 1
    pairs = list(zip(logs, _distinct_names(logs), strict=True))
    with one_blas_thread():  # more would spin between small products, on the next log's core
        found = apart(one, pairs, jobs=jobs, cancelled=cancelled, threads=threads, beside=beside)
        taken = [part for parts in found for part in parts]
        names = {_shown(str(path)): name for path, name in pairs}
        taken = _with_common_signs(taken, names, configuration, labelled)
    if not keeps_traces:  # those that were read again
        taken = [replace(part, trace=None) for part in taken]
    return LogBatch(
        traces=tuple(part.trace for part in taken if part.trace is not None),
        logs=tuple(part.facts for part in taken),
        failures=tuple(part.failure for part in taken if part.failure is not None),
        skipped=tuple(_shown(str(path)) for path in paths if is_table[path]),
        n_good=sum(part.failure is None for part in taken),
        remarks=tuple(_label_remarks(labels, taken)),
        notes=labels.tables_used,
        identities={part.facts.log: part.identity for part in taken},
    )


def _with_common_signs(
    taken: list[_Taken],
    names: Mapping[str, str],
    configuration: Configuration,
    labelled: _Labelled,
) -> list[_Taken]:
    """Read logs that do not show their signs again, with those that the others of the rig show.

    A rig has one convention. Where a sign is declared, or logs disagree, nothing is changed.
    """
    reading = configuration.reading
    if {reading.reverse_displacement, reading.reverse_force} != {"detect"}:
        return taken
    shown = {tuple(part.facts.facts["reversed"]) for part in taken if part.shows_signs}
    unknown = {part.facts.log: part.facts.path for part in taken if part.asks_for_signs}
    if len(shown) != 1 or not unknown:
        return taken
    (channels,) = shown
    reading = replace(
        reading,
        reverse_displacement="displacement" in channels,
        reverse_force="force" in channels,
    )
    declared = replace(configuration, reading=reading)
    how = f"{' and '.join(channels)} reversed" if channels else "nothing reversed"
    note = f"signs as the other logs of the batch show them: {how}"
    again = {
        part.facts.log: part.with_note(note)
        for path in dict.fromkeys(unknown.values())
        for part in _take_file(Path(path), names[path], declared, labelled)
    }
    return [
        again.get(part.facts.log, part) if part.facts.log in unknown else part for part in taken
    ]


def _note(part: _Taken, spent: float) -> None:
    facts = part.facts.facts
    _LOGGER.debug(
        "%s: %s, setting %s, %s samples, %.3f s, sha256 %s",
        part.facts.path,
        facts.get("verdict"),
        facts.get("setting"),
        facts.get("n_samples_read", "no"),
        spent,
        part.facts.sha256 or "unknown",
    )


def _label_remarks(labels: Labels, taken: Sequence[_Taken]) -> Iterator[Problem | str]:
    """Say what is doubtful in tables of tests, and what was guessed."""
    yield from labels.notes
    if any(GUESSED in part.facts.facts.get("notes", ()) for part in taken):
        yield labels.guess.said or ""
    if words := labels.taken_as_words(part.facts.facts.get("setting") for part in taken):
        yield words
    for part in taken:
        notes = part.facts.facts.get("notes", ())
        if FROM_NAME in notes and (said := labels.one_of_several(Path(part.facts.path).name)):
            yield said


def _gains_by_threads(path: Path) -> bool:
    """Whether other logs can be read meanwhile: it is large, or read in a process of its own.

    Small logs hold the interpreter's lock nearly all the time: in two threads they take longer than
    one after the other.
    """
    with suppress(OSError, ValueError):
        return path.suffix.lower() in _READ_IN_CHILD or path.stat().st_size > _LARGE
    return False


def _distinct_names(paths: Sequence[Path]) -> list[str]:
    """Return file names; with as much of the folder as two equal names need to differ."""
    counts = Counter(path.name for path in paths)
    if max(counts.values(), default=0) <= 1:
        return [_shown(path.name) for path in paths]
    root = os.path.commonpath([os.path.abspath(path.parent) for path in paths])
    return [
        _shown(
            path.name if counts[path.name] == 1 else Path(os.path.relpath(path, root)).as_posix()
        )
        for path in paths
    ]


def _shown(name: str) -> str:
    """Return a file name as valid Unicode; bytes that are none (Latin-1 names) as escapes."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


@dataclass(frozen=True, slots=True)
class _Labelled:
    """Who says what of the logs, and whether a log must have a setting."""

    labels: Labels
    is_needed: bool

    def is_unsaid(self, path: Path) -> bool:
        """Whether a log must have a setting, and none is stated from outside."""
        labels = self.labels
        is_stated = labels.declared is not None or labels.row(path) is not None
        return self.is_needed and not is_stated and path.name not in labels.guess.settings

    def check(self, recording: Recording) -> None:
        """Refuse a log that must have a setting and has none."""
        if recording.setting is None and self.is_needed:
            raise self.labels.missing(recording.name, recording)


@dataclass(frozen=True, slots=True, eq=False)
class _Taken:
    """One test: its facts, and either a trace or a failure."""

    facts: LogFacts
    trace: Trace | None = None
    failure: Failure | None = None
    identity: Identity = Identity()
    shows_signs: bool = False

    def with_note(self, note: str) -> _Taken:
        """Return the same with a note among the facts."""
        facts = self.facts.facts
        notes = [*facts.get("notes", ()), note]
        return replace(self, facts=replace(self.facts, facts=facts | {"notes": notes}))

    @property
    def asks_for_signs(self) -> bool:
        """Whether the log does not show which way its channels are counted."""
        if self.failure is not None:
            return self.failure.code == UNKNOWN
        names = (finding["name"] for finding in self.facts.facts.get("findings", ()))
        return any(name in {"direction", CONTRADICTED} for name in names)

    @property
    def kind(self) -> str:
        """Which error it failed with; empty where it did not."""
        return self.failure.kind if self.failure is not None else ""


def _take_file(
    path: Path, name: str, configuration: Configuration, labelled: _Labelled
) -> list[_Taken]:
    """Read one file, which may hold several tests."""
    try:
        recordings = read_logs(path, configuration.reading)
    except _USAGE:
        raise
    except Exception as error:  # noqa: BLE001 - whatever it is, the other logs go on
        if isinstance(error, LogError) and not error.says_setting and labelled.is_unsaid(path):
            error = error.adding(_NO_SETTING_EITHER, setting=Option("setting", "N"))
        known = LogFacts(
            name,
            _shown(str(path)),
            _hash(path),
            {"name": name, "setting": labelled.labels.unread(path, configuration.reading)},
        )
        return [_failed(known, error, task="reading the log")]
    parts = [replace(part, name=part.name.replace(path.name, name, 1)) for part in recordings]
    return [_take_test(part, path, configuration, labelled) for part in parts]


def _take_curves(path: Path, known: LogFacts, configuration: Configuration) -> _Taken:
    """Read a file without time as curves."""
    try:
        curves = read_curves(path, configuration.reading)
    except _USAGE:
        raise
    except Exception as error:  # noqa: BLE001 - the other files go on
        return _failed(known, error, task="reading the curves")
    seen = {"curves": [curve.describe() for curve in curves], "notes": list(curves[0].notes)}
    facts = {"name": known.log, "verdict": "curves", **seen}
    return _Taken(replace(known, sha256=curves[0].sha256, facts=facts))


def _take_test(
    recording: Recording, path: Path, configuration: Configuration, labelled: _Labelled
) -> _Taken:
    recording, identity = labelled.labels.labelled(recording, path)
    row = labelled.labels.row(path)
    tested_at, unsaid = facts_of(recording, path, configuration, row)
    recording = replace(recording, notes=(*recording.notes, *unsaid))
    whose = {"test": identity.describe()} if identity.describe() else {}
    known = LogFacts(
        log=recording.name,
        path=_shown(str(path)),
        sha256=recording.sha256,
        facts={
            "name": recording.name,
            "setting": recording.setting,
            "n_samples_read": len(recording.time),
            "notes": list(recording.notes),
            **whose,
        },
    )
    try:
        try:
            trace = conditioned_as_tested(recording, configuration.conditioning, tested_at)
        except LogError as error:
            if recording.setting is None and labelled.is_needed:
                raise error.adding(_NO_SETTING_EITHER, setting=Option("setting", "N")) from error
            raise
        labelled.check(recording)
    except _USAGE:
        raise
    except Exception as error:  # noqa: BLE001
        return _failed(known, error, _seen_raw(recording), task="conditioning the log")
    offset = configuration.log_offsets.get(trace.name, 0.0)
    if offset:
        trace = replace(trace, force=trace.force - offset)
        tested_at = {**tested_at, "force_offset": offset}
    sentences = (one.sentence for one in trace.findings)
    facts = trace.describe() | {
        **whose,
        **({"tested_at": tested_at} if tested_at else {}),
        "reversed": reversed_in(recording, trace),
        "n_samples_read": len(recording.time),
        "notes": list(dict.fromkeys([*recording.notes, *trace.notes, *sentences])),
        "verdict": "warnings" if trace.warnings else "good",
    }
    known = replace(known, facts=facts)
    if configuration.rig.is_strict and trace.warnings:
        more = f" (and {len(trace.warnings) - 1} more)" if len(trace.warnings) > 1 else ""
        text = "refused because of a warning, as strict quality was requested"
        refused = QualityError(f"{text}: {trace.warnings[0]}{more}", subject=recording.name)
        return _failed(known, refused, trace.findings)
    return _Taken(known, trace, identity=identity, shows_signs=trace.shows_signs)


# Names of the finding that says why a log is refused, by the class of the error.
_REFUSALS = {
    "ConditioningError": "unusable",
    "QualityError": "strict",
    "InternalError": "internal_error",
}
# What is wrong with the whole command, not with one log.
_USAGE = (ConfigurationError, InstallationError)


def failure_of(
    mishap: Failure, log: str = "", path: str = "", setting: Setting | None = None
) -> Failure:
    """Return what is reported of a log or a setting that something ended the work on."""
    return replace(mishap, log=log, path=path, setting=setting)


def _seen_raw(recording: Recording) -> tuple[Finding, ...]:
    """Return what a log shows that cannot be evaluated, if it can be looked at."""
    try:
        return examine_raw(recording)
    except Exception:  # noqa: BLE001 - why it cannot be evaluated is reported already
        return ()


def _failed(
    known: LogFacts,
    error: Exception,
    findings: tuple[Finding, ...] = (),
    *,
    task: str = "reading the log",
) -> _Taken:
    mishap = mishap_of(error, task)
    failure = failure_of(mishap, known.log, known.path, known.facts["setting"])
    is_of_log = mishap.problem.subject == known.log
    sentence = mishap.problem.message() if is_of_log else mishap.message
    refusal = Finding(_REFUSALS.get(mishap.kind, "unreadable"), "refusal", sentence)
    refused = {"findings": [one.describe() for one in (refusal, *findings)], "verdict": "refused"}
    facts = known.facts | refused | {"code": failure.code}
    return _Taken(replace(known, facts=facts), failure=failure)


# What is wrong is said at once, not one by one over as many runs.
_NO_SETTING_EITHER = ". Nor does the log say its adjuster setting: give {setting} too"


def _hash(path: Path) -> str:
    with suppress(OSError):
        if path.is_file():
            return sha256_of(path)
    return ""
