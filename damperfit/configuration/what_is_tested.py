"""The sections [adjusters] and [test]: what can be turned, and whose damper it is."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import BaseModel, BeforeValidator, ConfigDict

from damperfit.damper.model import MODELS
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.io.tests_table import FACTS, fact_of
from damperfit.problem import Key
from damperfit.tables.columns import column_names
from damperfit.tested.identity import IDENTITY_KEYS, Identity
from damperfit.tested.setting import Setting, parse_setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from damperfit.damper.model import Model

__all__ = [
    "AdjusterKey",
    "TestOptions",
    "TestSection",
    "check_adjusters",
    "counted",
    "counted_from_closed",
    "declared_settings",
    "facts_stated",
    "followed",
    "unmatched",
]

_MOST = 8  # adjusters of a damper; real ones have four
_FROM = ("from open", "from closed")


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


@dataclass(frozen=True, slots=True)
class TestOptions:
    """What is declared of all tests of a run.

    Attributes
    ----------
    identity : Identity
        Whose they are, where the logs and the table of tests do not say.
    table : pathlib.Path or None
        Table of tests; None: ``tests.csv`` beside the logs, where there is one.
    typed : frozenset of str
        Facts of tests that the command line tells, or sets aside: no table goes before it.
    """

    __test__ = False  # no test of pytest's

    identity: Identity = Identity()
    table: Path | None = None
    typed: frozenset[str] = frozenset()


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
        stated: dict[str, Any] = {key: getattr(self, key).strip() for key in IDENTITY_KEYS}
        return TestOptions(Identity(**stated), Path(self.table) if self.table else None)


def check_adjusters(adjusters: Mapping[str, AdjusterKey]) -> tuple[str, ...]:
    """Return the names of the adjusters.

    Raises
    ------
    ConfigurationError
        A name is none, or is that of a column of the tables.
    """
    names = tuple(adjusters)
    if not 1 <= len(names) <= _MOST:
        raise ConfigurationError(
            f"found {len(names)}, expected 1 to {_MOST}", where=Key(("adjusters",))
        )
    for name in names:
        if not re.fullmatch(r"[a-z][a-z0-9_]{0,30}", name):
            raise ConfigurationError(
                f"found '{name}', expected small letters, digits and _, as in low_speed_rebound",
                where=Key(("adjusters",)),
            )
        if name in column_names() or name in IDENTITY_KEYS:
            raise ConfigurationError(
                f"'{name}' is taken, a column of the tables has this name; choose another",
                where=Key(("adjusters",)),
            )
    return names


def counted(adjusters: Mapping[str, AdjusterKey]) -> dict[str, str]:
    """Return how the clicks of each adjuster count, where that is declared.

    Examples
    --------
    >>> counted({"low": ["rebound.bleed", "from closed"], "high": "from open", "ride": ""})
    {'low': 'from closed', 'high': 'from open', 'ride': ''}
    """
    return {
        name: said if isinstance(said, str) else next((one for one in said if one in _FROM), "")
        for name, said in adjusters.items()
    }


def followed(
    adjusters: Mapping[str, AdjusterKey], damper: Model, *, is_law_open: bool = False
) -> dict[str, tuple[str, ...]]:
    """Return the quantities of a model that are declared to follow adjusters.

    Parameters
    ----------
    adjusters : mapping
        Section [adjusters].
    damper : Model
        The model.
    is_law_open : bool
        Nobody has declared the model: what another one has is no mistake, but follows nothing.

    Raises
    ------
    ConfigurationError
        A word names nothing that a model has.
    """
    found: dict[str, list[str]] = {}
    for adjuster, word in _words(adjusters):
        names = _named(damper).get(word, ())
        if not names and not (is_law_open and any(word in _named(one) for one in _every_model())):
            known = _named(damper)
            if is_law_open:
                known = {k: v for one in _every_model() for k, v in _named(one).items()}
            near = did_you_mean(word, known) or f" There are {', '.join(known)}."
            raise ConfigurationError(
                f"no quantity '{word}' of the model {damper.name} could follow it.{near}",
                where=Key(("adjusters", adjuster)),
            )
        for name in names:
            found.setdefault(name, [])
            if adjuster not in found[name]:
                found[name].append(adjuster)
    return {name: tuple(who) for name, who in found.items()}


def unmatched(adjusters: Mapping[str, AdjusterKey], damper: Model) -> tuple[str, ...]:
    """Return the words in [adjusters] that name nothing of a model."""
    return tuple(word for _, word in _words(adjusters) if word not in _named(damper))


def _words(adjusters: Mapping[str, AdjusterKey]) -> list[tuple[str, str]]:
    return [
        (adjuster, word.strip())
        for adjuster, said in adjusters.items()
        for word in (said if isinstance(said, list) else ())
        if word not in _FROM
    ]


def _named(damper: Model) -> dict[str, tuple[str, ...]]:
    return {**damper.parts, **{name: (name,) for name in damper.names}}


def _every_model() -> list[Model]:
    """One damper of every model, with everything that it may have."""
    from damperfit.damper.network import Valve
    from damperfit.damper.valve_dampers import DeclaredNetwork, ValveDamper

    kinds = (("long", "port"), ("long", "rounded"), ("long", "lifting"))
    valves = [Valve(bleed, blow_off) for bleed, blow_off in kinds]
    return [
        kind(rebound=valve, compression=valve)
        if issubclass(kind, ValveDamper) and kind is not DeclaredNetwork
        else kind()
        for kind in MODELS.values()
        for valve in valves
    ]


def counted_from_closed(keys: Mapping[str, AdjusterKey]) -> tuple[str, ...]:
    """Return the adjusters whose clicks count from closed."""
    return tuple(name for name, how in counted(keys).items() if how == "from closed")


def facts_stated(stated: Mapping[str, float | str]) -> dict[str, float]:
    """Return what logs were tested at, SI; a name that is none is left to the reader's options.

    Raises
    ------
    ConfigurationError
        A value is no such quantity.
    """
    found = {}
    for name, text in stated.items():
        try:
            found[name] = fact_of(name, str(text)) if name in FACTS else math.nan
        except ValueError as error:
            raise ConfigurationError(
                f"found {text!r}, {error}", where=Key(("tested_at", name))
            ) from error
    return found


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
            raise ConfigurationError(
                f"found {label!r}, {error}", where=Key(tuple(key.split(".")))
            ) from error
    return tuple(sorted(found))
