"""What a user may declare about logs: for all of them, or for those of one rig in a profile."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from fnmatch import fnmatch
from typing import Any

from damperfit.errors import ConfigurationError, blamed_on, did_you_mean
from damperfit.io.tests_table import FACTS
from damperfit.problem import Key
from damperfit.tested.identity import IDENTITY_KEYS
from damperfit.tested.setting import ADJUSTER, Setting
from damperfit.units.quantities import find_unit

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
    """How logs are to be understood where they do not speak for themselves."""

    # Its first group is the setting in a file name; the last match counts, and no case matters.
    setting_pattern: str = SETTING_PATTERN
    # Settings of the tests in one file, in their order, by number or label.
    part_settings: tuple[int | float | str, ...] = ()
    # Column of a channel, by name or by number from 1; empty text: found by its name.
    columns: Mapping[str, str | int] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)  # of a channel, whatever the log says
    # value = scale * logged + offset, in the channel's unit, as for volts.
    scales: Mapping[str, float] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)
    # Whether the log counts the channel positive in bump; "detect": not declared.
    reverse_force: bool | str = "detect"
    reverse_displacement: bool | str = "detect"
    encoding: str = ""  # of text, as in "cp1252"; empty: UTF-8, UTF-16 with a mark, else Latin-1
    separator: str = ""  # of fields: "," ";" "|" "tab" or "blanks"; empty: found from the rows
    decimal: str = ""  # "." or ","; empty: found from the rows
    thousands: str = ""  # between groups of three digits; empty: none, and "1,234" is refused
    skip_lines: int = 0  # of text above the log, that are not looked at
    sample_rate: float = 0.0  # Hz; time is the number of the sample divided by it. 0: in the log
    pause: float = 0.0  # s; a longer step begins another test. 0: 2 s and 50 times the usual
    restarts: str = "refuse"  # where time runs backwards; "split" into tests, keep the "last"
    bad_rows: str = "refuse"  # with text or blanks in a channel, or too few or many fields; "drop"
    allow_truncated: bool = False  # of a cut TDMS log, keep the values that all channels have
    # What the log was tested at, whatever it says itself: names of `FACTS`, SI, degrees Celsius.
    tested_at: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse declarations that mean nothing."""
        try:
            groups = re.compile(self.setting_pattern, re.IGNORECASE).groups
        except re.error as error:
            text = f"{self.setting_pattern!r} is not a regular expression: {error}"
            raise _wrong("setting_pattern", text) from error
        if groups < 1:
            text = f"{self.setting_pattern!r} has no group (...) around the number"
            raise _wrong("setting_pattern", text)
        try:
            "".encode(self.encoding or "utf-8")
        except LookupError as error:
            raise _wrong("encoding", f"{self.encoding!r} is not a text encoding") from error
        for name in ("reverse_force", "reverse_displacement"):
            if (value := getattr(self, name)) not in (True, False, "detect"):
                raise _wrong(name, f"found {value!r}, expected true, false or 'detect'")
        for name in ("columns", "units", "scales", "offsets", "tested_at"):
            known = tuple(FACTS) if name == "tested_at" else tuple(CHANNELS)
            known += ("setting",) if name == "columns" else ()
            what = "" if name == "tested_at" else "channel "
            for key in getattr(self, name):
                if key not in known:
                    hint = did_you_mean(key, known)
                    raise _wrong(name, f"no {what}{key!r}; there are {', '.join(known)}.{hint}")
        self._check_values()

    def _check_values(self) -> None:
        for channel, unit in self.units.items():
            if unit:
                with blamed_on(Key(("rig", "units"))):
                    find_unit(unit, CHANNELS[channel])
        for channel, scale in self.scales.items():
            if not math.isfinite(scale) or scale == 0.0:
                raise _wrong("scales", f"{channel} is {scale}, expected other than 0")
        for channel, offset in self.offsets.items():
            if not math.isfinite(offset):
                raise _wrong("offsets", f"{channel} is {offset}, expected a number")
        for name in ("skip_lines", "sample_rate", "pause"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise _wrong(name, f"found {getattr(self, name)}, expected 0 or more")
        for name, words in _WORDS.items():
            if (word := getattr(self, name)) not in words:
                shown = " or ".join(repr(one) for one in words if one)
                hint = did_you_mean(str(word), words)
                raise _wrong(name, f"found {word!r}, expected {shown}.{hint}")
        if self.thousands and self.thousands in {self.decimal, self.separator}:
            raise _wrong("thousands", f"{self.thousands!r} already has another meaning")


def _wrong(key: str, text: str) -> ConfigurationError:
    return ConfigurationError(text, where=Key((key,)), code="wrong-value")


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """Declarations for the logs of one rig, named, or found by the pattern of its files' names.

    `declared` has the attributes of `Declarations` that it gives, also where it gives the default.
    """

    name: str
    files: str = ""  # as in "ME*.txt"; empty: only when asked for by name
    declared: Mapping[str, Any] = field(default_factory=dict)

    def put_over(self, general: Declarations) -> dict[str, Any]:
        """Return all declarations: this profile's, then the general ones; tables by channel."""
        merged = {known.name: getattr(general, known.name) for known in fields(Declarations)}
        for name, value in self.declared.items():
            is_table = isinstance(merged.get(name), dict)
            merged[name] = {**merged[name], **value} if is_table else value
        try:
            Declarations(**merged)
        except ConfigurationError as error:
            text = f"rig.profiles.{self.name}: {error}"
            raise ConfigurationError(text, code="wrong-value") from error
        return merged


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions(Declarations):
    """How logs are read."""

    setting: Setting | None = None  # whatever the log says
    adjusters: tuple[str, ...] = (ADJUSTER,)  # names, in the order of labels
    profile: str = ""  # for every log; empty: the first whose pattern fits the file name
    profiles: tuple[Profile, ...] = ()
    needs_force: bool = True  # False: of a car log time and displacement alone
    max_bytes: int = 500_000_000  # of the largest log (of text, when it is compressed)

    def __post_init__(self) -> None:
        """Refuse options that mean nothing."""
        Declarations.__post_init__(self)
        if self.max_bytes <= 0:
            raise _wrong("max_log_bytes", f"found {self.max_bytes}, expected more than 0")
        known = (*self.adjusters, *IDENTITY_KEYS)
        for name in re.compile(self.setting_pattern).groupindex:
            if name not in known:
                raise _wrong(
                    "setting_pattern",
                    f"{self.setting_pattern!r} has a group {name!r}; there are "
                    f"{', '.join(known)}, and adjusters that [adjusters] names."
                    f"{did_you_mean(name, known)}",
                )
        names = [profile.name for profile in self.profiles]
        if self.profile and self.profile not in names:
            raise ConfigurationError(
                f"no profile {self.profile!r}; there are {', '.join(names) or 'none'}."
                f"{did_you_mean(self.profile, names)}",
                where=Key(("rig", "profile")),
                code="unknown-profile",
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
                # No other profile is put over this one.
                options = replace(self, **profile.put_over(self), profile="", profiles=())
                return options, (f"profile: {profile.name}",)
        return self, ()
