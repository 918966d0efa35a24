"""What a configuration asks of the judgement; checked without loading what judges."""

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key


@dataclass(frozen=True, slots=True)
class HoldOutOptions:
    """What is kept from the fit and predicted instead."""

    patterns: tuple[str, ...] = ()  # which logs, by name or path
    cycles: float = 0.0  # of the last steady cycles of every log; below 1 a share of them


def check_profile_names(
    names: Iterable[str], known: Sequence[str], *, fixed: Container[str] = ()
) -> None:
    """Refuse, by a ConfigurationError, names of no known parameter, or of one that is held."""
    for name in names:
        if name not in known:
            there, hint = ", ".join(known), did_you_mean(name, known)
            text = f"no parameter {name!r} to profile; there are {there}.{hint}"
            where = Key(("identification", "profile"))
            raise ConfigurationError(text, where=where, code="unknown-quantity")
        if name in fixed:
            where = Key(("identification", "profile"), ("fix",))
            text = f"{name} is both fixed and to be profiled; choose one."
            raise ConfigurationError(text, where=where, code="not-together")
