"""What a configuration asks of the judgement; checked without loading what judges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Sequence

__all__ = ["HoldOutOptions", "check_profile_names"]


@dataclass(frozen=True, slots=True)
class HoldOutOptions:
    """What is kept from the fit and predicted instead.

    Attributes
    ----------
    patterns : tuple of str
        Which logs, by name or path.
    cycles : float
        How many of the last steady cycles of every fitted log; below 1 a share of them.
    """

    patterns: tuple[str, ...] = ()
    cycles: float = 0.0


def check_profile_names(
    names: Iterable[str], known: Sequence[str], *, fixed: Container[str] = ()
) -> None:
    """Refuse names that are none of the known parameters, or that are held.

    Raises
    ------
    ConfigurationError
        A name is not known, or is among the fixed.
    """
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known)
            there = ", ".join(known)
            raise ConfigurationError(
                f"no parameter {name!r} to profile; there are {there}.{hint}",
                where=Key(("identification", "profile")),
                code="unknown-quantity",
            )
        if name in fixed:
            raise ConfigurationError(
                f"{name} is both fixed and to be profiled; choose one.",
                where=Key(("identification", "profile"), ("fix",)),
                code="not-together",
            )
