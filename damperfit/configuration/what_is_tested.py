"""The section [adjusters], labels of settings, and what logs are declared to be tested at."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Annotated, TypeAlias

from pydantic import BeforeValidator

from damperfit.damper.model import MODELS
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.io.tests_table import FACTS, fact_of
from damperfit.problem import Key
from damperfit.tables.columns import column_names
from damperfit.tested.identity import IDENTITY_KEYS
from damperfit.tested.setting import Setting, parse_setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from damperfit.damper.model import Model


_MOST = 8  # adjusters of a damper; real ones have four
_CLOSED = "from closed"
_FROM = ("from open", _CLOSED)


def _adjuster(value: object) -> object:
    is_list = isinstance(value, list) and all(isinstance(one, str) for one in value)
    if is_list or value in ("", *_FROM):
        return value
    raise ValueError(
        "expected '', 'from open', 'from closed', or a list of what follows it, as in "
        "['rebound.bleed']"
    )


# How its clicks count, or a list of the quantities that follow it, with that among them.
AdjusterKey: TypeAlias = Annotated[str | list[str], BeforeValidator(_adjuster)]


def check_adjusters(adjusters: Mapping[str, AdjusterKey]) -> tuple[str, ...]:
    """Return the names of the adjusters; refuse what is no name, or that of a column."""
    wrong = ""
    if not 1 <= len(adjusters) <= _MOST:
        wrong = f"found {len(adjusters)}, expected 1 to {_MOST}"
    for name in adjusters if not wrong else ():
        if not re.fullmatch(r"[a-z][a-z0-9_]{0,30}", name):
            wrong = f"found '{name}', expected small letters, digits and _, as in low_speed_rebound"
        elif name in column_names() or name in IDENTITY_KEYS:
            wrong = f"'{name}' is taken, a column of the tables has this name; choose another"
        if wrong:
            break
    if wrong:
        raise ConfigurationError(wrong, where=Key(("adjusters",)), code="wrong-adjuster")
    return tuple(adjusters)


def followed(
    adjusters: Mapping[str, AdjusterKey], damper: Model, *, is_law_open: bool = False
) -> dict[str, tuple[str, ...]]:
    """Return the quantities of a model that are declared to follow adjusters."""
    own, words = _parts(damper), _words(adjusters)
    known = own
    if is_law_open and any(word not in own for _, word in words):
        known = {word: names for one in _every_model() for word, names in _parts(one).items()}
    by_quantity: dict[str, dict[str, None]] = {}
    for adjuster, word in words:
        if not known.get(word):
            near = did_you_mean(word, known) or f" There are {', '.join(known)}."
            raise ConfigurationError(
                f"no quantity '{word}' of the model {damper.name} could follow it.{near}",
                where=Key(("adjusters", adjuster)),
                code="unknown-quantity",
            )
        for name in own.get(word, ()):
            by_quantity.setdefault(name, {})[adjuster] = None
    return {name: tuple(who) for name, who in by_quantity.items()}


def unmatched(adjusters: Mapping[str, AdjusterKey], damper: Model) -> tuple[str, ...]:
    """Return the words in [adjusters] that name nothing of a model."""
    own = _parts(damper)
    return tuple(word for _, word in _words(adjusters) if word not in own)


def counted_from_closed(adjusters: Mapping[str, AdjusterKey]) -> tuple[str, ...]:
    """Return the adjusters whose clicks count from closed.

    >>> counted_from_closed({"low": ["rebound.bleed", "from closed"], "high": "from open"})
    ('low',)
    """
    how = {name: [key] if isinstance(key, str) else key for name, key in adjusters.items()}
    return tuple(
        n for n, key in how.items() if [one for one in key if one in _FROM][:1] == [_CLOSED]
    )


def _words(adjusters: Mapping[str, AdjusterKey]) -> list[tuple[str, str]]:
    return [
        (adjuster, word.strip())
        for adjuster, key in adjusters.items()
        if isinstance(key, list)
        for word in key
        if word not in _FROM
    ]


def _parts(damper: Model) -> dict[str, tuple[str, ...]]:
    return {**damper.parts, **{name: (name,) for name in damper.names}}


def _every_model() -> list[Model]:
    """One damper of every model, with everything that it may have."""
    from damperfit.damper.network import BLOW_OFFS, Valve
    from damperfit.damper.valve_dampers import DeclaredNetwork, ValveDamper

    valves = [Valve("long", kind) for kind in BLOW_OFFS if kind not in {"none", "linear"}]
    return [
        kind(rebound=valve, compression=valve)
        if issubclass(kind, ValveDamper) and kind is not DeclaredNetwork
        else kind()
        for kind in MODELS.values()
        for valve in valves
    ]


def facts_stated(stated: Mapping[str, float | str]) -> dict[str, float]:
    """Return what logs were tested at, SI; a name that is none is left to the reader's options."""
    known = {}
    for name, text in stated.items():
        try:
            known[name] = fact_of(name, str(text)) if name in FACTS else math.nan
        except ValueError as error:
            raise _wrong(text, error, "tested_at", name) from error
    return known


def declared_settings(
    labels: Iterable[int | str], adjusters: tuple[str, ...], *, key: str
) -> tuple[Setting, ...]:
    """Return the settings that labels name, in order."""
    known = set()
    for label in labels:
        try:
            known.add(parse_setting(str(label), adjusters))
        except ValueError as error:
            raise _wrong(label, error, *key.split(".")) from error
    return tuple(sorted(known))


def _wrong(value: object, error: ValueError, *key: str) -> ConfigurationError:
    return ConfigurationError(f"found {value!r}, {error}", where=Key(key), code="wrong-value")
