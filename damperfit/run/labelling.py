"""What each log is a test of: setting and identity, from every source that says something.

``--setting`` and the table of tests go before the log's own preamble and columns, these before its
name; what no source says is guessed from what differs between the names, and the guess is reported.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, LogError
from damperfit.io import (
    Guess,
    TestRow,
    TestsTable,
    guess_settings,
    is_tests_table,
    one_of_several,
    read_tests,
    unclear_names,
)
from damperfit.io.labels import file_setting
from damperfit.io.options import SETTING_PATTERN
from damperfit.problem import Option, Problem, warning
from damperfit.run.log_paths import real_path
from damperfit.tested.adjuster_words import letters_of
from damperfit.tested.identity import Identity, identity_in
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.io.options import ReadOptions
    from damperfit.recording import Recording
    from damperfit.tested.setting import Place


FROM_NAME = "setting: from the file name"
GUESSED = "setting: guessed from the file name"
_FEW = 3  # rows of a table that are named
_FEWEST_WORDS = 2  # settings that show what differs between their labels


@dataclass(frozen=True, slots=True)
class Labels:
    """Who says what of the logs of a run.

    Attributes
    ----------
    adjusters : tuple of str
        Names of the adjusters.
    declared : Setting or None
        What the command line says of all logs.
    identity : Identity
        What the configuration says of all logs.
    tables : tuple of TestsTable
        Tables of tests.
    guess : Guess
        What the names tell.
    notes : tuple of str
        What was doubtful in the tables.
    has_pattern : bool
        The user says where the setting stands in a file's name.
    is_beside : bool
        The tables stand beside logs, and speak for those in their own folders alone.
    unclear : frozenset of str
        Names of which several numbers may be the setting: they do not say it.
    """

    adjusters: tuple[str, ...]
    declared: Setting | None = None
    identity: Identity = Identity()
    tables: tuple[TestsTable, ...] = ()
    guess: Guess = field(default_factory=Guess)
    notes: tuple[str, ...] = ()
    has_pattern: bool = False
    is_beside: bool = False
    unclear: frozenset[str] = frozenset()

    def labelled(self, recording: Recording, path: Path) -> tuple[Recording, Identity]:
        """Return the recording with its setting, None where nobody says it, and whose it is.

        Raises
        ------
        ConfigurationError
            The log says another setting than the command line, or is another damper's than the
            configuration says.
        """
        row = self.row(path)
        if path.name in self.unclear and FROM_NAME in recording.notes:
            rest = tuple(one for one in recording.notes if one != FROM_NAME)
            recording = replace(recording, setting=None, notes=rest)
        own = _places(recording, self.adjusters)
        places = {**own, **(row.places if row else {})}
        notes = [
            f"{name}: {place} of the table of tests; the log says {own[name]}: check which is right"
            for name, place in (row.places.items() if row else ())
            if name in own and own[name] != place
        ]
        setting = _complete(places, self.adjusters)
        if setting is None and recording.setting is not None and row is None:
            setting = recording.setting
        if self.declared is not None:
            if setting is not None and setting != self.declared:
                raise ConfigurationError(
                    f"{recording.name} says setting {setting}; leave "
                    "the option out, or give it the logs that do not say theirs alone",
                    where=Option("setting", self.declared),
                )
            setting = self.declared
        if setting is None and path.name in self.guess.settings:
            setting = self.guess.settings[path.name]
            notes.append(GUESSED)
        stated = identity_in(recording.metadata)
        identity = (row.identity.over(stated) if row else stated).over(self.identity)
        for key in ("serial", "damper"):
            mine, others = getattr(self.identity, key), getattr(identity, key)
            if mine and others and mine != others:
                raise ConfigurationError(
                    f"test.{key}: found {mine!r}, but {recording.name} is of {key} {others!r}; "
                    f"leave test.{key} out, and each {key} gets a result of its own"
                )
        labelled = replace(recording, setting=setting, notes=(*recording.notes, *notes))
        return labelled, identity

    def unread(self, path: Path, reading: ReadOptions) -> Setting | None:
        """Return the setting of a log that cannot be read, as it is stated from outside.

        Parameters
        ----------
        path : pathlib.Path
            The log.
        reading : ReadOptions
            How settings stand in names.
        """
        if self.declared is not None:
            return self.declared
        options, _ = reading.for_file(path.name)
        places: dict[str, Place] = {}
        with suppress(LogError):
            named = file_setting(path.name, options.setting_pattern, self.adjusters)
            places = {} if path.name in self.unclear else dict(named.places)
        row = self.row(path)
        stated = _complete({**places, **(row.places if row else {})}, self.adjusters)
        return stated or self.guess.settings.get(path.name)

    def one_of_several(self, name: str) -> Problem | None:
        """Say which of several numbers in a file's name is taken for the setting; None: no choice.

        Parameters
        ----------
        name : str
            Of a log whose setting comes from its name.
        """
        is_said = self.has_pattern or len(self.adjusters) > 1
        number = "" if is_said else one_of_several(name)
        if not number:
            return None
        return warning(
            "one-of-several",
            f"of the numbers in its name the one after 's', {number}, is taken for the setting; if "
            "it is another, name what precedes it: {pattern}",
            name,
            pattern=Option("rig", r"s(?P<setting>\d+)", "setting_pattern"),
        )

    def taken_as_words(self, settings: Iterable[Setting | None]) -> str:
        """Say that labels such as "L6 H1" were taken as words; empty where none was.

        Parameters
        ----------
        settings : iterable of Setting or None
            Of the logs of a run.
        """
        labels = [one.label for one in dict.fromkeys(settings) if one is not None]
        found = [letters_of(label) for label in labels]
        if len(self.adjusters) > 1 or len(labels) < _FEWEST_WORDS or not found[0]:
            return ""
        if any(sorted(one) != sorted(found[0]) for one in found):
            return ""
        declared = ", ".join(f'{letter} = ""' for letter in found[0])
        return (
            f"settings such as '{labels[0]}' and '{labels[1]}' are taken as words, so there are no "
            f"trends and no clicks: if the numbers are clicks, declare [adjusters] {declared}, or "
            "longer names that begin with these letters"
        )

    @property
    def tables_used(self) -> tuple[str, ...]:
        """Which tables of tests were used, a sentence each."""
        counts = [(table.path, len(table.rows)) for table in self.tables]
        return tuple(
            f"{path}: taken as the table of tests, {n} row{'s' * (n != 1)}" for path, n in counts
        )

    def missing(self, name: str, recording: Recording) -> LogError:
        """Return why a log without a setting cannot be fitted, with what to write."""
        row = self.row(Path(recording.path))
        if row is not None and not row.places and (columns := _clicks_of(row)):
            declared = ", ".join(f'{column} = ""' for column in columns)
            return LogError(
                f"line {row.line} of the table of tests does not say its setting; it has "
                f"{', '.join(columns)}: where these are adjusters, declare them in the "
                f"configuration, [adjusters] {declared}; else name the column of the setting "
                "'setting'",
                subject=name,
            )
        if len(self.adjusters) > 1:
            own = _places(recording, self.adjusters)
            lacks = ", ".join(one for one in self.adjusters if one not in own)
            example = ", ".join(f"{one}=8" for one in self.adjusters)
            return LogError(
                f"the log does not give {lacks}; expected lines such as "
                f"'# {self.adjusters[0]}: 8', columns, named groups of rig.setting_pattern, or a "
                f"table tests.csv; or give {{setting}}",
                setting=Option("setting", f"'{example}'"),
                subject=name,
            )
        more = ", or {way}" if self.guess.way is not None else ""
        return LogError(
            f"the log does not say its adjuster setting; expected a line '# setting: 10', "
            f"a column 'setting' or a name such as setting_10.csv; or give {{setting}}{more}",
            setting=Option("setting", "N"),
            way=self.guess.way,
            subject=name,
        )

    def row(self, path: Path) -> TestRow | None:
        """Return the row of a log: the one that names most of its path, in the nearest table."""
        best: tuple[tuple[int, int], TestRow] | None = None
        log = real_path(path)
        for table in self.tables:
            folder = real_path(table.path).parent
            if self.is_beside and not log.is_relative_to(folder):
                continue
            for name, row in table.rows.items():
                parts = Path(name).parts
                rank = len(parts), len(folder.parts)
                if log.parts[-len(parts) :] == parts and (best is None or rank > best[0]):
                    best = rank, row
        return None if best is None else best[1]


def _clicks_of(row: TestRow) -> list[str]:
    """Return the names of a row's other columns that hold clicks, as adjusters are named."""
    return [
        re.sub(r"[\W_]+", "_", name.casefold()).strip("_")
        for name, cell in row.identity.more
        if re.fullmatch(r"[+-]?\d{1,3}(\.\d)?", cell)
    ]


