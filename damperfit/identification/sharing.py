"""Where the parameters that all settings share came from; their errors are traced back by it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from damperfit.identification.paper.gas_content import GAS_FOLLOWER, GAS_NAMES
from damperfit.identification.unknowns import Follows, Unknown, unknown_at, unknowns_of
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.identification.paper.gas_content import GasLaw
    from damperfit.tested.setting import Place

__all__ = ["Sharing", "listed_runs", "listed_settings", "of_runs", "of_settings"]

# Frictions further from their middle than this share are not one; noise alone moves those of the
# sample runs by far less.
_ALIKE = 0.2
_ANY = Setting(())  # where nothing follows an adjuster any setting stands for all
_MANY = 20  # runs of settings that a sentence names


@dataclass(frozen=True, slots=True)
class Sharing:
    """How the shared parameters were estimated; empty where the logs did not give them.

    Attributes
    ----------
    free : tuple of str
        What was free together with them at each setting.
    jointly : tuple of str
        Parameters found in one fit over all settings.
    follows : mapping of str to tuple of str
        Adjusters that some of these follow: one value for each click. What is not named has one.
    is_detected : bool
        The logs showed what follows which adjuster; otherwise it was declared.
    settings : tuple of Setting
        Settings of that fit.
    taken : mapping of str to Setting
        Parameters that the logs of one setting gave, and which.
    means : mapping of str to tuple of Setting
        Parameters that are the mean of what some settings gave, and which.
    spread : tuple of float or None
        Smallest and largest friction of these settings, each with its own, N.
    is_spread_certain : bool
        These frictions differ by more than their errors.
    held : tuple of str
        Of what was free: held at its mean as one setting gave what was taken from it.
    gas : GasLaw or None
        The law that K_e follows over the settings, where it was asked for.
    gas_rises : mapping of Setting to float
        By how much a setting's misfit is above that with a K_e of its own, in units of the noise:
        chi-squared with one degree of freedom where the law holds.
    """

    free: tuple[str, ...] = ()
    jointly: tuple[str, ...] = ()
    follows: Follows = field(default_factory=dict)
    is_detected: bool = False
    settings: tuple[Setting, ...] = ()
    taken: Mapping[str, Setting] = field(default_factory=dict)
    means: Mapping[str, tuple[Setting, ...]] = field(default_factory=dict)
    spread: tuple[float, float] | None = None
    is_spread_certain: bool = True
    held: tuple[str, ...] = ()
    gas: GasLaw | None = None
    gas_rises: Mapping[Setting, float] = field(default_factory=dict)

    @property
    def friction_varies(self) -> bool:
        """Whether one friction for all settings does not hold."""
        if self.spread is None or not self.is_spread_certain:
            return False
        low, high = self.spread
        return high - low > _ALIKE * (high + low)

    @property
    def found(self) -> tuple[str, ...]:
        """Names of the parameters that the logs gave once for all settings."""
        if self.jointly:
            return self.jointly if self.gas is None else (*self.jointly, GAS_FOLLOWER)
        return (*self.taken, *self.means)

    def is_mean(self, name: str) -> bool:
        """Whether a parameter is the mean of what single settings gave."""
        return name in self.means and not self.jointly

    def found_at(self, setting: Setting) -> tuple[str, ...]:
        """Names of those that a setting has in common with others of the fit.

        A click that no other setting of the joint fit has is determined by none.
        """
        if not self.follows:
            return self.found
        known = set(self.unknowns)
        return tuple(n for n in self.found if unknown_at(n, self.follows, setting) in known)

    @property
    def common(self) -> tuple[str, ...]:
        """Names of those that are one for all settings."""
        return tuple(name for name in self.found if not self.follows.get(name))

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What is behind them: themselves for each click that they have, but for K_e its law."""
        if self.gas is None:
            return unknowns_of(self.found, self.follows, self.settings or (_ANY,))
        return unknowns_of((*self.jointly, *GAS_NAMES), self.follows, self.settings)

    @property
    def variables(self) -> tuple[str, ...]:
        """Labels of the unknowns; of what all settings share, the name."""
        return tuple(one.label for one in self.unknowns)

    @property
    def sentence(self) -> str:
        """What follows which adjuster, without a full stop; empty where that was not asked.

        Examples
        --------
        >>> at = (Setting((("low", 6),)), Setting((("low", 14),)))
        >>> Sharing(("s", "k"), ("s", "k"), {"s": ("low",)}, True, at).sentence
        'The logs show that s follows low; everything else is shared by all 2 settings'
        """
        if not self.follows and not self.is_detected:
            return ""
        groups: dict[tuple[str, ...], list[str]] = {}
        for name in self.jointly:
            groups.setdefault(tuple(self.follows.get(name, ())), []).append(name)
        own = [name for name in self.free if name not in self.jointly]
        rest = groups.pop((), [])
        said = [
            f"{_listed(names)} follow{'s' if len(names) == 1 else ''} {_listed(adjusters)}"
            for adjusters, names in groups.items()
        ]
        if own:
            said.append(f"{_listed(own)} {'is' if len(own) == 1 else 'are'} each setting's own")
        if rest:
            what = "everything else" if said else "everything"
            said.append(f"{what} is shared by all {len(self.settings)} settings")
        return ("The logs show that " if self.is_detected else "As declared ") + "; ".join(said)

    def whose(self, name: str, setting: Setting) -> str:
        """Return by whom a shared parameter is shared, for people.

        Examples
        --------
        >>> Sharing(jointly=("r_m3",)).whose("r_m3", Setting.of(3))
        'all settings'
        """
        places = unknown_at(name, self.follows, setting).places
        at = ", ".join(f"{adjuster} {place}" for adjuster, place in places)
        return f"all settings at {at}" if at else "all settings"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def listed_settings(settings: Iterable[Setting | Place]) -> str:
    """Return settings in order: of whole numbers runs of three and more drawn together.

    Examples
    --------
    >>> listed_settings([1, 2, 5, 6, 7]), listed_settings([Setting.of("soft"), Setting.of(3)])
    ('1, 2, 5-7', '3, soft')
    """
    known = sorted(map(Setting.of, settings))
    numbers = [one.cell for one in known if isinstance(one.cell, int)]
    if len(numbers) < len(known):
        more = f" and {len(known) - _MANY} more" if len(known) > _MANY else ""
        return ", ".join(map(str, known[:_MANY])) + more
    runs: list[tuple[int, int]] = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], number)
        else:
            runs.append((number, number))
    return listed_runs(runs)


