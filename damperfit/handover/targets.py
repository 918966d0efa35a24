"""The targets of ``damperfit export``: an entry each, and what it writes in a file of its own."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from damperfit.damper.purdy.parameters import Damper
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.handover.adams import write_dpr, write_xml
from damperfit.handover.carmaker import write_carmaker
from damperfit.handover.carsim import write_carsim
from damperfit.handover.chrono import write_chrono
from damperfit.handover.combitable import write_combitable
from damperfit.handover.csv_table import write_csv
from damperfit.handover.fmu.archive import missing_platforms, write_fmi2, write_fmi3
from damperfit.handover.matlab import write_matlab
from damperfit.handover.modelica import write_modelica
from damperfit.handover.plain_tables import TABLE_NAMES
from damperfit.handover.workbook import write_xlsx
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from damperfit.damper.model import Model
    from damperfit.handover.handed_over import HandedOver

__all__ = ["TARGETS", "ExportOptions", "Target", "find_target"]


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


@dataclass(frozen=True, slots=True)
class Target:
    """A program or format that a damper can be handed over to.

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
        Makes the files' bytes, by name.
    has_table : bool
        It holds force by speed, which may go beyond the tested speed and loses what a table loses.
    physics_of : tuple of type
        Models whose own equations it holds instead.
    takes : tuple of str
        Options that only some targets heed: "units", "decimal".
    beside : tuple of str
        Patterns of files that are written as far as the results hold what goes into them.
    notes : callable
        What to say when it was written, a sentence each.
    """

    name: str
    title: str
    file: str
    units: str
    sign: str
    place: str
    write: Callable[[HandedOver, ExportOptions], Mapping[str, bytes]]
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


# By name; a new target is a file beside this one and an entry here.
TARGETS: Mapping[str, Target] = {
    one.name: one
    for one in (
        Target(
            "csv",
            "table of force by setting and speed, and the tables of the results",
            "{stem}.csv",
            "m/s, N",
            "rebound is positive, and so is its force",
            "a spreadsheet, a script",
            write_csv,
            takes=("units", "decimal"),
            beside=(
                "{stem}_about.txt",
                *(f"{{stem}}_{name}.csv" for name in TABLE_NAMES),
            ),
        ),
        Target(
            "xlsx",
            "workbook, one sheet a table, with units and frozen headings",
            "{stem}.xlsx",
            "m/s, N",
            "rebound is positive, and so is its force",
            "Excel, LibreOffice",
            write_xlsx,
            takes=("units",),
        ),
        Target(
            "combitable",
            "text file of CombiTable1D and CombiTable2D, all settings",
            "{stem}.txt",
            "m/s, N",
            "rebound is positive, and so is its force",
            "Modelica.Blocks.Tables, tableOnFile; smoothness linear, extrapolation lastTwoPoints",
            write_combitable,
        ),
        Target(
            "modelica",
            "model without libraries: the paper's physics, for other models the table",
            "{stem}.mo",
            "m, m/s, N",
            "rebound (tension) is positive, and so is its force",
            "any Modelica tool; setting counts the settings from 1",
            write_modelica,
            physics_of=(Damper,),
        ),
        Target(
            "adams",
            "Adams/Car damper property file, TeimOrbit; MotionView reads it too",
            "{stem}_s{setting}.dpr",
            "mm/s, N",
            "rebound is positive, and so is its force",
            "dampers.tbl of a database",
            write_dpr,
        ),
        Target(
            "adams-xml",
            "Adams/Car damper property file, XML, with the gas force as constant preload",
            "{stem}_s{setting}.xml",
            "mm/s, N",
            "rebound is positive, and so is its force",
            "dampers.tbl of a database",
            write_xml,
        ),
        Target(
            "carmaker",
            "CarMaker Infofile, Damp_Push and Damp_Pull",
            "{stem}_s{setting}.txt",
            "m/s, N",
            "both tables without sign; Push is bump, Pull is rebound",
            "the vehicle's Infofile, for SuspF or SuspR",
            write_carmaker,
        ),
        Target(
            "carsim",
            "CarSim and TruckSim block FD_TABLE",
            "{stem}_s{setting}.par",
            "mm/s, N",
            "COMPRESSION is positive, and so is its force",
            "the shock absorber's data set, pasted",
            write_carsim,
        ),
        Target(
            "matlab",
            "MATLAB and Octave script and data file, velocity by setting",
            "{stem}.m, {stem}.mat",
            "m/s, N",
            "rebound is positive, and so is its force",
            "the path; breakpoints and table of a 2-D Lookup Table",
            write_matlab,
        ),
        Target(
            "chrono",
            "Chrono YAML, damping_curve_data of a TSDA",
            "{stem}_s{setting}.yaml",
            "m/s, N",
            "rebound is positive, and so is the curve; Chrono applies it with a minus",
            "tsdas of a model, with bodies and points added",
            write_chrono,
        ),
        Target(
            "fmu2",
            "FMU of FMI 2.0, co-simulation and model exchange, all settings",
            "{stem}.fmu",
            "SI",
            "rebound (rod out) is positive, and so is the force that resists it",
            "any vehicle simulator; inputs displacement and velocity",
            write_fmi2,
            has_table=False,
            notes=partial(missing_platforms, 2),
        ),
        Target(
            "fmu3",
            "FMU of FMI 3.0, co-simulation and model exchange, all settings",
            "{stem}.fmu",
            "SI",
            "rebound (rod out) is positive, and so is the force that resists it",
            "simulators that know FMI 3.0; inputs displacement and velocity",
            write_fmi3,
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
