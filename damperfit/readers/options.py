"""What a user may declare about logs: for all of them, or for those of one rig in a profile."""

from __future__ import annotations

import math
import re
from dataclasses import MISSING, dataclass, field, fields, replace
from fnmatch import fnmatch
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.quantities import find_unit, parse_quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = [
    "CHANNELS",
    "EXTRAS",
    "SEPARATORS",
    "SETTING_PATTERN",
    "Declarations",
    "Profile",
    "ReadOptions",
    "make_profile",
]

# Channel of a recording -> dimension of its unit.
CHANNELS = {
    "time": "time",
    "displacement": "length",
    "force": "force",
    "temperature": "temperature",
    "velocity": "velocity",
}
# Channels that a log is good without; where they are missing or damaged they are left out.
EXTRAS = ("temperature", "velocity")

# Number after "setting" or "s" in a file name. "s" must stand alone (run_s10, not runs10 and not
# 30s_2), and 10.5 is no setting.
SETTING_PATTERN = r"(?:setting|(?<![^\W_])s)[ _=-]?(\d+)(?![.]?\d)"

_SIGNS = ("reverse_force", "reverse_displacement")
_DIMENSIONS = {"sample_rate": "frequency", "pause": "time"}
# What the user may call a character that is hard to see in a configuration.
SEPARATORS = {",": ",", ";": ";", "|": "|", "\t": "\t", "tab": "\t", " ": " ", "blanks": " "}
_WORDS = {
    "separator": ("", *SEPARATORS),
    "decimal": ("", ".", ","),
    "thousands": ("", ".", ",", "'", " "),
    "restarts": ("refuse", "split", "last"),
    "bad_rows": ("refuse", "drop"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Declarations:
    """How logs are to be understood where they do not speak for themselves.

    Attributes
    ----------
    setting_pattern : str
        Regular expression whose first group is the setting in a file name; the last match
        counts, and case does not matter.
    part_settings : tuple of int
        Settings of the tests in one file, in their order; empty when the log says them.
    columns : mapping of str to str or int
        Column of a channel, by name or by number from 1, as in {"force": "Load cell"}.
    units : mapping of str to str
        Unit of a channel, whatever the log says, as in {"displacement": "mm"}.
    scales, offsets : mapping of str to float
        value = scale * logged + offset, in the channel's unit, as for volts.
    reverse_force, reverse_displacement : bool or str
        Whether the log counts the channel positive in bump; "detect": not declared.
    encoding : str
        Of text, as in "cp1252"; empty: UTF-8, UTF-16 with a mark, else Latin-1.
    separator : str
        Of fields: "," ";" "|" "tab" or "blanks"; empty: found from the rows.
    decimal : str
        Decimal mark, "." or ","; empty: found from the rows.
    thousands : str
        Mark between groups of three digits; empty: there is none, and "1,234" is refused.
    skip_lines : int
        Lines of text above the log that are not looked at.
    sample_rate : float
        Hz; time is the number of the sample divided by it. 0: the log tells the time.
    pause : float
        A step in time longer than this begins another test, s. 0: 2 s and 50 times the usual.
    restarts : str
        When time runs backwards: "refuse" the log, "split" it into tests, or keep the "last".
    bad_rows : str
        Rows with text or blanks in a channel, or too few or many fields: "refuse" or "drop".

    Raises
    ------
    ConfigurationError
        An unknown channel, unit or word, or a pattern that is no regular expression with a group.
    """

    setting_pattern: str = SETTING_PATTERN
    part_settings: tuple[int, ...] = ()
    columns: Mapping[str, str | int] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)
    reverse_force: bool | str = "detect"
    reverse_displacement: bool | str = "detect"
    encoding: str = ""
    separator: str = ""
    decimal: str = ""
    thousands: str = ""
    skip_lines: int = 0
    sample_rate: float = 0.0
    pause: float = 0.0
    restarts: str = "refuse"
    bad_rows: str = "refuse"

    def __post_init__(self) -> None:
        """Refuse declarations that mean nothing."""
        _check_pattern(self.setting_pattern)
        _check_encoding(self.encoding)
        for name in _SIGNS:
            if getattr(self, name) not in (True, False, "detect"):
                raise ConfigurationError(
                    f"{name}: found {getattr(self, name)!r}, expected true, false or 'detect'"
                )
        self._check_channels()
        for name in ("skip_lines", "sample_rate", "pause"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ConfigurationError(f"{name}: found {getattr(self, name)}, expected 0 or more")
        for name, words in _WORDS.items():
            found = getattr(self, name)
            if found not in words:
                shown = " or ".join(repr(word) for word in words if word)
                raise ConfigurationError(
                    f"{name}: found {found!r}, expected {shown}.{did_you_mean(str(found), words)}"
                )
        if self.thousands and self.thousands in {self.decimal, self.separator}:
            raise ConfigurationError(f"thousands: {self.thousands!r} already has another meaning")

    def _check_channels(self) -> None:
        for what in ("columns", "units", "scales", "offsets"):
            known = (*CHANNELS, "setting") if what == "columns" else tuple(CHANNELS)
            for channel in getattr(self, what):
                if channel not in known:
                    raise ConfigurationError(
                        f"{what}: no channel {channel!r}; there are {', '.join(known)}."
                        f"{did_you_mean(channel, known)}"
                    )
        for channel, unit in self.units.items():
            find_unit(unit, CHANNELS[channel])
        for channel, scale in self.scales.items():
            if not (math.isfinite(scale) and scale != 0.0):
                raise ConfigurationError(f"scales: {channel} is {scale}, expected other than 0")
        for channel, offset in self.offsets.items():
            if not math.isfinite(offset):
                raise ConfigurationError(f"offsets: {channel} is {offset}, expected a number")


def _check_pattern(pattern: str) -> None:
    try:
        groups = re.compile(pattern, re.IGNORECASE).groups
    except re.error as error:
        raise ConfigurationError(
            f"setting_pattern: {pattern!r} is no regular expression: {error}"
        ) from error
    if groups < 1:
        raise ConfigurationError(
            f"setting_pattern: {pattern!r} has no group (...) around the number"
        )


def _check_encoding(encoding: str) -> None:
    try:
        "".encode(encoding or "utf-8")
    except LookupError as error:
        raise ConfigurationError(f"encoding: {encoding!r} is no text encoding") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile(Declarations):
    """Declarations for the logs of one rig.

    Attributes
    ----------
    name : str
        For notes and the command line.
    files : str
        Pattern of the names of its files, as in "ME*.txt"; empty: only when asked for by name.
    """

    name: str
    files: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions(Declarations):
    """How logs are read.

    Attributes
    ----------
    setting : int or None
        Adjuster setting, whatever the log says.
    profile : str
        Name of the profile for every log; empty: the first whose pattern fits the file name.
    profiles : tuple of Profile
        Profiles to choose from.
    max_bytes : int
        Largest log to read, in bytes (of text, when it is compressed).

    Raises
    ------
    ConfigurationError
        As for `Declarations`; or there is no such profile.
    """

    setting: int | None = None
    profile: str = ""
    profiles: tuple[Profile, ...] = ()
    max_bytes: int = 500_000_000

    def __post_init__(self) -> None:
        """Refuse options that mean nothing."""
        Declarations.__post_init__(self)
        if self.max_bytes <= 0:
            raise ConfigurationError(f"max_bytes: found {self.max_bytes}, expected more than 0")
        names = [profile.name for profile in self.profiles]
        if self.profile and self.profile not in names:
            raise ConfigurationError(
                f"no profile {self.profile!r}; there are {', '.join(names) or 'none'}."
                f"{did_you_mean(self.profile, names)}"
            )

    def for_file(self, name: str) -> tuple[ReadOptions, tuple[str, ...]]:
        """Return the options with the declarations of the file's profile, and a note.

        What a profile declares goes before what the options declare.
        """
        for profile in self.profiles:
            is_asked = profile.name == self.profile
            if is_asked or (not self.profile and profile.files and fnmatch(name, profile.files)):
                changes = {f.name: _merged(self, profile, f) for f in fields(Declarations)}
                return replace(self, **changes), (f"profile: {profile.name}",)
        return self, ()


def _merged(options: Declarations, profile: Declarations, known: Any) -> Any:
    default = {} if known.default is MISSING else known.default
    ours, theirs = getattr(options, known.name), getattr(profile, known.name)
    if isinstance(default, dict):
        return {**ours, **theirs}
    return ours if theirs == default else theirs


def make_profile(name: str, values: Mapping[str, Any]) -> Profile:
    """Return the profile that a table ``[rig.profiles.NAME]`` of a configuration describes.

    Raises
    ------
    ConfigurationError
        An unknown key, a value of another type, or one that `Declarations` refuses.

    Examples
    --------
    >>> make_profile("logger", {"files": "ME*.txt", "scales": {"force": 980.665}}).scales
    {'force': 980.665}
    """
    where = f"rig.profiles.{name}"
    known = {f.name: f for f in fields(Profile) if f.name != "name"}
    checked: dict[str, Any] = {}
    for key, value in values.items():
        if key not in known:
            raise ConfigurationError(
                f"{where}: unknown key {key!r}; there are {', '.join(known)}."
                f"{did_you_mean(key, known)}"
            )
        checked[key] = _checked(value, known[key], f"{where}.{key}")
    try:
        return Profile(name=name, **checked)
    except ConfigurationError as error:
        raise ConfigurationError(f"{where}: {error}") from error


def _checked(value: Any, known: Any, where: str) -> Any:
    """Return a TOML value as the field's type, or refuse it."""
    if known.name == "part_settings":
        if isinstance(value, list | tuple) and all(_is_int(item) for item in value):
            return tuple(value)
        raise ConfigurationError(f"{where}: found {value!r}, expected a list of whole numbers")
    if known.name in _SIGNS:
        if value == "detect" or isinstance(value, bool):
            return value
        raise ConfigurationError(f"{where}: found {value!r}, expected true or false or 'detect'")
    if known.default is MISSING:
        return _checked_table(value, known.name, where)
    if known.name in _DIMENSIONS and isinstance(value, str):
        return parse_quantity(value, _DIMENSIONS[known.name])
    if isinstance(known.default, float) and _is_int(value):
        value = float(value)
    if type(value) is not type(known.default):
        expected = {str: "text", bool: "true or false", int: "a whole number"}
        wanted = expected.get(type(known.default), "a number")
        raise ConfigurationError(f"{where}: found {value!r}, expected {wanted}")
    return value


def _checked_table(value: Any, name: str, where: str) -> dict[str, Any]:
    kinds = {"columns": (str, int), "units": (str,)}.get(name, (int, float))
    is_fine = isinstance(value, dict) and all(
        isinstance(item, kinds) and not isinstance(item, bool) for item in value.values()
    )
    if not is_fine:
        wanted = {"columns": "names or numbers", "units": "unit names"}.get(name, "numbers")
        raise ConfigurationError(f"{where}: found {value!r}, expected a table of {wanted}")
    return dict(value)


def _is_int(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
