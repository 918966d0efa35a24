"""What a user may declare about logs: for all of them, or for those of one rig in a profile."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from fnmatch import fnmatch
from typing import Any

from damperfit.errors import ConfigurationError, blamed_on, did_you_mean
from damperfit.io.tests_table import FACTS
from damperfit.problem import Key
from damperfit.sections import Declarations, RigSection
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
_MAX_BYTES = RigSection.entries()["max_log_bytes"]


class ReadOptions(Declarations):
    """How logs are read."""

    setting: Setting | None = None  # whatever the log says
    adjusters: tuple[str, ...] = (ADJUSTER,)  # names, in the order of labels
    profile: str = ""  # for every log; empty: the first whose pattern fits the file name
    # Declarations for the logs of one rig, by its name; "files" is a pattern of their names.
    profiles: Mapping[str, Mapping[str, Any]] = {}
    needs_force: bool = True  # False: of a car log time and displacement alone
    max_bytes: int = 500_000_000  # of the largest log (of text, when it is compressed)

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.refuse_wrong(max_bytes=_MAX_BYTES)
        self._check()

    def _check(self) -> None:
        """Refuse declarations that mean nothing, where a value alone does not show it."""
        try:
            pattern = re.compile(self.setting_pattern, re.IGNORECASE)
        except re.error as error:
            text = f"{self.setting_pattern!r} is not a regular expression: {error}"
            raise _wrong("setting_pattern", text) from error
        if pattern.groups < 1:
            text = f"{self.setting_pattern!r} has no group (...) around the number"
            raise _wrong("setting_pattern", text)
        groups = (*self.adjusters, *IDENTITY_KEYS)
        for name in pattern.groupindex:
            if name not in groups:
                text = f"{self.setting_pattern!r} has a group {name!r}, and the adjusters are "
                text += f"{', '.join(self.adjusters)}: give it the name of one, or name it in "
                text += f"[adjusters]; other groups are {', '.join(IDENTITY_KEYS)}."
                raise _wrong("setting_pattern", text + did_you_mean(name, groups))
        try:
            "".encode(self.encoding or "utf-8")
        except LookupError as error:
            raise _wrong("encoding", f"{self.encoding!r} is not a text encoding") from error
        self._check_channels()
        if self.thousands and self.thousands in {self.decimal, self.separator}:
            raise _wrong("thousands", f"{self.thousands!r} already has another meaning")
        if self.profile and self.profile not in self.profiles:
            text = f"no profile {self.profile!r}; there are {', '.join(self.profiles) or 'none'}."
            text += did_you_mean(self.profile, self.profiles)
            where = Key(("rig", "profile"))
            raise ConfigurationError(text, where=where, code="unknown-profile")
        for name, profile in self.profiles.items():
            try:
                self._with(profile)
            except ConfigurationError as error:
                key: Any = error.problem.where
                raise error.at(Key(("rig", "profiles", name, key.path[-1]))) from error

    def _check_channels(self) -> None:
        for name in ("columns", "units", "scales", "offsets", "tested_at"):
            is_fact = name == "tested_at"
            names = (*(FACTS if is_fact else CHANNELS), *["setting"] * (name == "columns"))
            for key in getattr(self, name):
                if key not in names:
                    text = f"no {'' if is_fact else 'channel '}{key!r}; there are "
                    hint = did_you_mean(key, names)
                    raise _wrong(name, f"{text}{', '.join(names)}.{hint}")
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

    def for_file(self, name: str) -> tuple[ReadOptions, tuple[str, ...]]:
        """Return the options with the declarations of the file's profile, and a note.

        A profile overrides the options and their defaults.
        """
        for title, profile in self.profiles.items():
            files = "" if self.profile else profile.get("files", "")
            if title == self.profile or (files and fnmatch(name, files)):
                return self._with(profile), (f"profile: {title}",)
        return self, ()

    def _with(self, profile: Mapping[str, Any]) -> ReadOptions:
        """Return the options with a profile's declarations, tables by channel, and no profile."""
        declared = {
            key: {**getattr(self, key), **value} if isinstance(value, dict) else value
            for key, value in profile.items()
            if key != "files"
        }
        return self.but(**declared, profile="", profiles={})


def _wrong(key: str, text: str) -> ConfigurationError:
    return ConfigurationError(text, where=Key((key,)), code="wrong-value")
