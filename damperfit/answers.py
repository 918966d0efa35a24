"""What functions return that write files: paths, and the text of a configuration."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

if TYPE_CHECKING:
    from damperfit.exporting.check import SettingCheck
    from damperfit.exporting.targets import Export
    from damperfit.problem import Problem


class Files(tuple[Path, ...]):  # noqa: SLOT001 - it has attributes
    """The paths that were written, and what to know of them.

    `remarks` say what was missing or damaged in the results, `notes` what was assumed or left out;
    `made` is what was exported, `checked` how it was held against the logs.
    """

    remarks: tuple[Problem, ...]
    notes: tuple[Problem, ...]
    made: Export | None
    checked: tuple[SettingCheck, ...]

    def __new__(  # noqa: D102 - a tuple
        cls,
        paths: Iterable[Path],
        *,
        remarks: Iterable[Problem] = (),
        notes: Iterable[Problem] = (),
        made: Export | None = None,
        checked: tuple[SettingCheck, ...] = (),
    ) -> Self:
        self = super().__new__(cls, paths)
        self.remarks, self.notes = tuple(remarks), tuple(notes)
        self.made, self.checked = made, checked
        return self


class FirstConfiguration(NamedTuple):
    """A commented configuration: TOML, what the logs showed, and what is left to measure."""

    text: str
    why: tuple[str, ...]
    open: tuple[str, ...]
