"""Where the parameters that all settings share came from; their errors are traced back by it."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple, TypeAlias

import numpy as np

from damperfit.damper.model import Values
from damperfit.problem import as_subject, in_a_row
from damperfit.tested.setting import Place, Setting

Follows: TypeAlias = "Mapping[str, tuple[str, ...]]"
"""Adjusters that a quantity follows; one that is not named is the damper's."""


class Unknown(NamedTuple):
    """One number that settings have in common."""

    name: str
    places: tuple[tuple[str, Place], ...] = ()  # of the adjusters that it follows

    @property
    def label(self) -> str:
        """For people and for mappings by name: of the damper's it is the name.

        >>> Unknown("r_m3").label, Unknown("rebound_bleed", (("low_speed", 6),)).label
        ('r_m3', 'rebound_bleed at low_speed 6')
        """
        where = ", ".join(f"{adjuster} {place}" for adjuster, place in self.places)
        return f"{self.name} at {where}" if where else self.name

    def holds_at(self, setting: Setting) -> bool:
        """Whether a setting has it."""
        return all(setting.place(adjuster) == place for adjuster, place in self.places)


def unknown_at(name: str, follows: Follows, setting: Setting) -> Unknown:
    """The unknown that a quantity is at a setting."""
    return Unknown(name, tuple((a, setting.place(a)) for a in follows.get(name, ())))


def one_by_one(
    follows: Follows,
    changes: Sequence[tuple[str, tuple[str, ...]]],
    worth: Callable[[dict[str, tuple[str, ...]]], float],
    least: float,
) -> list[dict[str, tuple[str, ...]]]:
    """Change what one quantity follows, the best first, until nothing is gained by it; each way.

    Changes are of a name; the first way is what was given.
    """
    ways = [dict(follows)]
    while True:
        here = ways[-1]
        others = [here | {name: some} for name, some in changes if here.get(name) != some]
        best = min(others, key=worth, default=here)
        if worth(best) >= worth(here) - least:
            return ways
        ways.append(best)


def unknowns_of(
    names: Sequence[str], follows: Follows, settings: Iterable[Setting]
) -> tuple[Unknown, ...]:
    """The unknowns that shared quantities are at some settings, quantity by quantity."""
    at = list(settings)
    return tuple(dict.fromkeys(unknown_at(name, follows, s) for name in names for s in at))


# What follows from a gas content, and the two numbers of its law in the order of their columns.
GAS_FOLLOWER, GAS_NAMES = "k_e", ("volume_ratio", "stiffness")


class GasLaw(NamedTuple):
    """K_e of every setting from one gas content: Appendix 1 of the paper, eq. (28).

    1/K_e = V_r/(gamma P) + C/K_B, with P the mean working pressure of a setting. With the share of
    the compliance that the gas has, s = K_e V_r/(gamma P)::

        d ln K_e = -s d ln V_r + (1 - s) d ln(K_B/C)
    """

    volume_ratio: float  # V_r, trapped gas over oil
    stiffness: float  # K_B/C, bulk modulus of oil and tube without gas, Pa
    gas_exponent: float  # gamma
    pressures: Mapping[Setting, float]  # P by setting, absolute, Pa

    def modulus(self, setting: Setting) -> float:
        """K_e of a setting, Pa."""
        from damperfit.damper.purdy.parameters import modulus_at_pressure

        # Eq. (28) with K_B/C in place of K_B and V_r/C in place of V_r has C = 1.
        return float(
            modulus_at_pressure(
                self.pressures[setting],
                volume_ratio=self.volume_ratio,
                liquid=self.stiffness,
                compliance=1.0,
                gas_exponent=self.gas_exponent,
            )
        )

    def share(self, setting: Setting) -> float:
        """Share of a setting's compliance that the gas has, 0 to 1."""
        gas = self.gas_exponent * self.pressures[setting]
        return self.modulus(setting) * self.volume_ratio / gas


# Frictions further from their middle than this share are not one; noise alone moves those of the
# sample runs by far less.
_ALIKE = 0.2
_ANY = Setting(())  # where nothing follows an adjuster any setting stands for all
_MANY = 20  # runs of settings that a sentence names


