"""Log files to traces, each labelled, read and conditioned; what cannot be becomes a `Failure`.

Of what a log is a test: ``--setting`` and the table of tests go before the log's own preamble and
columns, these before its name; what no source says is guessed from what differs between the names,
and the guess is reported. Of what it was tested at: its preamble, [rig], its profile, the table of
tests, the command line, each before those ahead of it.
"""

from __future__ import annotations

import logging
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import chain
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning.findings import examine_raw
from damperfit.conditioning.log_to_trace import condition
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.polarity import CONTRADICTED, UNKNOWN, reversed_in
from damperfit.errors import (
    ConfigurationError,
    InstallationError,
    LogError,
    QualityError,
    TimelessError,
    failure_of,
)
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.io import read_curves, read_logs
from damperfit.io.files import sha256_of
from damperfit.io.formats import FORMATS
from damperfit.io.labels import (
    FROM_NAME,
    Guess,
    LogLabel,
    file_setting,
    guess_settings,
    one_of_several,
    unclear_names,
)
from damperfit.io.tests_table import TestRow, TestsTable, facts_in, is_tests_table, read_tests
from damperfit.problem import (
    Failure,
    Option,
    Problem,
    counted,
    finding_record,
    listed_names,
    warning,
)
from damperfit.recording import Recording, Trace, natural_order
from damperfit.run.log_files import is_own_table, real_path
from damperfit.sections import SETTING_PATTERN
from damperfit.tables.files import json_values
from damperfit.tested.identity import Identity, identity_in
from damperfit.tested.setting import Place, Setting, letters_of, parse_place
from damperfit.workers import executor

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration

_LOGGER = logging.getLogger(__name__)
_LARGE = 1_000_000  # bytes
_MANY = 20  # files that are no logs and are named one by one
_READ_IN_CHILD = {suffix for form in FORMATS if form.in_child for suffix in form.suffixes}
_GUESSED = "setting: guessed from the file name"
# What is wrong with the whole command, not with one log.
_USAGE = (ConfigurationError, InstallationError)
# Names of the finding that says why a log is refused, by the class of the error.
_REFUSALS = {
    "ConditioningError": "unusable",
    "QualityError": "strict",
    "InternalError": "internal_error",
}


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


@dataclass(slots=True, eq=False, repr=False)
class Log:
    """One test that was read: its facts, and either a trace, until the batch has it, or a failure.

    The facts are JSON values for run.json and `inspect`: samples, rate, cycles, frequency,
    amplitude, notes, findings, and the verdict: "good", "warnings" (it is used, read them) or
    "refused". `shows_signs`: it shows which way its channels are counted.
    """

    log: str
    path: str = ""
    sha256: str = ""
    facts: dict[str, Any] = field(default_factory=dict)
    trace: Trace | None = None
    failure: Failure | None = None
    identity: Identity = Identity()
    shows_signs: bool = False

    def describe(self) -> dict[str, Any]:
        """Return the log as run.json lists it."""
        facts = {key: value for key, value in self.facts.items() if key != "name"}
        return {"log": self.log, "path": self.path, "sha256": self.sha256, **facts}


@dataclass(slots=True, eq=False, repr=False)
class LogBatch:
    """All logs of a run; what is done with them before the fit changes it in place.

    `logs` are all, the failed ones too; `traces` those to fit, `held_out` those to be predicted;
    `failures` logs and settings that cannot be used. `skipped` files are no logs and are not meant
    to be; `notes` name tables of tests, `remarks` say what was done with the logs. `is_asked`: the
    user said what to hold out; else it is what moves beside the steady cycles.
    """

    logs: list[Log] = field(default_factory=list)
    traces: list[Trace] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    skipped: tuple[str, ...] = ()
    remarks: list[Problem] = field(default_factory=list)
    notes: tuple[str, ...] = ()
    held_out: list[Trace] = field(default_factory=list)
    is_asked: bool = True

    @property
    def skipped_files(self) -> tuple[Problem, ...]:
        """Which files are no logs; of many, the first and how many."""
        if len(self.skipped) > _MANY:
            files = f"{self.skipped[0]} and {len(self.skipped) - 1} other files"
            return (warning("not-a-log", "written by damperfit, not logs; skipped", files),)
        text = "written by damperfit, not a log; skipped"
        return tuple(warning("not-a-log", text, path) for path in self.skipped)

    @property
    def ending(self) -> Ending:
        """How reading alone ended."""
        if any(not failure.is_left_out for failure in self.failures):
            has_good = any(log.failure is None for log in self.logs)
            return Ending.SOME_FAILED if has_good else Ending.ALL_FAILED
        return Ending.GATE_MISSED if self.failures else Ending.COMPLETE

    def path_of(self, log: str) -> str:
        """Return the path of a log; empty where it is not known."""
        return next((own.path for own in self.logs if own.log == log), "")

    def document(self) -> dict[str, Any]:
        """Return what `inspect` reports, as JSON values."""
        document: dict[str, Any] = json_values(
            {
                "logs": [log.describe() for log in self.logs],
                "skipped": list(self.skipped),
                "failures": [failure.describe() for failure in self.failures],
            }
        )
        return document