def _places(recording: Recording, adjusters: Sequence[str]) -> dict[str, Place]:
    """Return where a log says that its adjusters stand."""
    if recording.setting is not None:
        return dict(recording.setting.places)
    known = recording.metadata
    return {name: parse_place(known[name]) for name in adjusters if name in known}


def _complete(places: dict[str, Place], adjusters: Sequence[str]) -> Setting | None:
    if any(name not in places for name in adjusters):
        return None
    return Setting(tuple((name, places[name]) for name in adjusters))


def labels_for(
    paths: Iterable[Path], configuration: Configuration, *, setting: Setting | None
) -> Labels:
    """Return who says what of some logs, before they are read.

    Parameters
    ----------
    paths : iterable of pathlib.Path
        The logs.
    configuration : Configuration
        Adjusters, identity and table of tests.
    setting : Setting or None
        What the command line says.

    Raises
    ------
    ConfigurationError
        A table of tests is wrong, with its line.
    """
    logs = list(paths)
    reading = configuration.reading
    given = configuration.test.table
    found = [given] if given is not None else _beside(logs)
    tables = tuple(read_tests(path, reading.adjusters) for path in found)
    labels = Labels(
        reading.adjusters,
        setting,
        configuration.test.identity,
        tables,
        notes=tuple(note for table in tables for note in (*table.notes, *_unknown(table))),
        is_beside=given is None,
        has_pattern=reading.setting_pattern != SETTING_PATTERN,
    )
    unclear: frozenset[str] = frozenset()
    if setting is None and len(reading.adjusters) == 1 and not labels.has_pattern:
        unclear = unclear_names(path.name for path in logs if labels.row(path) is None)
    unsaid = [
        path.name
        for path in logs
        if labels.row(path) is None
        and (path.name in unclear or not _says(path.name, configuration))
    ]
    guess = guess_settings(unsaid) if len(reading.adjusters) == 1 and setting is None else Guess()
    return replace(labels, guess=guess, unclear=unclear)


def _beside(logs: Iterable[Path]) -> list[Path]:
    folders = dict.fromkeys(path.parent for path in logs)
    return [folder / "tests.csv" for folder in folders if is_tests_table(folder / "tests.csv")]


def _says(name: str, configuration: Configuration) -> bool:
    options, _ = configuration.reading.for_file(name)
    try:
        return bool(file_setting(name, options.setting_pattern, options.adjusters).places)
    except LogError:
        return True


def _unknown(table: TestsTable) -> list[str]:
    """Name the rows whose file is not there."""
    lost = [
        f"line {row.line} '{name}'"
        for name, row in table.rows.items()
        if not (table.path.parent / name).exists() and not list(table.path.parent.rglob(name))
    ]
    if not lost:
        return []
    more = f" and {len(lost) - _FEW} more" if len(lost) > _FEW else ""
    return [f"{table.path}: no such file: {', '.join(lost[:_FEW])}{more}"]