@dataclass(frozen=True, slots=True)
class Sharing:
    """How the shared parameters were estimated; empty where the logs did not give them."""

    free: tuple[str, ...] = ()  # what was free together with them at each setting
    jointly: tuple[str, ...] = ()  # parameters found in one fit over all settings
    # Adjusters that some of these follow: one value for each click. What is not named has one.
    follows: Follows = field(default_factory=dict)
    is_detected: bool = False  # the logs showed what follows which; otherwise it was declared
    settings: tuple[Setting, ...] = ()  # of that fit
    taken: Mapping[str, Setting] = field(default_factory=dict)  # given by one setting, and by which
    # Parameters that are the mean of what some settings gave, and which.
    means: Mapping[str, tuple[Setting, ...]] = field(default_factory=dict)
    # Smallest and largest friction of these settings, each with its own, N.
    spread: tuple[float, float] | None = None
    is_spread_certain: bool = True  # these frictions differ by more than their errors
    # Of what was free: held at its mean as one setting gave what was taken from it.
    held: tuple[str, ...] = ()
    gas: GasLaw | None = None  # that K_e follows over the settings, where it was asked for
    # By how much a setting's misfit is above that with a K_e of its own, in units of the noise:
    # chi-squared with one degree of freedom where the law holds.
    gas_rises: Mapping[Setting, float] = field(default_factory=dict)

    @property
    def friction_varies(self) -> bool:
        """Whether one friction for all settings does not hold."""
        if self.spread is None or not self.is_spread_certain:
            return False
        low, high = self.spread
        return high - low > _ALIKE * (high + low)

    @property
    def estimated(self) -> tuple[str, ...]:
        """Names of the parameters that the logs gave once for all settings."""
        if self.jointly:
            return self.jointly if self.gas is None else (*self.jointly, GAS_FOLLOWER)
        return (*self.taken, *self.means)

    def is_mean(self, name: str) -> bool:
        """Whether a parameter is the mean of what single settings gave."""
        return name in self.means and not self.jointly

    def estimated_at(self, setting: Setting) -> tuple[str, ...]:
        """Names of those that a setting has in common with others of the fit."""
        if not self.follows:
            return self.estimated
        known = set(self.unknowns)  # a click that no other setting has is determined by none
        return tuple(n for n in self.estimated if unknown_at(n, self.follows, setting) in known)

    @property
    def common(self) -> tuple[str, ...]:
        """Names of those that are one for all settings."""
        return tuple(name for name in self.estimated if not self.follows.get(name))

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What is behind them: themselves for each click that they have, but for K_e its law."""
        if self.gas is None:
            return unknowns_of(self.estimated, self.follows, self.settings or (_ANY,))
        return unknowns_of((*self.jointly, *GAS_NAMES), self.follows, self.settings)

    @property
    def sentence(self) -> str:
        """What follows which adjuster, without a full stop; empty where that was not asked.

        >>> at = (Setting((("low", 6),)), Setting((("low", 14),)))
        >>> Sharing(("s", "k"), ("s", "k"), {"s": ("low",)}, True, at).sentence
        'The logs show that s follows low; everything else is shared by all 2 settings'
        """
        if not self.follows and not self.is_detected:
            return ""
        groups: dict[tuple[str, ...], list[str]] = {}
        for name in self.jointly:
            groups.setdefault(tuple(self.follows.get(name, ())), []).append(name)
        rest = groups.pop((), [])
        parts = [
            f"{in_a_row(names)} follow{'s' if len(names) == 1 else ''} {in_a_row(adjusters)}"
            for adjusters, names in groups.items()
        ]
        if own := [name for name in self.free if name not in self.jointly]:
            parts.append(f"{as_subject(own)} each setting's own")
        if rest:
            what = "everything else" if parts else "everything"
            parts.append(f"{what} is shared by all {len(self.settings)} settings")
        return ("The logs show that " if self.is_detected else "As declared ") + "; ".join(parts)

    def whose(self, name: str, setting: Setting) -> str:
        """By whom a shared parameter is shared, for people."""
        places = unknown_at(name, self.follows, setting).places
        at = ", ".join(f"{adjuster} {place}" for adjuster, place in places)
        return f"all settings at {at}" if at else "all settings"


def listed_settings(settings: Iterable[Setting | Place]) -> str:
    """Settings in order: of whole numbers runs of three and more drawn together.

    >>> listed_settings([1, 2, 5, 6, 7]), listed_settings([Setting.of("soft"), Setting.of(3)])
    ('1, 2, 5-7', '3, soft')
    """
    known = sorted(map(Setting.of, settings))
    runs: list[tuple[int, int]] = []
    for number in (setting.cell for setting in known):
        if not isinstance(number, int):
            more = f" and {len(known) - _MANY} more" if len(known) > _MANY else ""
            return ", ".join(map(str, known[:_MANY])) + more
        first = runs.pop()[0] if runs and number == runs[-1][1] + 1 else number
        runs.append((first, number))
    return _listed_runs(runs)


def of_settings(settings: Iterable[Setting | Place]) -> str:
    """As in "setting 4" or "settings 1, 5-9"."""
    known = list(settings)
    return f"setting{'s' if len(known) > 1 else ''} {listed_settings(known)}"


def of_runs(runs: Sequence[tuple[int, int]]) -> str:
    """Runs of whole numbers, each given by its first and last, as settings.

    >>> of_runs([(4, 4)]), of_runs([(1, 3)]), of_runs([(4, 4), (7, 7), (10, 900000)])
    ('setting 4', 'settings 1-3', 'settings 4, 7, 10-900000')
    """
    is_one = len(runs) == 1 and runs[0][0] == runs[0][1]
    return f"setting{'' if is_one else 's'} {_listed_runs(runs)}"


def _listed_runs(runs: Sequence[tuple[int, int]]) -> str:
    """Runs of whole numbers; of many, the first ones."""
    listed = [
        f"{a}-{b}" if b - a > 1 else ", ".join(map(str, range(a, b + 1))) for a, b in runs[:_MANY]
    ]
    more = sum(b - a + 1 for a, b in runs[_MANY:])
    return ", ".join(listed) + (f" and {more} more" if more else "")


# A setting that was not fitted, put together from settings that have its clicks.
#
# Where a joint fit gave a quantity one value for each click of an adjuster, R12 C8 is known from
# R12 and C8 beside others. What settings share is one number to the last digit; fitted apart no
# two of them are equal, and nothing is put together.


def values_from_others(known: Mapping[Setting, Values], setting: Setting) -> Values | None:
    """The values of a setting from those of others, fitted together; None where they have none.

    An offset, which is each test's own, is the mean of theirs.

    >>> from damperfit.damper.model import values_type
    >>> from damperfit.damper.model import Quantity
    >>> s = Quantity("s", "s", "bleed", "bleed", "Pa", (1.0, 9.0))
    >>> p = Quantity("p", "p", "opening", "opening", "Pa", (1.0, 9.0))
    >>> at = lambda low, high: Setting((("low", low), ("high", high)))
    >>> known = {at(1, 1): (2.0, 5.0), at(1, 2): (2.0, 7.0), at(3, 1): (4.0, 5.0)}
    >>> values_from_others({k: values_type((s, p))(*v) for k, v in known.items()}, at(3, 2))
    Values(s=4.0, p=7.0)
    """
    settings = {Setting.of(key): at for key, at in known.items()}
    alike = {other: at for other, at in settings.items() if other.adjusters == setting.adjusters}
    if any(all(other.place(a) != place for other in alike) for a, place in setting.places):
        return None
    first = next(iter(alike.values()))
    values: dict[str, float] = {}
    for quantity in first.quantities:
        numbers = {other: float(getattr(at, quantity.name)) for other, at in alike.items()}
        if len(set(numbers.values())) == 1:
            continue
        mean = float(np.mean(list(numbers.values())))
        value = mean if quantity.is_offset else _by_clicks(numbers, setting)
        if value is None:
            return None
        values[quantity.name] = value
    return first.replace(values)


def unlimited_in(
    values: Values, known: Mapping[Setting, Values], unlimited: Mapping[Setting, Collection[str]]
) -> tuple[str, ...]:
    """Which values of a setting, as `values_from_others` has them, rest on unlimited ones."""
    # A blow-off that opened in no log of its click has any p_open; another motion, or another
    # click of the bleed beside it, may need the true one.
    return tuple(
        name
        for name in values.names
        if (whose := [o for o in known if getattr(known[o], name) == getattr(values, name)])
        and all(name in unlimited.get(other, ()) for other in whose)
    )


def _by_clicks(numbers: Mapping[Setting, float], setting: Setting) -> float | None:
    """The number at a setting of what follows some of its adjusters; all that may be must agree."""
    for size in range(1, len(setting.adjusters)):
        possible = set()
        for some in combinations(setting.adjusters, size):
            groups: dict[tuple[object, ...], set[float]] = {}
            for other, number in numbers.items():
                groups.setdefault(tuple(map(other.place, some)), set()).add(number)
            if all(len(group) == 1 for group in groups.values()):
                possible.add(min(groups.get(tuple(map(setting.place, some)), {math.nan})))
        if possible:
            (number, *others) = possible
            return None if others or math.isnan(number) else number
    return None
