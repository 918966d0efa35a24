"""Where a user says that a fit starts: numbers by name, or the parameters of an earlier run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError
from damperfit.problem import Option
from damperfit.tested.setting import nearest_setting

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.quantity import Quantity
    from damperfit.tested.setting import Setting

__all__ = ["GivenStart", "check_start"]


@dataclass(frozen=True, slots=True)
class GivenStart:
    """Numbers that a fit starts at; what is not given is the model's own start.

    Attributes
    ----------
    named : mapping of str to float
        Of every setting, SI; before those of the table.
    by_setting : mapping of Setting to mapping
        Of an earlier run. A setting that it does not have starts from the nearest one.
    is_of_one_model : bool
        Whether these are where one model of all settings has ended: a joint fit starts there too.
    """

    named: Mapping[str, float] = field(default_factory=dict)
    by_setting: Mapping[Setting, Mapping[str, float]] = field(default_factory=dict)
    is_of_one_model: bool = False

    def of(self, setting: Setting) -> dict[str, float]:
        """Return the numbers that a setting's fit starts at."""
        near = nearest_setting(setting, self.by_setting)
        return {**({} if near is None else self.by_setting[near]), **self.named}


def check_start(quantity: Quantity, value: float, *, is_fixed: bool, is_held: bool) -> None:
    """Refuse a start that cannot act or that no fit may reach.

    Raises
    ------
    ConfigurationError
        The quantity is fixed or held, or the value is beyond its plausible range.
    """
    name = quantity.name
    if is_fixed:
        raise ConfigurationError(f"{name} is fixed and also given a start; choose one.")
    if is_held:
        raise ConfigurationError(
            f"{name} is given a start but is not fitted: it is held at {quantity.default:g} "
            f"{quantity.unit} unless {{free}} names it; free it, or give {{fix}}.",
            free=Option("free"),
            fix=Option("fix", f"{value:g}", name),
        )
    low, high = quantity.plausible
    if not low <= value <= high:
        raise ConfigurationError(
            f"{name} = {value:g} is given as a start, far from any damper's; expected {low:g} to "
            f"{high:g} {quantity.unit}."
        )
