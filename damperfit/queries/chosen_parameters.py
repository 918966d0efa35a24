"""Whose parameters a test is simulated with, and what is known of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.configuration.options import parameter_value
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import REFERENCE_SOURCE, reference_parameters
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.identification import unlimited_in, values_from_others
from damperfit.problem import Option
from damperfit.report.facts import listed_names
from damperfit.results import Run, Tested
from damperfit.store import settle
from damperfit.tables import table_quantities
from damperfit.tables.reading import is_part, part_in
from damperfit.tested.setting import ADJUSTER, Setting, parse_setting

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.damper.quantity import Quantity

__all__ = ["ChosenParameters", "choose_parameters", "table_meant"]

_WARMER = 1.0  # K; so much a log drifts by itself
_TABLES = ("parameters.parquet", "parameters.csv")


@dataclass(frozen=True, slots=True)
class ChosenParameters:
    """Parameters and where they came from.

    Attributes
    ----------
    parameters : Values
        SI.
    setting : Setting or None
        Adjuster setting, None when all parameters were given one by one.
    source : str
        One sentence for people.
    table : pathlib.Path or None
        Where they stand; None for the reference set, and when all were given.
    unlimited : tuple of str
        Those to which the logs of their setting set no upper limit.
    is_combined : bool
        No log of the setting was fitted: they come from other settings with its clicks.
    tested : Tested
        What the logs of the run covered.
    """

    parameters: Values
    setting: Setting | None
    source: str
    table: Path | None = None
    unlimited: tuple[str, ...] = ()
    is_combined: bool = False
    tested: Tested = Tested()

    def warnings(
        self,
        peak_speed: float,
        temperature: float | None = None,
        *,
        amplitude: float | None = None,
        frequency: float | None = None,
    ) -> tuple[str, ...]:
        """Return what to know before believing a force on such a motion (SI) at so many degC."""
        said, names = [], listed_names(self.unlimited)
        outside = self.tested.outside
        is_beyond = any(outside(speed=peak_speed))
        if beyond := list(outside(amplitude=amplitude, frequency=frequency, speed=peak_speed)):
            said.append(f"never tested: {', '.join(beyond)}; there the force is extrapolated")
        if temperature is not None and self.tested.temperatures is not None:
            low, high = self.tested.temperatures
            if temperature < low - _WARMER or temperature > high + _WARMER:
                said.append(
                    f"{temperature:.3g} degC: the tests were at {low:.3g} to {high:.3g} degC; "
                    "beyond that the viscosity is extrapolated"
                )
        if names and self.is_combined:
            said.append(
                f"{names} at setting {self.setting}: the logs of the settings that it is put "
                "together from set no upper limit, so these forces may be far off; fit a log of "
                "this setting, or give a value by --set"
            )
        elif names and is_beyond:
            said.append(
                f"{names}: the logs of setting {self.setting} set no upper limit, so the force "
                "beyond their speeds may be far off"
            )
        return tuple(said)


def choose_parameters(
    setting: Setting | int | str | None,
    *,
    table: Path | None,
    replaced: Mapping[str, str],
    folder: Path = Path("results"),
    damper: Model = PURDY_DAMPER,
) -> ChosenParameters:
    """Return the parameters to simulate with.

    Parameters
    ----------
    setting : Setting, int, str or None
        Adjuster setting, or its label; not needed when all parameters are replaced.
    table : pathlib.Path or None
        Parameters table or results folder; None takes the table in ``folder`` when there is one,
        else the reference set.
    replaced : mapping of str to str
        Values that replace the setting's, as text with or without a unit.
    folder : pathlib.Path
        Where `identify` writes its results.
    damper : Model
        The model, where all are replaced or no table tells its own.

    Raises
    ------
    ConfigurationError
        No setting, an unknown setting, an unknown name, or a table that cannot be read.
    """
    if all(one.name in replaced for one in damper.quantities if one.default is None):
        if table is not None:
            raise ConfigurationError(
                "nothing is taken from it, as {set_option} gives all parameters; leave one of the "
                "two out",
                set_option=Option("set"),
                where=Option("parameters", table),
            )
        chosen_name = None if setting is None else _meant(setting)
        given = damper.values(_replaced(damper.quantities, replaced))
        return ChosenParameters(given, chosen_name, "parameters: all given by --set")
    path = _table(table, folder)
    quantities = damper.quantities if path is None else table_quantities(path)
    values = _replaced(quantities, replaced)
    if setting is None:
        needed = (one.name for one in quantities if one.default is None)
        missing = ", ".join(name for name in needed if name not in values)
        raise ConfigurationError(
            f"no parameters for {missing}: give {{setting}} or {{set_option}} them all",
            setting=Option("setting", "N"),
            set_option=Option("set"),
        )
    if path is None and damper.name != PURDY_DAMPER.name:
        raise ConfigurationError(
            f"there is no reference set of the model {damper.name!r}: give {{parameters}}, or "
            "all of them by {set_option}",
            parameters=Option("parameters", "FILE"),
            set_option=Option("set"),
        )
    if path is None:
        chosen = _meant(setting)
        if isinstance(chosen.cell, str):
            raise ConfigurationError(
                "not in the reference set; expected a whole number, 1 to 20",
                where=Option("setting", setting),
            )
        found = ChosenParameters(reference_parameters(chosen.cell), chosen, "")
        source = f"setting {chosen} of the {REFERENCE_SOURCE}"
    else:
        run = Run.load(path)
        known = {one.setting: one.parameters for one in run.settings}
        chosen = _meant(setting, known)
        together = None if chosen in known else values_from_others(known, chosen)
        if chosen not in known and together is None:
            there = ", ".join(str(number) for number in sorted(known)) or "none"
            raise ConfigurationError(
                f"no parameters of setting {chosen}; there are {there}", subject=path
            )
        unlimited = {one.setting: frozenset(one.unlimited) for one in run.settings}
        parameters = known[chosen] if together is None else together
        names = unlimited.get(chosen, frozenset())
        if together is not None:
            names = frozenset(unlimited_in(together, known, unlimited))
        left = tuple(name for name in parameters.names if name in names and name not in values)
        found = ChosenParameters(
            parameters, chosen, "", path, left, together is not None, run.tested
        )  # fmt: skip
        source = f"setting {chosen} of {path}"
        if together is not None:
            source = f"setting {chosen}, put together from the clicks of the settings of {path}"
    if values:
        source = f"{source}; replaced: {', '.join(values)}"
    return replace(
        found, parameters=found.parameters.replace(values), source=f"parameters: {source}"
    )


def _replaced(quantities: Sequence[Quantity], texts: Mapping[str, str]) -> dict[str, float]:
    known = {one.name: one for one in quantities}
    for name in texts:
        if name not in known:
            raise ConfigurationError(
                f"no parameter {name!r}; there are {', '.join(known)}.{did_you_mean(name, known)}"
            )
    return {name: parameter_value(known[name], text) for name, text in texts.items()}


def _meant(setting: Setting | int | str, known: Collection[Setting] = ()) -> Setting:
    """Return the setting that a label names, best among those that are known."""
    if not isinstance(setting, str):
        return Setting.of(setting)
    named = {one.label.casefold(): one for one in known}
    adjusters = next(iter(known)).adjusters if known else (ADJUSTER,)
    try:
        return named.get(setting.strip().casefold()) or parse_setting(setting, adjusters)
    except ValueError as error:
        raise ConfigurationError(f"{error}", where=Option("setting", setting)) from error


def _table(given: Path | None, folder: Path) -> Path | None:
    """Return the parameters table that is meant; by default the one in a folder, if it is there."""
    if given is not None:
        return table_meant(given)
    settle(folder)
    return _table_in(folder)


def table_meant(given: Path) -> Path:
    """Return the parameters table that is meant; a folder means the one in it, or the part.

    Raises
    ------
    ConfigurationError
        A folder without one.
    """
    if is_part(given):
        return part_in(given)
    if not given.is_dir():
        return given
    settle(given)  # what an interrupted run put there may be none of the results
    found = _table_in(given)
    if found is None:
        raise ConfigurationError(f"no {_TABLES[0]} in this folder", subject=given)
    return found


def _table_in(folder: Path) -> Path | None:
    return next((folder / name for name in _TABLES if (folder / name).exists()), None)
