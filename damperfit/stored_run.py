"""What a run consists of, in memory and as a folder: its record, its tables, its signals.

`StoredRun.load` is all that reads a results folder, a fleet's part or a table of parameters.
Whatever is whole is there; what is missing, damaged or of another version stands in `remarks`, and
a table or signal is read when it is first asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Self

from damperfit.damper.model import Quantity
from damperfit.errors import ConfigurationError, OutputError, refuse_wrong_arguments
from damperfit.io.files import read_bytes, read_text, sha256_of
from damperfit.problem import Option, Problem, distinct, warning
from damperfit.recording import natural_order
from damperfit.reporting.records import entries_in, units_in
from damperfit.store import file_set, path_of, settle
from damperfit.tables import files as table_files
from damperfit.tables.columns import PAPER_QUANTITIES, TABLES, unknown_schema
from damperfit.tables.files import LogSignals

if TYPE_CHECKING:
    import pyarrow as pa


PAGE = "report.html"
_OF_TABLE = {"schema_version", "table", "quantities"}  # facts that each table has of its own
_OF_CALL = {"_config", "_temperature"}  # of a run that is read: they are its reader's
_IN_MEMORY = (
    *("record", "quantities", "facts", "report_text", "place", "shown_as"),
    *("_rows", "_signals", "_remarks", "_lost", "_config", "_temperature", "_source"),
)


class StoredRun:
    """Record, tables and signals of a run; it pickles with all its files.

    `record` is what run.json holds; `quantities` what the columns of the parameters are of; `place`
    the folder, part of a fleet or table that it stands in, None: nowhere yet; `facts` how its
    tables were made. ``config`` is a file of the user, whose damper is taken where the run does not
    state its own, ``temperature`` that of the oil, as typed. ``signals`` may be what makes them,
    one log after the other, when they are first wanted.
    """

    def __init__(  # noqa: PLR0913 - what a run is made of
        self,
        record: Mapping[str, Any] | None = None,
        rows: Mapping[str, Sequence[dict[str, Any]]] | None = None,
        *,
        quantities: tuple[Quantity, ...] = PAPER_QUANTITIES,
        place: Path | None = None,
        signals: Sequence[LogSignals] | Callable[[], Iterable[LogSignals]] | None = None,
        remarks: Sequence[Problem] = (),
        config: Path | None = None,
        temperature: str | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> None:
        self.record: dict[str, Any] = dict(record or {})
        self.quantities = quantities
        self.place = place
        self.report_text = ""
        self._rows = {name: tuple(own) for name, own in (rows or {}).items()}
        self._signals = signals
        self._remarks = list(remarks)
        self._config, self._temperature = config, temperature
        # The path that people are shown.
        self._source = self.shown_as = str(place or "this run")
        self._lost: set[str] = set()  # tables that should be there
        if facts is not None:
            self.facts = dict(facts)

    @classmethod
    def load(
        cls,
        place: str | Path | Self,
        *,
        parts: Sequence[str] = ("parameters", "mse", "responses", "valves"),
        config: Path | None = None,
        temperature: str | None = None,
    ) -> Self:
        """Read a results folder, a fleet's part, the folder of a serial number, or a table.

        A run is as good as its folder. The tables in ``parts`` are read, and remarked on, at once,
        the others when they are asked for; ``config`` and ``temperature`` as of the class.

        Raises
        ------
        ConfigurationError
            There is none, or nothing of it can be read.
        OutputError
            Writing was interrupted there, and the earlier results cannot be put back.
        """
        more: dict[str, Any] = {"config": config, "temperature": temperature}
        if isinstance(place, cls):
            if (config, temperature) == (place._config, place._temperature):  # noqa: SLF001
                return place
            if place.place is not None:
                return cls.load(place.place, parts=(), **more)
            again = cls(config=config, temperature=temperature)
            own = {name: getattr(place, name) for name in _IN_MEMORY if name not in _OF_CALL}
            again.__dict__ |= own | {"_remarks": list(place._remarks)}  # noqa: SLF001 - its own
            return again
        place = path_of(place, "damperfit.load", "the path of a results folder")
        remarks: list[Problem] = []
        more |= {"place": place, "remarks": remarks}
        if table_files.is_part(place):
            record, quantities, rows = table_files.read_part(place, remarks)
            return cls(record, {"parameters": rows}, quantities=quantities, **more)
        if place.is_file() or place.suffix in {".csv", ".parquet"}:
            record, quantities, rows, source = table_files.read_table(place)
            beside = table_files.read_record(place.parent / "run.json", [])
            table_files.check_files(place.parent, beside, remarks, [place.stem])
            run = cls(record, {"parameters": rows}, quantities=quantities, **more)
            run._source = source
            return run
        if not place.is_dir():
            text = "no such folder; expected the results of damperfit identify"
            raise ConfigurationError(text, subject=place, code="no-folder")
        settle(place)
        record = table_files.read_record(place / "run.json", remarks)
        if schema := unknown_schema(record):
            remarks.append(warning("other-schema", schema))
        table_files.check_files(place, record, remarks, parts)
        quantities = table_files.table_quantities(place / "parameters.parquet", record)
        run = cls(record, quantities=quantities, **more)
        for name in parts:
            _ = run.signals if name == "responses" else run.rows(name)
        if not run._rows.get("parameters") and not run._signals:
            raise ConfigurationError(
                f"nothing to show, {'; '.join(map(str, run._remarks)) or 'its tables are empty'}; "
                "run identify with {out} first",
                out=Option("out", "FOLDER"),
                subject=place,
                code="no-results",
            )
        run._check_settings()
        return run

    @property
    def remarks(self) -> tuple[Problem, ...]:
        """What was missing, damaged or written by another version."""
        return distinct(self._remarks)

    @property
    def folder(self) -> Path | None:
        """Where its files are; None: nowhere yet, see `save`."""
        return self.place

    def rows(self, name: str) -> tuple[dict[str, Any], ...]:
        """Return the rows of a table, by column; None where a cell or a column is missing."""
        if name not in self._rows:
            stored, n_remarks = self._stored, len(self._remarks)
            if stored is None or not (name in {"parameters", "mse"} or self._has(name)):
                return ()
            rows = table_files.read_rows(stored, name, self._remarks, self.quantities, self.record)
            if not rows and len(self._remarks) > n_remarks:
                self._lost.add(name)
            once = {row["setting"]: row for row in reversed(rows)}  # the first of each
            if name == "parameters" and len(once) < len(rows):
                rows = tuple(reversed(once.values()))
                text = "the parameters table lists a setting more than once: its first row is shown"
                self._remarks.append(warning("given-twice", text))
            self._rows[name] = rows
        return self._rows[name]

    def _has(self, name: str) -> bool:
        if name in self._lost:
            return False
        if name in self._rows or (name == "responses" and self._signals):
            return True
        return self._stored is not None and table_files.has_table(self._stored, self.record, name)

    def table(self, name: str) -> pa.Table:
        """Return a table as it is written: its columns have units and meaning as metadata."""
        if name == "responses":
            return table_files.responses_table(self.signals, **self._layout)
        return table_files.lay_out(name, self.rows(name), **self._layout)

    @property
    def _layout(self) -> dict[str, Any]:
        """What all tables have in common: whether settings are numbers, what columns are of."""
        settings = [row["setting"] for row in self.rows("parameters")]
        return {"settings": settings, "quantities": self.quantities, "facts": self.facts}

    @cached_property
    def facts(self) -> dict[str, Any]:
        """How its tables were made."""
        if self._stored is None:
            return {}
        facts = table_files.read_facts(self._stored / "parameters.parquet")
        return {key: value for key, value in facts.items() if key not in _OF_TABLE}

    @property
    def signals(self) -> tuple[LogSignals, ...]:
        """Measured and simulated signals by setting and log."""
        if not isinstance(self._signals, tuple):
            stored = self._stored
            made: Iterable[LogSignals] = ()
            if self._signals is not None:
                made = self._signals() if callable(self._signals) else self._signals
            elif stored is not None:
                made = table_files.read_signals(stored, self._remarks, self.quantities)
            ordered = sorted(made, key=lambda log: (log.setting, natural_order(log.log)))
            self._signals = tuple(ordered)
            if stored is not None and not ordered:
                self._lost.add("responses")
        return self._signals

    @property
    def _stored(self) -> Path | None:
        """The results folder that it is read from; None: it is in memory, or a table or part."""
        place = self.place
        return place if place and place.is_dir() and not table_files.is_part(place) else None

    def _check_settings(self) -> None:
        """Remark on settings that stand in one table alone; where one is empty, that was said."""
        parameters = self._rows.get("parameters", ())
        fitted = {row["setting"] for row in parameters if row["mse_percent"] is not None}
        listed = {row["setting"] for row in parameters}
        drawn = {log.setting for log in self.signals} if self._signals is not None else set()
        mute, strange = fitted - drawn if drawn else set(), drawn - listed if listed else set()
        for lone, what in (
            (mute, "parameters but no signals, so no loops"),
            (strange, "signals but no parameters"),
        ):
            if lone:
                which = f"setting {', '.join(map(str, sorted(lone)))}"
                self._remarks.append(warning("one-table", what, which))

    @property
    def exit_code(self) -> int:
        """How the command that made it ended: 0, or see the manual (gates)."""
        return int(self.record.get("exit_code", 0))

    def document(self) -> dict[str, Any]:
        """Return run.json and the rows of parameters and MSE as one JSON document."""
        return self.record | {n: self.table(n).to_pylist() for n in ("parameters", "mse")}

    @property
    def inputs(self) -> list[dict[str, Any]]:
        """Entries of run.json on the logs."""
        return entries_in(self.record, "inputs")

    @refuse_wrong_arguments("run.save")
    def save(self, folder: str | Path) -> Path:
        """Write its files into a folder, as a set, and return it.

        An OutputError: it cannot be written, or is the folder of this run.
        """
        where = path_of(folder, "run.save", "the path of a folder")
        table_files.spare_others(where)
        if self.place is None:
            self._write(where)
            return where
        if where.resolve() == self.place.resolve():
            text = "these results are there already; give another folder"
            raise OutputError(text, subject=where, code="is-there")
        paths = [self.place] if self.place.is_file() else sorted(self.place.iterdir())
        with file_set(where) as files:
            for path in paths:
                if path.is_file() and path.name[0] != ".":  # a lock, or half a file
                    files.path(path.name).write_bytes(read_bytes(path))
        return where

    def stand_in(self, folder: Path) -> None:
        """Take a folder that it was saved to for its own: what is large is read there from now."""
        self.place, self._source, self._signals = folder, str(folder), None

    def _write(self, folder: Path) -> None:
        """Write a run that is in memory as a set of files; those of an earlier run go."""
        begin, units = perf_counter(), units_in(self.record)
        with file_set(folder) as files:
            there = [name for name in self._rows if self._has(name)]
            for name in there:
                table = self.table(name)
                table_files.write_table(files.path(f"{name}.parquet"), table, suffix=".parquet")
                shown = table_files.table_in_units(table, units)
                table_files.write_table(files.path(f"{name}.csv"), shown, suffix=".csv")
            signals = self._signals() if callable(self._signals) else self._signals or ()
            table_files.write_responses(files.path("responses.parquet"), signals, **self._layout)
            text = self.report_text.encode("utf-8", "backslashreplace")
            files.path("report.md").write_bytes(text)
            for name in set(TABLES) - {*there, "responses"}:
                files.without(f"{name}.parquet")
                files.without(f"{name}.csv")
            files.without(PAGE)
            self.record["files"] = {
                name: sha256_of(files.path(name)) for name in sorted(files.names)
            }
            if isinstance(timings := self.record.get("timings"), dict):
                elapsed = round(perf_counter() - begin, 4)
                total = round(timings.get("total_s", 0.0) + elapsed, 4)
                self.record["timings"] = timings | {"write_s": elapsed, "total_s": total}
            with files.path("run.json").open("wb") as file:
                for piece in table_files.json_pieces(self.record):
                    file.write(piece.encode("utf-8", "backslashreplace"))
        table_files.forget_figures(folder)

    def __getstate__(self) -> dict[str, Any]:
        """Return all that is known, in memory: what a pickle holds."""
        self.signals  # noqa: B018 - read
        for name in set(TABLES) - {"responses"}:
            self.rows(name)
        if self._stored is not None:
            with suppress(OSError, ValueError):
                self.report_text = self.report_text or read_text(self._stored / "report.md")
        state = {name: getattr(self, name) for name in _IN_MEMORY}
        return state | {"place": None}