def of_settings(settings: Iterable[Setting | Place]) -> str:
    """As in "setting 4" or "settings 1, 5-9"."""
    known = list(settings)
    return f"setting{'s' if len(known) > 1 else ''} {listed_settings(known)}"


def listed_runs(runs: Sequence[tuple[int, int]]) -> str:
    """Return runs of whole numbers, each given by its first and last; of many, the first ones.

    Examples
    --------
    >>> listed_runs([(4, 4), (7, 8), (10, 900000)])
    '4, 7, 8, 10-900000'
    """
    said = [
        f"{a}-{b}" if b - a > 1 else ", ".join(map(str, range(a, b + 1))) for a, b in runs[:_MANY]
    ]
    more = sum(b - a + 1 for a, b in runs[_MANY:])
    return ", ".join(said) + (f" and {more} more" if more else "")


def of_runs(runs: Sequence[tuple[int, int]]) -> str:
    """Return runs of whole numbers as settings, in the singular or the plural.

    Examples
    --------
    >>> of_runs([(4, 4)]), of_runs([(1, 3)]), of_runs([(4, 4), (7, 7)])
    ('setting 4', 'settings 1-3', 'settings 4, 7')
    """
    is_one = len(runs) == 1 and runs[0][0] == runs[0][1]
    return f"setting{'' if is_one else 's'} {listed_runs(runs)}"
