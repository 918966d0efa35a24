"""The sections [adjusters] and [test]: what can be turned, and whose damper it is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict

from damperfit.errors import ConfigurationError
from damperfit.identity import IDENTITY_KEYS, Identity
from damperfit.setting import Setting, parse_setting
from damperfit.tables import column_names

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

__all__ = ["COUNTED", "TestOptions", "TestSection", "check_adjusters", "declared_settings"]

_MOST = 8  # adjusters of a damper; real ones have four
COUNTED = Literal["", "from open", "from closed"]


@dataclass(frozen=True, slots=True)
class TestOptions:
    """What is declared of all tests of a run.

    Attributes
    ----------
    identity : Identity
        Whose they are, where the logs and the table of tests do not say.
    table : pathlib.Path or None
        Table of tests; None: ``tests.csv`` beside the logs, where there is one.
    """

    __test__ = False  # no test of pytest's

    identity: Identity = Identity()
    table: Path | None = None


class TestSection(BaseModel):
    """Keys of [test]."""

    __test__ = False

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    damper: str
    serial: str
    customer: str
    operator: str
    date: str
    rig: str
    text: str
    table: str

    def build(self) -> TestOptions:
        """Return what is declared."""
        told: dict[str, Any] = {key: getattr(self, key).strip() for key in IDENTITY_KEYS}
        return TestOptions(Identity(**told), Path(self.table) if self.table else None)


def check_adjusters(adjusters: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names of the adjusters.

    Raises
    ------
    ConfigurationError
        A name is none, or is that of a column of the tables.
    """
    names = tuple(adjusters)
    if not 1 <= len(names) <= _MOST:
        raise ConfigurationError(f"adjusters: found {len(names)}, expected 1 to {_MOST}")
    for name in names:
        if not re.fullmatch(r"[a-z][a-z0-9_]{0,30}", name):
            raise ConfigurationError(
                f"adjusters: found '{name}', expected small letters, digits and _, as in "
                "low_speed_rebound"
            )
        if name in column_names() or name in IDENTITY_KEYS:
            raise ConfigurationError(
                f"adjusters: '{name}' is taken, a column of the tables has this name; choose "
                "another"
            )
    return names


def declared_settings(
    labels: Iterable[int | str], adjusters: tuple[str, ...], *, key: str
) -> tuple[Setting, ...]:
    """Return the settings that labels name, in order.

    Raises
    ------
    ConfigurationError
        A label names none.
    """
    found = set()
    for label in labels:
        try:
            found.add(parse_setting(str(label), adjusters))
        except ValueError as error:
            raise ConfigurationError(f"{key}: found {label!r}, {error}") from error
    return tuple(sorted(found))
