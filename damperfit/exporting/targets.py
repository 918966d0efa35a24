"""The targets of ``damperfit export``, a line each, and the writing of what they hold."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from damperfit.damper.purdy.parameters import Damper
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.exporting import text_tables as text
from damperfit.exporting.fmu import missing_platforms, write_fmu
from damperfit.exporting.header import determined_line, road_line
from damperfit.exporting.modelica import modelica
from damperfit.exporting.tables import force_tables
from damperfit.exporting.workbook import TABLE_NAMES, write_xlsx
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
        Speed up to which tables go, m/s; None: as far as the logs determine the force.
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
    title : str
        What it is, in a few words.
    file : str
        Pattern of its files' names: ``{stem}.csv``, or ``{stem}_s{setting}.dpr`` for one a setting;
        several with a comma between.
    units : str
        Of speed and force, or "SI".
    sign : str
        What is positive, in words.
    place : str
        Where it goes, for people.
    write : callable
        Makes of run, tables and options the text of a file, which holds one table or all, or the
        bytes of several files by name.
    encoding : str
        Of text; what it cannot hold becomes a question mark.
    notes : callable
        What to say when it was written, a sentence each.
    has_table : bool
        It holds force by speed.
    physics_of : tuple of type
        Models whose own equations it holds instead.
    takes : tuple of str
        Options that only some targets heed: "units", "decimal".
    beside : tuple of str
        Patterns of files that are written as far as the results hold what goes into them.
    """

    name: str
    title: str
    file: str
    units: str
    sign: str
    place: str
    write: Callable[[ExportedRun, Sequence[ForceTable], ExportOptions], str | Mapping[str, bytes]]
    encoding: str = "utf-8"
    notes: Callable[[], tuple[str, ...]] = tuple
    has_table: bool = True
    physics_of: tuple[type[Model], ...] = ()
    takes: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()

    def has_table_of(self, damper: Model) -> bool:
        """Whether the file of this damper holds a table."""
        return self.has_table and not isinstance(damper, self.physics_of)

    @property
    def suffixes(self) -> tuple[str, ...]:
        """Of its files, with the dot."""
        return tuple("." + one.rpartition(".")[2] for one in self.file.split(", "))

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
        if out.suffix.lower() not in self.suffixes:
            raise ConfigurationError(
                f"--out {out}: {self.name} writes {' and '.join(self.suffixes)} files; give a "
                "name that ends so, or a folder"
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
                f"--extend {options.extend:g}: {self.name} holds no table here; leave it out"
            )
        tables = force_tables(
            run, extend=options.extend, common=not is_one_each, whole=not has_table
        )
        files: dict[str, bytes] = {}
        for group in [(one,) for one in tables] if is_one_each else [tables]:
            made = self.write(run, group, options)
            if isinstance(made, str):
                name = self.file.format(stem=options.stem, setting=group[0].slug)
                lost = "xmlcharrefreplace" if made.startswith("<?xml") else "replace"
                made = {name: made.encode(self.encoding, lost)}
            files |= made
        return Export(
            files,
            tables,
            road_line(run, tables) if has_table else "",
            determined_line(tables),
            (*run.notes, *self.notes()),
        )


_REBOUND = "rebound is positive, and so is its force"
_ROD_OUT = "rebound (rod out) is positive, and so is the force that resists it"

# By name; a new target is a function and a line here.
TARGETS: Mapping[str, Target] = {
    one.name: one
    for one in (
        Target(
            "csv",
            "table of force by setting and speed, and the tables of the results",
            "{stem}.csv",
            "m/s, N",
            _REBOUND,
            "a spreadsheet, a script",
            text.csv_files,
            takes=("units", "decimal"),
            beside=("{stem}_about.txt", *(f"{{stem}}_{name}.csv" for name in TABLE_NAMES)),
        ),
        Target(
            "xlsx",
            "workbook, one sheet a table, with units and frozen headings",
            "{stem}.xlsx",
            "m/s, N",
            _REBOUND,
            "Excel, LibreOffice",
            write_xlsx,
            takes=("units",),
        ),
        Target(
            "combitable",
            "text file of CombiTable1D and CombiTable2D, all settings",
            "{stem}.txt",
            "m/s, N",
            _REBOUND,
            "Modelica.Blocks.Tables, tableOnFile; smoothness linear, extrapolation lastTwoPoints",
            text.combitable,
        ),
        Target(
            "modelica",
            "model without libraries: the paper's physics, for other models the table",
            "{stem}.mo",
            "m, m/s, N",
            "rebound (tension) is positive, and so is its force",
            "any Modelica tool; setting counts the settings from 1",
            modelica,
            physics_of=(Damper,),
        ),
        Target(
            "adams",
            "Adams/Car damper property file, TeimOrbit; MotionView reads it too",
            "{stem}_s{setting}.dpr",
            "mm/s, N",
            _REBOUND,
            "dampers.tbl of a database",
            text.adams_dpr,
            "ascii",
        ),
        Target(
            "adams-xml",
            "Adams/Car damper property file, XML, with the gas force as constant preload",
            "{stem}_s{setting}.xml",
            "mm/s, N",
            _REBOUND,
            "dampers.tbl of a database",
            text.adams_xml,
            "iso-8859-1",
        ),
        Target(
            "carmaker",
            "CarMaker Infofile, Damp_Push and Damp_Pull",
            "{stem}_s{setting}.txt",
            "m/s, N",
            "both tables without sign; Push is bump, Pull is rebound",
            "the vehicle's Infofile, for SuspF or SuspR",
            text.carmaker,
        ),
        Target(
            "carsim",
            "CarSim and TruckSim block FD_TABLE",
            "{stem}_s{setting}.par",
            "mm/s, N",
            "COMPRESSION is positive, and so is its force",
            "the shock absorber's data set, pasted",
            text.carsim,
            "ascii",
        ),
        Target(
            "matlab",
            "MATLAB and Octave script and data file, velocity by setting",
            "{stem}.m, {stem}.mat",
            "m/s, N",
            _REBOUND,
            "the path; breakpoints and table of a 2-D Lookup Table",
            text.matlab_files,
        ),
        Target(
            "chrono",
            "Chrono YAML, damping_curve_data of a TSDA",
            "{stem}_s{setting}.yaml",
            "m/s, N",
            "rebound is positive, and so is the curve; Chrono applies it with a minus",
            "tsdas of a model, with bodies and points added",
            text.chrono,
        ),
        Target(
            "fmu2",
            "FMU of FMI 2.0, co-simulation and model exchange, all settings",
            "{stem}.fmu",
            "SI",
            _ROD_OUT,
            "any vehicle simulator; inputs displacement and velocity",
            partial(write_fmu, version=2),
            has_table=False,
            notes=partial(missing_platforms, 2),
        ),
        Target(
            "fmu3",
            "FMU of FMI 3.0, co-simulation and model exchange, all settings",
            "{stem}.fmu",
            "SI",
            _ROD_OUT,
            "simulators that know FMI 3.0; inputs displacement and velocity",
            partial(write_fmu, version=3),
            has_table=False,
            notes=partial(missing_platforms, 3),
        ),
    )
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
            f"--to {name}: expected one of {', '.join(TARGETS)}.{did_you_mean(name, TARGETS)} "
            "damperfit export --list shows them"
        )
    return TARGETS[name]
