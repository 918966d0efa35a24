"""What a user may declare about logs."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.quantities import find_unit

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["CHANNELS", "SETTING_PATTERN", "ReadOptions"]

# Channel of a recording -> dimension of its unit.
CHANNELS = {
    "time": "time",
    "displacement": "length",
    "force": "force",
    "temperature": "temperature",
}

# Number after "setting" or "s" in a file name. "s" must stand alone (run_s10, not runs10 and not
# 30s_2), and 10.5 is no setting.
SETTING_PATTERN = r"(?:setting|(?<![^\W_])s)[ _=-]?(\d+)(?![.]?\d)"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """How a log is read where it does not speak for itself.

    Attributes
    ----------
    setting : int or None
        Adjuster setting, whatever the log says.
    setting_pattern : str
        Regular expression whose first group is the setting in a file name; the last match
        counts, and case does not matter.
    columns : mapping of str to str or int
        Column of a channel, by name or by number from 1, as in {"force": "Load cell"}.
    units : mapping of str to str
        Unit of a channel, whatever the log says, as in {"displacement": "mm"}.
    reverse_force, reverse_displacement : bool
        The log counts the channel positive in bump.
    max_bytes : int
        Largest log to read, in bytes (of text, when it is compressed).

    Raises
    ------
    ConfigurationError
        An unknown channel or unit, or a pattern that is no regular expression with a group.
    """

    setting: int | None = None
    setting_pattern: str = SETTING_PATTERN
    columns: Mapping[str, str | int] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    reverse_force: bool = False
    reverse_displacement: bool = False
    max_bytes: int = 500_000_000

    def __post_init__(self) -> None:
        """Refuse options that mean nothing."""
        try:
            groups = re.compile(self.setting_pattern, re.IGNORECASE).groups
        except re.error as error:
            raise ConfigurationError(
                f"setting_pattern: {self.setting_pattern!r} is no regular expression: {error}"
            ) from error
        if groups < 1:
            raise ConfigurationError(
                f"setting_pattern: {self.setting_pattern!r} has no group (...) around the number"
            )
        for what, channels in (("columns", self.columns), ("units", self.units)):
            for channel in channels:
                if channel not in CHANNELS and not (what, channel) == ("columns", "setting"):
                    raise ConfigurationError(
                        f"{what}: no channel {channel!r}; there are {', '.join(CHANNELS)}."
                        f"{did_you_mean(channel, CHANNELS)}"
                    )
        for channel, unit in self.units.items():
            find_unit(unit, CHANNELS[channel])
        if self.max_bytes <= 0:
            raise ConfigurationError(f"max_bytes: found {self.max_bytes}, expected more than 0")
