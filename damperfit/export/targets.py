"""The targets of ``damperfit export``: an entry each, and what it writes in a file of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.export.csv_table import write_csv

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from damperfit.export.handed_over import HandedOver

__all__ = ["TARGETS", "ExportOptions", "Target", "find_target"]


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What the user may choose.

    Attributes
    ----------
    stem : str
        What the names of the files begin with.
    """

    stem: str = "damper"


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
        Pattern of its files' names: ``{stem}.csv``, or ``{stem}_s{setting}.dpr`` for one a setting.
    units : str
        Of speed and force, or "SI".
    sign : str
        What is positive, in words.
    place : str
        Where it goes, for people.
    write : callable
        Makes the files' bytes, by name.
    """

    name: str
    title: str
    file: str
    units: str
    sign: str
    place: str
    write: Callable[[HandedOver, ExportOptions], Mapping[str, bytes]]

    @property
    def suffix(self) -> str:
        """Of its files, with the dot."""
        return "." + self.file.rpartition(".")[2]


# By name; a new target is a file beside this one and an entry here.
TARGETS: Mapping[str, Target] = {
    one.name: one
    for one in (
        Target(
            "csv",
            "table of force by setting and speed",
            "{stem}.csv",
            "m/s, N",
            "rebound is positive, and so is its force",
            "a spreadsheet, a script",
            write_csv,
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
