"""Which option gave a file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.problem import Option

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

__all__ = ["giver_of"]


def giver_of(
    place: str, argv: Sequence[str], options: Collection[str], *, has_folders: bool = False
) -> Option | None:
    """Return the option that was typed with a file or folder, or with one that it is in.

    Its value is what was typed for the place itself, or, where it has folders, for what would be
    written in it; it is empty where the place is inside of what was typed.

    Examples
    --------
    >>> giver_of("b/x.csv", ["identify", "--out=b"], {"--out"})
    Option(name='out', value='', key='')
    >>> giver_of("./b", ["identify", "--out=b"], {"--out"}).value
    'b'
    """
    for option, value in _typed(argv):
        if option not in options or not value:
            continue
        itself = {os.path.normpath(value), _real(value)}
        if has_folders:
            itself.add(os.path.dirname(value))  # noqa: PTH120 - as it was typed
        name = option[2:].replace("-", "_")
        if not itself.isdisjoint({place, os.path.normpath(place)}):
            return Option(name, value)
        if not itself.isdisjoint(map(str, Path(place).parents)):
            return Option(name)
    return None


def _real(path: str) -> str:
    try:
        return os.path.realpath(path)
    except (OSError, ValueError):  # the working folder is gone
        return path


def _typed(argv: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield each option with what follows it, --name value or --name=value."""
    for word, after in zip(argv, (*argv[1:], ""), strict=True):
        if word.startswith("--"):
            option, equals, value = word.partition("=")
            yield option, value if equals else after
