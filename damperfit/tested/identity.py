"""Whose test it is: damper, serial number, customer, operator, date, rig and whatever was said."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any

# What a preamble or a table may call it, in lower case and without what is no letter.
_WORDS = {
    "damper": (
        "damper", "shock", "shockabsorber", "daempfer", "dämpfer", "article", "part", "prüfling",
        "pruefling", "specimen", "amortisseur",
    ),
    "serial": (
        "serial", "serialnumber", "serialno", "serialnr", "sn", "damperserial", "seriennummer",
        "seriennr", "damperid", "ndesérie", "nodesérie", "numérodesérie",
    ),
    "customer": ("customer", "client", "kunde", "cliente", "team"),
    "operator": (
        "operator", "tester", "engineer", "technician", "prüfer", "pruefer", "bediener",
        "opérateur", "operateur", "operatore", "operador",
    ),
    "date": ("date", "testdate", "dateoftest", "datum", "datetime", "fecha"),
    "rig": ("rig", "testrig", "machine", "dyno", "prüfstand", "pruefstand"),
    "text": ("text", "comment", "remark", "notes", "note", "bemerkung", "kommentar"),
}  # fmt: skip
_MANY = 3  # values of one key that are named
_LONGEST = 200  # letters of a value; a longer one is cut


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Identity of the damper on the rig and of its test, as it was written; else empty."""

    damper: str = ""
    serial: str = ""
    customer: str = ""
    operator: str = ""
    date: str = ""
    rig: str = ""
    text: str = ""
    more: tuple[tuple[str, str], ...] = ()  # other columns of the table of tests

    @property
    def owner(self) -> str:
        """What identifies a damper: the serial number, else the damper's name."""
        return self.serial or self.damper

    def over(self, other: Identity) -> Identity:
        """Return this identity with what it does not know taken from another one."""
        known = {key: getattr(self, key) or getattr(other, key) for key in IDENTITY_KEYS}
        return Identity(**known, more=tuple((dict(other.more) | dict(self.more)).items()))

    def describe(self) -> dict[str, str]:
        """Return what is known, by its names."""
        named = {key: getattr(self, key) for key in IDENTITY_KEYS}
        return {key: value for key, value in (named | dict(self.more)).items() if value}

    @property
    def sentence(self) -> str:
        """For people: "damper D7, serial 1234; rig: hall 2"; empty where nothing is known."""
        return identity_sentence(self.describe())


IDENTITY_KEYS = tuple(field.name for field in fields(Identity) if field.name != "more")


def identity_sentence(stated: Mapping[str, str]) -> str:
    """Return what is known of a test, by its names, for people."""
    whose = ", ".join(f"{key} {stated[key]}" for key in ("damper", "serial") if key in stated)
    rest = [f"{k}: {v}" for k, v in stated.items() if k not in {"damper", "serial"}]
    return "; ".join(([whose] if whose else []) + rest)


def _plain(key: str) -> str:
    return re.sub(r"[\W_]+", "", key.casefold())


def names_identity(key: str) -> bool:
    """Return whether a key of a preamble is one of those that say whose test it is."""
    return any(_plain(key) in known for known in _WORDS.values())


def identity_in(metadata: Mapping[str, str]) -> Identity:
    """Return what a preamble says about the test.

    >>> identity_in({"Serial No.": "1234", "rig": "hall 2"}).sentence
    'serial 1234; rig: hall 2'
    """
    words = {_plain(key): value for key, value in metadata.items()}
    facts: dict[str, Any] = {}
    for key, known in _WORDS.items():
        stated = next((words[word] for word in known if words.get(word, "").strip()), "")
        facts[key] = " ".join(stated.split())[:_LONGEST]
    return Identity(**facts)


def common_identity(identities: Iterable[Identity]) -> Identity:
    """Return what several tests have in common; what differs is listed, of many the first."""
    known = list(identities)

    def listed(values: Iterable[str]) -> str:
        distinct = list(dict.fromkeys(value for value in values if value))
        more = f" and {len(distinct) - _MANY} more" if len(distinct) > _MANY else ""
        return ", ".join(distinct[:_MANY]) + more

    named = {key: listed(getattr(value, key) for value in known) for key in IDENTITY_KEYS}
    others = dict.fromkeys(name for value in known for name, _ in value.more)
    more = tuple((name, listed(dict(x.more).get(name, "") for x in known)) for name in others)
    return Identity(**named, more=more)