# Whose test a log is, and at which setting


class Labels:
    """What is declared about the logs of a run, before they are read."""

    def __init__(
        self,
        logs: Iterable[Path],
        configuration: Configuration,
        setting: Setting | None = None,
        *,
        is_needed: bool = False,
    ) -> None:
        reading, table, logs = configuration.reading, configuration.test.table, list(logs)
        self.adjusters, self.identity = reading.adjusters, configuration.test.identity
        self.declared, self.is_needed = setting, is_needed
        # Tables beside logs speak for those in their own folders alone.
        self.is_beside = table is None
        beside = (folder / "tests.csv" for folder in dict.fromkeys(path.parent for path in logs))
        paths = filter(is_tests_table, beside) if table is None else [table]
        self.tables: list[TestsTable] = [read_tests(path, self.adjusters) for path in paths]
        self.has_pattern = reading.setting_pattern != SETTING_PATTERN
        # Names of which several numbers may be the setting do not say it.
        self.unclear: frozenset[str] = frozenset()
        self.guess = Guess()
        if setting is None and len(self.adjusters) == 1:
            unlisted = [path.name for path in logs if self.row(path) is None]
            if not self.has_pattern:
                self.unclear = unclear_names(unlisted)
            self.guess = guess_settings(
                [n for n in unlisted if n in self.unclear or not _says(n, configuration)]
            )

    def row(self, path: Path) -> TestRow | None:
        """Return the row of a log: the one that names most of its path, in the nearest table."""
        log, ranks = real_path(path), dict[tuple[int, int], TestRow]()
        for table in self.tables:
            folder = real_path(table.path).parent
            if self.is_beside and not log.is_relative_to(folder):
                continue
            for name, row in table.rows.items():
                parts = Path(name).parts
                if log.parts[-len(parts) :] == parts:
                    ranks.setdefault((len(parts), len(folder.parts)), row)
        return ranks[max(ranks)] if ranks else None

    def labelled(self, recording: Recording, path: Path) -> tuple[Recording, Identity]:
        """Return the recording with its setting, None where it is unknown, and whose it is."""
        row = self.row(path)
        if path.name in self.unclear and FROM_NAME in recording.notes:
            rest = tuple(note for note in recording.notes if note != FROM_NAME)
            recording = replace(recording, setting=None, notes=rest)
        own, listed = self._places(recording), dict(row.places) if row else {}
        notes = [
            f"{name}: {place} of the table of tests; the log says {own[name]}: check which is right"
            for name, place in listed.items()
            if name in own and own[name] != place
        ]
        setting = LogLabel({**own, **listed}).setting(self.adjusters)
        if setting is None and row is None:
            setting = recording.setting
        if self.declared is not None:
            if setting is not None and setting != self.declared:
                raise ConfigurationError(
                    f"{recording.name} says setting {setting}; leave "
                    "the option out, or give it the logs that do not say theirs alone",
                    where=Option("setting", self.declared),
                    code="other-setting",
                )
            setting = self.declared
        if setting is None and path.name in self.guess.settings:
            setting = self.guess.settings[path.name]
            notes.append(_GUESSED)
        stated = identity_in(recording.metadata)
        identity = (row.identity.over(stated) if row else stated).over(self.identity)
        for key in ("serial", "damper"):
            mine, others = getattr(self.identity, key), getattr(identity, key)
            if mine and others and mine != others:
                raise ConfigurationError(
                    f"test.{key}: found {mine!r}, but {recording.name} is of {key} {others!r}; "
                    f"leave test.{key} out, and each {key} gets a result of its own",
                    code="other-damper",
                )
        return replace(recording, setting=setting, notes=(*recording.notes, *notes)), identity

    def unread(self, path: Path, configuration: Configuration) -> Setting | None:
        """Return the setting of a log that cannot be read, as it is stated from outside."""
        row, label = self.row(path), LogLabel()
        if path.name not in self.unclear:
            with suppress(LogError):
                label = _of_name(path.name, configuration)
        stated = LogLabel(row.places if row else {}).over(label).setting(self.adjusters)
        return self.declared or stated or self.guess.settings.get(path.name)

    def is_unsaid(self, path: Path) -> bool:
        """Whether a log must have a setting, and none is stated from outside."""
        is_stated = self.declared is not None or self.row(path) is not None
        return self.is_needed and not is_stated and path.name not in self.guess.settings

    def missing(self, recording: Recording) -> LogError:
        """Return why a log without a setting cannot be fitted, with what to write."""
        row = self.row(Path(recording.path))
        # Other columns that hold clicks, as adjusters are named.
        columns = [
            re.sub(r"[\W_]+", "_", column.casefold()).strip("_")
            for column, cell in (row.identity.more if row is not None else ())
            if re.fullmatch(r"[+-]?\d{1,3}(\.\d)?", cell)
        ]
        values: dict[str, Any] = {"setting": Option("setting", "N"), "advice": self.guess.advice}
        if row is not None and not row.places and columns:
            values, declared = {}, ", ".join(f'{column} = ""' for column in columns)
            text = (
                f"line {row.line} of the table of tests does not say its setting; it has "
                f"{', '.join(columns)}: where these are adjusters, declare them in the "
                f"configuration, [adjusters] {declared}; else name the column of the setting "
                "'setting'"
            )
        elif len(self.adjusters) > 1:
            own = self._places(recording)
            lacks = ", ".join(adjuster for adjuster in self.adjusters if adjuster not in own)
            example = ", ".join(f"{adjuster}=8" for adjuster in self.adjusters)
            values = {"setting": Option("setting", f"'{example}'")}
            text = (
                f"the log does not give {lacks}; expected lines such as "
                f"'# {self.adjusters[0]}: 8', columns, named groups of rig.setting_pattern, or a "
                "table tests.csv; or give {setting}"
            )
        else:
            text = (
                "the log does not say its adjuster setting; expected a line '# setting: 10', "
                "a column 'setting' or a name such as setting_10.csv; or give {setting}"
            )
            text += "" if self.guess.advice is None else ", or {advice}"
        return LogError(text, subject=recording.name, code="no-setting", **values)

    @property
    def tables_used(self) -> tuple[str, ...]:
        """Which tables of tests were used, a sentence each."""
        return tuple(
            f"{table.path}: taken as the table of tests, {counted(len(table.rows), 'row')}"
            for table in self.tables
        )

    def remarks(self, logs: Sequence[Log]) -> Iterator[Problem]:
        """Yield what is doubtful in tables of tests and in labels, and what was guessed."""
        for table in self.tables:
            yield from (warning("table-of-tests", text) for text in table.notes)
            folder = table.path.parent
            lost = [
                f"line {row.line} '{name}'"
                for name, row in table.rows.items()
                if not (folder / name).exists() and not list(folder.rglob(name))
            ]
            if lost:
                yield warning("table-of-tests", f"no such file: {listed_names(lost)}", table.path)
        notes = {id(log): log.facts.get("notes", ()) for log in logs}
        is_guessed = any(_GUESSED in own for own in notes.values())
        if self.guess.finding and is_guessed:
            yield self.guess.finding
        if len(self.adjusters) > 1 or (self.guess.adjusters and is_guessed):
            return  # it says which adjusters to declare
        settings = dict.fromkeys(log.facts.get("setting") for log in logs)
        labels = list(map(str, filter(None, settings)))
        letters = [sorted(letters_of(label)) for label in labels]
        if len(labels) > 1 and letters[0] and all(others == letters[0] for others in letters):
            declared = ", ".join(f'{letter} = ""' for letter in letters_of(labels[0]))
            yield warning(
                "settings-as-words",
                f"settings such as '{labels[0]}' and '{labels[1]}' are taken as words, so there "
                "are no trends and no clicks: if the numbers are clicks, declare [adjusters] "
                f"{declared}, or longer names that begin with these letters",
            )
        for log in () if self.has_pattern else logs:
            name = Path(log.path).name
            if FROM_NAME in notes[id(log)] and (number := one_of_several(name)):
                yield warning(
                    "one-of-several",
                    f"of the numbers in its name the one after 's', {number}, is taken for the "
                    "setting; if it is another, name what precedes it: {pattern}",
                    name,
                    pattern=Option("rig", r"s(?P<setting>\d+)", "setting_pattern"),
                )

    def _places(self, recording: Recording) -> dict[str, Place]:
        """Return where a log says that its adjusters stand."""
        if recording.setting is not None:
            return dict(recording.setting.places)
        stated = recording.metadata
        return {name: parse_place(stated[name]) for name in self.adjusters if name in stated}


