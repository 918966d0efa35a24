"""The adjuster setting as a log says it: clicks, or a word."""

from __future__ import annotations

import re

from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.setting import Setting, parse_place

__all__ = ["file_setting", "told_setting"]


def told_setting(text: str, where: str) -> Setting:
    """Return the setting that a text says.

    Raises
    ------
    LogError
        It says none.

    Examples
    --------
    >>> told_setting("10", "log.csv").cell, told_setting("soft", "log.csv").cell
    (10, 'soft')
    """
    try:
        return Setting.of(parse_place(text))
    except ValueError as error:
        raise LogError(f"{where}: setting {visible(text)}; {error}") from error


def file_setting(name: str, pattern: str) -> tuple[Setting | None, tuple[str, ...]]:
    """Return the setting in a file name, if there is one, and a note.

    Raises
    ------
    LogError
        What the pattern finds is no setting.
    """
    found = list(re.finditer(pattern, name, re.IGNORECASE))
    if not found or found[-1][1] is None:
        return None, ()
    return told_setting(found[-1][1], f"{name}: file name"), ("setting: from the file name",)
