"""What a user may declare about logs: for all of them, or for those of one rig in a profile."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, fields, replace
from fnmatch import fnmatch
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError, blamed_on, did_you_mean
from damperfit.io.tests_table import FACTS
from damperfit.problem import Key
from damperfit.tested.identity import IDENTITY_KEYS
from damperfit.tested.setting import ADJUSTER
from damperfit.units.quantities import find_unit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.tested.setting import Setting

__all__ = [
    "CHANNELS",
    "EXTRAS",
    "SEPARATORS",
    "SETTING_PATTERN",
    "Declarations",
    "Profile",
    "ReadOptions",
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
# 30s_2), with three digits at most, for more are a serial number; and 10.5 is no setting.
SETTING_PATTERN = (
    r"(?:setting(?:[ _](?=-\d)|[ _=-]?)|(?<![^\W_])s[ _=-]?(?=\d{1,3}(?!\d)))(-?\d+)(?![.]?\d)"
)

_SIGNS = ("reverse_force", "reverse_displacement")
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
    part_settings : tuple of int, float or str
        Settings of the tests in one file, in their order, by number or label; empty when the log
        says them.
    columns : mapping of str to str or int
        Column of a channel, by name or by number from 1, as in {"force": "Load cell"}; empty text:
        found by its name.
    units : mapping of str to str
        Unit of a channel, whatever the log says, as in {"displacement": "mm"}; empty text: what
        the log says.
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
        Hz; time is the number of the sample divided by it. 0: the log has the time.
    pause : float
        A step in time longer than this begins another test, s. 0: 2 s and 50 times the usual.
    restarts : str
        When time runs backwards: "refuse" the log, "split" it into tests, or keep the "last".
    bad_rows : str
        Rows with text or blanks in a channel, or too few or many fields: "refuse" or "drop".
    allow_truncated : bool
        Of a TDMS log whose end is missing, keep the values that all channels have.
    tested_at : mapping of str to float
        What the log was tested at, whatever it says itself: names of `FACTS`, SI, temperature in
        degrees Celsius.

    Raises
    ------
    ConfigurationError
        An unknown channel, unit or word, or a pattern that is no regular expression with a group.
    """

    setting_pattern: str = SETTING_PATTERN
    part_settings: tuple[int | float | str, ...] = ()
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
    allow_truncated: bool = False
    tested_at: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse declarations that mean nothing."""
        _check_pattern(self.setting_pattern)
        _check_encoding(self.encoding)
        for name in _SIGNS:
            if getattr(self, name) not in (True, False, "detect"):
                raise ConfigurationError(
                    f"found {getattr(self, name)!r}, expected true, false or 'detect'",
                    where=Key((name,)),
                )
        self._check_channels()
        for name in ("skip_lines", "sample_rate", "pause"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ConfigurationError(
                    f"found {getattr(self, name)}, expected 0 or more", where=Key((name,))
                )
        for name, words in _WORDS.items():
            found = getattr(self, name)
            if found not in words:
                shown = " or ".join(repr(word) for word in words if word)
                raise ConfigurationError(
                    f"found {found!r}, expected {shown}.{did_you_mean(str(found), words)}",
                    where=Key((name,)),
                )
        if self.thousands and self.thousands in {self.decimal, self.separator}:
            raise ConfigurationError(
                f"{self.thousands!r} already has another meaning", where=Key(("thousands",))
            )

    def _check_channels(self) -> None:
        for what in ("columns", "units", "scales", "offsets"):
            known = (*CHANNELS, "setting") if what == "columns" else tuple(CHANNELS)
            for channel in getattr(self, what):
                if channel not in known:
                    raise ConfigurationError(
                        f"no channel {channel!r}; there are {', '.join(known)}."
                        f"{did_you_mean(channel, known)}",
                        where=Key((what,)),
                    )
        for fact in self.tested_at:
            if fact not in FACTS:
                raise ConfigurationError(
                    f"no {fact!r}; there are {', '.join(FACTS)}.{did_you_mean(fact, FACTS)}",
                    where=Key(("tested_at",)),
                )
        for channel, unit in self.units.items():
            if unit:
                with blamed_on(Key(("rig", "units"))):
                    find_unit(unit, CHANNELS[channel])
        for channel, scale in self.scales.items():
            if not (math.isfinite(scale) and scale != 0.0):
                raise ConfigurationError(
                    f"{channel} is {scale}, expected other than 0", where=Key(("scales",))
                )
        for channel, offset in self.offsets.items():
            if not math.isfinite(offset):
                raise ConfigurationError(
                    f"{channel} is {offset}, expected a number", where=Key(("offsets",))
                )


def _check_pattern(pattern: str) -> None:
    try:
        groups = re.compile(pattern, re.IGNORECASE).groups
    except re.error as error:
        raise ConfigurationError(
            f"{pattern!r} is not a regular expression: {error}", where=Key(("setting_pattern",))
        ) from error
    if groups < 1:
        raise ConfigurationError(
            f"{pattern!r} has no group (...) around the number", where=Key(("setting_pattern",))
        )


def _check_groups(pattern: str, adjusters: tuple[str, ...]) -> None:
    known = (*adjusters, *IDENTITY_KEYS)
    for name in re.compile(pattern).groupindex:
        if name not in known:
            raise ConfigurationError(
                f"{pattern!r} has a group {name!r}; there are "
                f"{', '.join(known)}, and adjusters that [adjusters] names."
                f"{did_you_mean(name, known)}",
                where=Key(("setting_pattern",)),
            )


def _check_encoding(encoding: str) -> None:
    try:
        "".encode(encoding or "utf-8")
    except LookupError as error:
        raise ConfigurationError(
            f"{encoding!r} is not a text encoding", where=Key(("encoding",))
        ) from error


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """Declarations for the logs of one rig.

    Attributes
    ----------
    name : str
        For notes and the command line.
    files : str
        Pattern of the names of its files, as in "ME*.txt"; empty: only when asked for by name.
    declared : mapping of str to object
        Attributes of `Declarations` that the profile gives, also where it gives the default.

    Raises
    ------
    ConfigurationError
        As for `Declarations`.
    """

    name: str
    files: str = ""
    declared: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse declarations that mean nothing."""
        self.put_over(Declarations())

    def put_over(self, general: Declarations) -> dict[str, Any]:
        """Return all declarations: this profile's, then the general ones; tables by channel."""
        merged = {known.name: getattr(general, known.name) for known in fields(Declarations)}
        for name, value in self.declared.items():
            is_table = isinstance(merged.get(name), dict)
            merged[name] = {**merged[name], **value} if is_table else value
        try:
            Declarations(**merged)
        except ConfigurationError as error:
            raise ConfigurationError(f"rig.profiles.{self.name}: {error}") from error
        return merged


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions(Declarations):
    """How logs are read.

    Attributes
    ----------
    setting : Setting or None
        Adjuster setting, whatever the log says.
    adjusters : tuple of str
        Names of the damper's adjusters, in the order of labels.
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

    setting: Setting | None = None
    adjusters: tuple[str, ...] = (ADJUSTER,)
    profile: str = ""
    profiles: tuple[Profile, ...] = ()
    max_bytes: int = 500_000_000

    def __post_init__(self) -> None:
        """Refuse options that mean nothing."""
        Declarations.__post_init__(self)
        if self.max_bytes <= 0:
            raise ConfigurationError(
                f"found {self.max_bytes}, expected more than 0", where=Key(("max_log_bytes",))
            )
        _check_groups(self.setting_pattern, self.adjusters)
        names = [profile.name for profile in self.profiles]
        if self.profile and self.profile not in names:
            raise ConfigurationError(
                f"no profile {self.profile!r}; there are {', '.join(names) or 'none'}."
                f"{did_you_mean(self.profile, names)}",
                where=Key(("rig", "profile")),
            )
        for profile in self.profiles:
            profile.put_over(self)

    def for_file(self, name: str) -> tuple[ReadOptions, tuple[str, ...]]:
        """Return the options with the declarations of the file's profile, and a note.

        What a profile gives goes before what the options declare, the default too.
        """
        for profile in self.profiles:
            is_asked = profile.name == self.profile
            if is_asked or (not self.profile and profile.files and fnmatch(name, profile.files)):
                merged = profile.put_over(self)
                # No other profile is put over this one.
                options = replace(self, **merged, profile="", profiles=())
                return options, (f"profile: {profile.name}",)
        return self, ()