def _of_name(name: str, configuration: Configuration) -> LogLabel:
    options, _ = configuration.reading.for_file(name)
    return file_setting(name, options.setting_pattern, options.adjusters)


def _says(name: str, configuration: Configuration) -> bool:
    try:
        return bool(_of_name(name, configuration).places)
    except LogError:
        return True


# What a log was tested at


def facts_of(
    recording: Recording, path: Path, configuration: Configuration, row: TestRow | None
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return what is stated of one test by the nearest word, SI, and what says too little."""
    own, notes = facts_in(recording.metadata)
    if recording.temperature is not None:
        own.pop("temperature", None)
    reading = configuration.reading
    near, _ = reading.for_file(path.name)
    facts = {**own, **near.tested_at, **(row.facts if row else {})}
    for name in configuration.test.typed:
        facts.pop(name, None)
        if name in reading.tested_at:
            facts[name] = reading.tested_at[name]
    return facts, notes


def conditioned_as_tested(
    recording: Recording, options: ConditionOptions, facts: Mapping[str, float]
) -> Trace:
    """Return the trace of a recording with what is stated of this test alone, SI and degC."""
    if "tare" in facts:
        recording = replace(recording, force=recording.force - facts["tare"])
    if "temperature" in facts:
        temperature = np.full(len(recording.time), facts["temperature"])
        recording = replace(recording, temperature=temperature)
    if "skew" in facts:
        options = options.but(skew=facts["skew"])
    pressure = facts.get("gas_pressure")
    if pressure is not None and options.gas is not None:
        options = options.but(gas=options.gas._replace(pressure=pressure))
    trace = condition(recording, options)
    return trace if pressure is None else replace(trace, gas_pressure=pressure)


# Reading


def read_batch(
    paths: Sequence[Path],
    configuration: Configuration,
    *,
    jobs: int,
    setting: Setting | None = None,
    purpose: Purpose = Purpose.FIT,
    cancelled: Callable[[], bool] = lambda: False,
) -> LogBatch:
    """Read and condition logs, several at a time.

    ``setting`` is that of logs that do not give one. To be inspected, curves without time are facts
    too, not failures. Once ``cancelled`` says True, the remaining logs are left out.
    """
    is_table = {path: is_own_table(path) for path in paths}
    logs = [path for path in paths if not is_table[path] and not is_tests_table(path)]
    labels = Labels(logs, configuration, setting, is_needed=purpose is Purpose.FIT)
    names = _distinct_names(logs)
    is_inspected = purpose is Purpose.INSPECT

    def logs_of(path: Path) -> list[Log]:
        if cancelled():
            return []
        begin = perf_counter()
        own = _read_file(path, names[path], configuration, labels)
        for log in own:
            _LOGGER.debug(
                "%s: %s, setting %s, %s samples, %.3f s, sha256 %s",
                log.path,
                log.facts.get("verdict"),
                log.facts.get("setting"),
                log.facts.get("n_samples_read", "no"),
                perf_counter() - begin,
                log.sha256 or "unknown",
            )
            if is_inspected:
                log.trace = None
        kinds = [log.failure.kind if log.failure is not None else "" for log in own]
        if not is_inspected or kinds != [TimelessError.__name__]:
            return own
        try:
            curves = read_curves(path, configuration.reading)
        except _USAGE:
            raise
        except Exception as error:  # noqa: BLE001 - the other files go on
            return [_failed(own[0], error, task="reading the curves")]
        notes = list(curves[0].notes)
        described = {"curves": [curve.describe() for curve in curves], "notes": notes}
        facts = {"name": own[0].log, "verdict": "curves", **described}
        return [Log(own[0].log, own[0].path, curves[0].sha256, facts)]

    def gains_by_threads(path: Path) -> bool:
        # It is large, or read in a process of its own. Small logs hold the interpreter's lock
        # nearly all the time: in two threads they take longer than one after the other.
        with suppress(OSError, ValueError):
            return path.suffix.lower() in _READ_IN_CHILD or path.stat().st_size > _LARGE
        return False

    threads = jobs if any(map(gains_by_threads, logs)) else 1
    # More BLAS threads would spin between small products, on the next log's core.
    with one_blas_thread(), executor(threads) as pool:
        read = list(chain.from_iterable(pool.map(logs_of, logs)))
        read = _with_common_signs(read, names, configuration, labels)
    traces = [log.trace for log in read if log.trace is not None and not is_inspected]
    for log in read:
        log.trace = None
    return LogBatch(
        read,
        traces,
        [log.failure for log in read if log.failure is not None],
        tuple(_shown(path) for path in paths if is_table[path]),
        list(labels.remarks(read)),
        labels.tables_used,
    )


def add_traces(batch: LogBatch, traces: Sequence[Trace], setting: Setting | None) -> None:
    """Put traces that are there already among the logs of a run, as if they had been read."""
    given = [t if t.setting is not None else replace(t, setting=setting) for t in traces]
    for trace in given:
        if trace.setting is None:
            raise LogError(
                "this trace has no setting; give setting=N", subject=trace.name, code="no-setting"
            )
    names = Counter([*(log.log for log in batch.logs), *(trace.name for trace in given)])
    if twice := [name for name, count in names.items() if count > 1]:
        raise ConfigurationError(
            f"two logs are called {twice[0]}; give each trace a name of its own, as with "
            "dataclasses.replace(trace, name=...)",
            code="given-twice",
        )
    batch.logs += [Log(t.name, facts=_facts_of_trace(t, len(t.force))) for t in given]
    batch.traces = sorted([*batch.traces, *given], key=lambda trace: natural_order(trace.name))


def _with_common_signs(
    logs: list[Log], names: Mapping[Path, str], configuration: Configuration, labels: Labels
) -> list[Log]:
    """Read logs that do not show their signs again, with those that the others of the rig show."""
    # A rig has one convention. Where a sign is declared, or logs disagree, nothing is changed.
    reading = configuration.reading
    if {reading.reverse_displacement, reading.reverse_force} != {"detect"}:
        return logs
    shown = {tuple(log.facts["reversed"]) for log in logs if log.shows_signs}
    unknown: dict[str, str] = {}
    for log in logs:
        doubts = {finding["name"] for finding in log.facts.get("findings", ())}
        asks = not doubts.isdisjoint({"direction", CONTRADICTED})
        if asks if log.failure is None else log.failure.code == UNKNOWN:
            unknown[log.log] = log.path
    if len(shown) != 1 or not unknown:
        return logs
    (channels,) = shown
    signs: Any = {f"reverse_{name}": name in channels for name in ("displacement", "force")}
    declared = replace(configuration, reading=reading.but(**signs))
    how = f"{' and '.join(channels)} reversed" if channels else "nothing reversed"
    note = f"signs from the other logs of the batch: {how}"
    again = {}
    for path, name in names.items():
        if _shown(path) in unknown.values():
            for log in _read_file(path, name, declared, labels):
                log.facts |= {"notes": [*log.facts.get("notes", ()), note]}
                again[log.log] = log
    return [again.get(log.log, log) if log.log in unknown else log for log in logs]


def _read_file(path: Path, name: str, configuration: Configuration, labels: Labels) -> list[Log]:
    """Read one file, which may hold several tests."""
    try:
        recordings = read_logs(path, configuration.reading)
    except _USAGE:
        raise
    except Exception as error:  # noqa: BLE001 - whatever it is, the other logs go on
        if isinstance(error, LogError) and not error.says_setting and labels.is_unsaid(path):
            error = _without_setting(error)
        digest = ""
        with suppress(OSError, ValueError):  # nor is a pipe or a folder read, nor a NUL
            digest = sha256_of(path)
        facts = {"name": name, "setting": labels.unread(path, configuration)}
        return [_failed(Log(name, _shown(path), digest, facts), error)]
    named = (replace(test, name=test.name.replace(path.name, name, 1)) for test in recordings)
    return [_conditioned(recording, path, configuration, labels) for recording in named]


def _without_setting(error: LogError) -> LogError:
    """Say all that is wrong at once, not one by one over as many runs."""
    more = ". Nor does the log say its adjuster setting: give {setting} too"
    return error.adding(more, setting=Option("setting", "N"))


def _conditioned(
    recording: Recording, path: Path, configuration: Configuration, labels: Labels
) -> Log:
    recording, identity = labels.labelled(recording, path)
    tested_at, unsaid = facts_of(recording, path, configuration, labels.row(path))
    recording = replace(recording, notes=(*recording.notes, *unsaid))
    whose = {"test": identity.describe()} if identity.describe() else {}
    log = Log(recording.name, _shown(path), recording.sha256, identity=identity)
    log.facts = {
        "name": recording.name,
        "setting": recording.setting,
        "n_samples_read": len(recording.time),
        "notes": list(recording.notes),
        **whose,
    }
    has_no_setting = recording.setting is None and labels.is_needed
    try:
        try:
            trace = conditioned_as_tested(recording, configuration.conditioning, tested_at)
        except LogError as error:
            if has_no_setting:
                raise _without_setting(error) from error
            raise
        if has_no_setting:
            raise labels.missing(recording)  # noqa: TRY301 - as of a log that cannot be read
    except _USAGE:
        raise
    except Exception as error:  # noqa: BLE001
        findings: tuple[Problem, ...] = ()
        with suppress(Exception):  # why it cannot be evaluated is reported already
            findings = examine_raw(recording)
        return _failed(log, error, findings, task="conditioning the log")
    if offset := configuration.log_offsets.get(trace.name, 0.0):
        trace = replace(trace, force=trace.force - offset, tare=offset)
        tested_at = {**tested_at, "force_offset": offset}
    stated: dict[str, Any] = whose | ({"tested_at": tested_at} if tested_at else {})
    stated["reversed"] = reversed_in(recording, trace)
    log.facts = _facts_of_trace(trace, len(recording.time), recording.notes, **stated)
    if configuration.rig.strict and trace.warnings:
        more = f" (and {len(trace.warnings) - 1} more)" if len(trace.warnings) > 1 else ""
        text = "refused because of a warning, as strict quality was requested"
        refused = QualityError(
            f"{text}: {trace.warnings[0]}{more}", subject=recording.name, code="strict"
        )
        return _failed(log, refused, trace.findings)
    log.trace, log.shows_signs = trace, trace.shows_signs
    return log


def _facts_of_trace(
    trace: Trace, n_read: int, notes: Sequence[str] = (), **more: Any
) -> dict[str, Any]:
    sentences = (finding.message() for finding in trace.findings)
    return {
        **trace.describe(),
        **more,
        "n_samples_read": n_read,
        "notes": list(dict.fromkeys([*notes, *trace.notes, *sentences])),
        "verdict": "warnings" if trace.warnings else "good",
    }


def _failed(
    log: Log, error: Exception, findings: tuple[Problem, ...] = (), *, task: str = "reading the log"
) -> Log:
    """Return a log as one that cannot be used, with why."""
    failure = failure_of(error, task)
    log.failure = replace(failure, log=log.log, path=log.path, setting=log.facts["setting"])
    sentence = failure.message.removeprefix(log.log).lstrip(",: ")  # the log is named beside it
    refusal = Problem(_REFUSALS.get(failure.kind, "unreadable"), sentence, "refusal")
    log.facts |= {
        "findings": [finding_record(finding) for finding in (refusal, *findings)],
        "verdict": "refused",
        "code": log.failure.code,
    }
    return log


def _distinct_names(paths: Sequence[Path]) -> dict[Path, str]:
    """Return file names; with as much of the folder as two equal names need to differ."""
    counts = Counter(path.name for path in paths)
    if max(counts.values(), default=0) <= 1:
        return {path: _shown(path.name) for path in paths}
    root = os.path.commonpath([os.path.abspath(path.parent) for path in paths])
    return {
        path: _shown(
            path.name if counts[path.name] == 1 else Path(os.path.relpath(path, root)).as_posix()
        )
        for path in paths
    }


def _shown(path: str | Path) -> str:
    """Return a file name as valid Unicode; bytes that are none (Latin-1 names) as escapes."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")
