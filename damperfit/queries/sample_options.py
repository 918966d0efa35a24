"""What `samples` is asked for: true values of a table, a list of settings."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError
from damperfit.problem import Option
from damperfit.queries.chosen_parameters import table_meant
from damperfit.queries.origin import damper_of_table
from damperfit.results import Run

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Values

__all__ = ["as_options", "numbers_in", "truth_of"]

_MOST = 1000  # settings; more is a slip of the keyboard


def truth_of(
    given: Path, configuration: Configuration, config: Path | None
) -> tuple[dict[int, Values], Configuration, str]:
    """Return the values of a table, and the configuration and line of the damper they hold for."""
    path = table_meant(given)
    meant, damper = damper_of_table(path, configuration, config=config)
    known = {one.setting.cell: one.values for one in Run.load(path).settings}
    truth = {setting: values for setting, values in known.items() if isinstance(setting, int)}
    return truth, meant, damper


def as_options(said: str) -> str:
    """Return what options make no log, by the options of the command line.

    Examples
    --------
    >>> as_options("samples: force_noise is -1.0; expected 0 or more")
    '--force-noise -1.0: expected 0 or more'
    """
    told = re.fullmatch(r"samples: (\w+) is (.+); (expected .+)", said)
    if told is None:
        return said
    name = told[1].replace("_", "-")
    is_of_rig = told[1] in {"amplitude", "frequency"}
    return f"{f'rig.{name} =' if is_of_rig else f'--{name}'} {told[2]}: {told[3]}"


def numbers_in(text: str | Sequence[int]) -> tuple[int, ...]:
    """Return the settings that a list such as ``1,5,10-12`` names.

    Raises
    ------
    ConfigurationError
        It names none, or too many.
    """
    text = text if isinstance(text, str) else ",".join(map(str, text))
    try:
        numbers: list[int] = []
        for part in text.split(","):
            first, _, last = part.strip().partition("-")
            numbers.extend(range(int(first), min(int(last or first), int(first) + _MOST) + 1))
    except ValueError:
        numbers = []
    if not 0 < len(numbers) <= _MOST:
        raise ConfigurationError(
            "expected a list such as 1,5,10-12", where=Option("settings", text)
        )
    return tuple(dict.fromkeys(numbers))
