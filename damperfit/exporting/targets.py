"""The targets of ``damperfit export``: entries of ``targets.toml``, and what makes them."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import partial
from importlib import resources
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.exporting.fmu import missing_platforms, write_fmu
from damperfit.exporting.header import determined_line, road_line
from damperfit.exporting.spreadsheets import csv_files, write_xlsx
from damperfit.exporting.tables import force_tables
from damperfit.exporting.writers import matlab_files, modelica, text_of
from damperfit.problem import Option
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from damperfit.damper.model import Model
    from damperfit.exporting.source import ExportedRun
    from damperfit.exporting.tables import ForceTable

__all__ = ["TARGETS", "Export", "ExportOptions", "Target", "find_target"]


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What the user may choose.

    Attributes
    ----------
    stem : str
        What the names of the files begin with.
    extend : float or None
        Speed up to which tables go, m/s; None: to the tested speed.
    units : ShownUnits
        Of spreadsheets; a simulator has units of its own.
    decimal : str
        Mark of the decimals in CSV: a point or a comma.
    """

    stem: str = "damper"
    extend: float | None = None
    units: ShownUnits = SI
    decimal: str = "."


@dataclass(frozen=True, slots=True, eq=False)
class Export:
    """What was made for a target.

    Attributes
    ----------
    files : mapping of str to bytes
        By name.
    tables : tuple of ForceTable
        Force by speed of each setting, as it stands in them, or would.
    lost : str
        How far the damper's dynamics are from its table; empty where they hold no table.
    determined : str
        Up to which speed the logs determine the force.
    notes : tuple of str
        What else to know.
    """

    files: Mapping[str, bytes]
    tables: tuple[ForceTable, ...]
    lost: str
    determined: str
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Target:
    """A program or format that a damper can be exported to.

    Attributes
    ----------
    name : str
        As on the command line.
    title, units, sign, place : str
        For people: what it is, its units of speed and force, what is positive, where it goes.
    file : str
        Pattern of its files' names: ``{stem}.csv``, or ``{stem}_s{setting}.dpr`` for one a setting;
        several with a comma between.
    template, encoding : str
        Of a text that a template makes; what the encoding cannot hold becomes a question mark.
    has_table : bool
        It holds force by speed.
    physics_of : sequence of str
        Models whose own equations it holds instead.
    takes : sequence of str
        Options that only some targets heed: "units", "decimal".
    """

    name: str
    title: str
    file: str
    units: str
    sign: str
    place: str
    template: str = ""
    encoding: str = "utf-8"
    has_table: bool = True
    physics_of: Sequence[str] = ()
    takes: Sequence[str] = ()

    def has_table_of(self, damper: Model) -> bool:
        """Whether the file of this damper holds a table."""
        return self.has_table and damper.name not in self.physics_of

    def place_of(self, out: Path) -> tuple[Path, str]:
        """Return the folder to write to, and what the files' names begin with.

        Parameters
        ----------
        out : pathlib.Path
            A file if it has a suffix, else a folder.

        Raises
        ------
        ConfigurationError
            The suffix is not the target's.
        """
        if not out.suffix or out.is_dir():
            return out, "damper"
        suffixes = ["." + one.rpartition(".")[2] for one in self.file.split(", ")]
        if out.suffix.lower() not in suffixes:
            raise ConfigurationError(
                f"{self.name} writes {' and '.join(suffixes)} files; give a "
                "name that ends so, or a folder",
                where=Option("out", out),
            )
        return out.parent, out.stem

    def export(self, run: ExportedRun, options: ExportOptions = ExportOptions()) -> Export:
        """Return what this target's files hold of a run.

        Raises
        ------
        ConfigurationError
            The target holds no such damper, or ``extend`` is of no use.
        SimulationError
            The model cannot be simulated.
        """
        has_table = self.has_table_of(run.damper)
        is_one_each = "{setting}" in self.file
        if options.extend is not None and not has_table:
            raise ConfigurationError(
                f"{self.name} holds no table here; leave it out",
                where=Option("extend", f"{options.extend:g}"),
            )
        tables = force_tables(run, extend=options.extend, common=not is_one_each)
        write = text_of(self.template) if self.template else _WRITERS[self.name]
        files: dict[str, bytes] = {}
        for group in [(one,) for one in tables] if is_one_each else [tables]:
            made = write(run, group, options)
            if isinstance(made, str):
                name = self.file.format(stem=options.stem, setting=group[0].slug)
                lost = "xmlcharrefreplace" if made.startswith("<?xml") else "replace"
                made = {name: made.encode(self.encoding, lost)}
            files |= made
        fmi = {"fmu2": 2, "fmu3": 3}.get(self.name)
        return Export(
            files,
            tables,
            road_line(run, tables) if has_table else "",
            determined_line(tables),
            (*run.notes, *(missing_platforms(fmi) if fmi else ())),
        )


# What no template makes.
_WRITERS: Mapping[
    str,
    Callable[[ExportedRun, Sequence[ForceTable], ExportOptions], str | Mapping[str, bytes]],
] = {
    "csv": csv_files,
    "xlsx": write_xlsx,
    "matlab": matlab_files,
    "modelica": modelica,
    "fmu2": partial(write_fmu, version=2),
    "fmu3": partial(write_fmu, version=3),
}
# By name; a new target is a template and an entry there.
TARGETS: Mapping[str, Target] = {
    name: Target(name, **entry)
    for name, entry in tomllib.loads(
        resources.files("damperfit.exporting").joinpath("targets.toml").read_text("utf-8")
    ).items()
}


def find_target(name: str) -> Target:
    """Return the target of a name.

    Raises
    ------
    ConfigurationError
        There is none.
    """
    if name not in TARGETS:
        raise ConfigurationError(
            f"expected one of {', '.join(TARGETS)}.{did_you_mean(name, TARGETS)} "
            "damperfit export --list shows them",
            where=Option("to", name),
        )
    return TARGETS[name]
