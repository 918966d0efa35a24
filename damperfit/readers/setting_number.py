"""The adjuster setting as a log says it: a whole number, a label."""

from __future__ import annotations

import re

from damperfit.errors import LogError
from damperfit.readers.channels import visible

__all__ = ["file_setting", "whole_setting"]

_MAX_SETTING = 1_000_000  # a label; anything longer is a date or a serial number


def whole_setting(text: str, where: str) -> int:
    """Return the setting that a text says.

    Raises
    ------
    LogError
        It is no whole number.

    Examples
    --------
    >>> whole_setting("10", "log.csv")
    10
    """
    found = re.fullmatch(r"\s*(\d{1,9})(?:\.0*)?\s*", text, re.ASCII)
    if found is None or int(found[1]) > _MAX_SETTING:
        raise LogError(
            f"{where}: setting {visible(text)}; expected a whole number from 0 to {_MAX_SETTING}"
        )
    return int(found[1])


def file_setting(name: str, pattern: str) -> tuple[int | None, tuple[str, ...]]:
    """Return the setting in a file name, if there is one, and a note.

    Raises
    ------
    LogError
        What the pattern finds is no whole number.
    """
    found = list(re.finditer(pattern, name, re.IGNORECASE))
    if not found or found[-1][1] is None:
        return None, ()
    return whole_setting(found[-1][1], f"{name}: file name"), ("setting: from the file name",)
