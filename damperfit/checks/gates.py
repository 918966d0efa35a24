"""Gates: the checks of a run that were asked for, by name or by list.

A check that nobody looked at is a gate not met: it must not be let through.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.checks.named_checks import CHECKS
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from damperfit.checks.named_checks import Check

__all__ = ["CHECK_LISTS", "expand_checks", "missed_gates"]

# What the paper looked at by hand: the MSE at every setting (its section 6), cavitation (6.2), the
# run of the parameters over the settings (Figs 14 to 16), and the temperature of the test.
CHECK_LISTS: dict[str, tuple[str, ...]] = {
    "purdy2000": (
        "every_setting_fitted",
        "mse_below_1_percent",
        "no_parameter_at_bound",
        "no_cavitation",
        "trend_monotone",
        "no_outlier_setting",
        "temperature_in_window",
    ),
}


def expand_checks(names: Iterable[str], *, pointless: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the checks that names of checks and of lists stand for, each once.

    Parameters
    ----------
    names : iterable of str
        Of `CHECKS` or `CHECK_LISTS`; with a minus before it a check is left out of what the
        others stand for.
    pointless : iterable of str
        Checks that cannot be looked at by the test's own declaration: lists go without them.

    Raises
    ------
    ConfigurationError
        No check and no list has that name, or a check is left out that is not in.

    Examples
    --------
    >>> expand_checks(["no_cavitation", "no_cavitation"])
    ('no_cavitation',)
    >>> "temperature_in_window" in expand_checks(["purdy2000", "-temperature_in_window"])
    False
    """
    found: list[str] = []
    left_out: list[str] = []
    for text in names:
        name = text.removeprefix("-")
        if name not in CHECKS and name not in CHECK_LISTS:
            known = (*CHECKS, *CHECK_LISTS)
            raise ConfigurationError(
                f"no check {text!r}; there are {', '.join(CHECKS)} and the lists "
                f"{', '.join(CHECK_LISTS)}.{did_you_mean(name, known)}",
                where=Key(("output", "checks")),
            )
        members = CHECK_LISTS.get(name, (name,))
        if text.startswith("-"):
            left_out.extend(members)
        elif name in CHECKS:
            found.append(name)
        else:
            found.extend(member for member in members if member not in set(pointless))
    absent = [name for name in left_out if name not in found and name not in set(pointless)]
    if absent:
        raise ConfigurationError(
            f"check '-{absent[0]}' excludes a check that was not requested; expected it after a "
            f"list that includes it, as in {next(iter(CHECK_LISTS))},-{absent[0]}"
        )
    return tuple(dict.fromkeys(name for name in found if name not in left_out))


def missed_gates(checks: Sequence[Check], gates: Iterable[str]) -> tuple[str, ...]:
    """Return one sentence for each gate that is not met, or that could not be looked at."""
    results = {check.name: check for check in checks}
    said = []
    for name in gates:
        check = results[name]
        if not check.passed:
            how = "check" if check.passed is False else "check not evaluated:"
            said.append(f"{how} {name}: {check.reason}")
    return tuple(said)
