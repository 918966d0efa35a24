"""What to fit and how: the options of an identification."""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from damperfit.damper.model import Model, Quantity
from damperfit.errors import ConfigurationError, blamed_on, did_you_mean
from damperfit.identification.sharing import GAS_FOLLOWER
from damperfit.problem import Key, Option
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting, nearest_setting


@dataclass(frozen=True, slots=True)
class GivenStart:
    """Numbers that a fit starts at; what is not given is the model's own start."""

    named: Mapping[str, float] = field(default_factory=dict)  # of every setting, SI; these first
    # Of an earlier run. A setting that it does not have starts from the nearest one.
    by_setting: Mapping[Setting, Mapping[str, float]] = field(default_factory=dict)
    # Whether these are where one model of all settings has ended: a joint fit starts there too.
    is_of_one_model: bool = False

    def of(self, setting: Setting) -> dict[str, float]:
        """Return the numbers that a setting's fit starts at."""
        near = nearest_setting(setting, self.by_setting)
        return {**({} if near is None else self.by_setting[near]), **self.named}


def check_start(quantity: Quantity, value: float, *, is_fixed: bool, is_held: bool) -> None:
    """Refuse a start of what is fixed or held, or beyond the plausible range."""
    name = quantity.name
    if is_fixed:
        raise ConfigurationError(
            f"{name} is fixed and also given a start; choose one.", code="fixed-and-started"
        )
    if is_held:
        raise ConfigurationError(
            f"{name} is given a start but is not fitted: it is held at {quantity.default:g}"
            f"{quantity.unit_after} unless {{--free}} names it; free it, or give {{fix}}.",
            fix=Option("fix", f"{value:g}", name),
            code="held-and-started",
        )
    low, high = quantity.plausible
    if not low <= value <= high:
        raise ConfigurationError(
            f"{name} = {value:g} is given as a start, far from any damper's; expected {low:g} to "
            f"{high:g}{quantity.unit_after}.",
            code="implausible",
        )


@dataclass(frozen=True, slots=True)
class HoldOutOptions:
    """What is kept from the fit and predicted instead."""

    patterns: tuple[str, ...] = ()  # which logs, by name or path
    cycles: float = 0.0  # of the last steady cycles of every log; below 1 a share of them


PROCEDURE_NAMES = ("paper", "joint", "plain")
BULK_MODULUS_NAMES = ("free", "appendix1")
DETECT = "detect"  # in place of names: share what no adjuster moves


@dataclass(frozen=True, slots=True)
class FitOptions:
    """What to fit and how; what a field means that is a key too stands in [identification]."""

    procedure: str = "paper"  # a name of `PROCEDURE_NAMES`
    free: tuple[str, ...] | None = None  # None: the procedure's own
    fixed: Mapping[str, float] = field(default_factory=dict)  # SI
    # How exactly to integrate. 10 mN for one step leaves a bias of 1e-5 in R_m1, a hundredth of
    # what 4 N of noise does; a fit with less misfit is refined with a tighter integrator.
    solver: SolverOptions = SolverOptions(tolerance=1e-2)
    max_evaluations: int = 100
    # None: what is the damper's or the rig's (detected, a bleed with 8 % a click was pooled), or
    # as `DETECT` with several adjusters: what none moves, as logs show or `follows` declares.
    share: tuple[str, ...] | None = None
    # Parameters that have one value for each click of some adjusters, as declared.
    follows: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    # What to take, with a warning, for parameters that no log fixes, in place of what the model
    # knows of them (`Quantity.fallback`).
    fallbacks: Mapping[str, float] = field(default_factory=dict)
    bulk_modulus: str = "free"  # a name of `BULK_MODULUS_NAMES`
    starts: int = 1  # of each setting's fit; 1: its own alone
    from_closed: tuple[str, ...] = ()  # adjusters whose highest click is the softest
    start: GivenStart = GivenStart()  # where the fits start, as far as somebody has said so
    untied: tuple[str, ...] = ()
    # Whether a part of the law that does nothing at a setting is left out there (`plain`).
    is_leaving_out: bool = False

    @property
    def is_detecting(self) -> bool:
        """Whether a joint fit shares what no adjuster moves."""
        return self.share == (DETECT,)

    @property
    def is_by_scope(self) -> bool:
        """Whether nobody has named what a joint fit shares."""
        return self.share is None or self.is_detecting

    def detects(self, adjusters: Sequence[str]) -> bool:
        """Whether the logs show which of these adjusters moves what."""
        # Of several that is not known; that the only one moves each valve is.
        return self.is_detecting or (self.share is None and len(adjusters) > 1)

    def fallback(self, quantity: Quantity) -> float | None:
        """Return what to take for a quantity that no log fixes; None: nothing is known of it."""
        return self.fallbacks.get(quantity.name, quantity.fallback)


def check_options(  # noqa: C901, PLR0912 - one question after the other
    options: FitOptions, damper: Model
) -> None:
    """Refuse options that cannot be for a model, before any log is read."""

    def refuse(text: str, code: str, *keys: tuple[str, ...]) -> None:
        raise ConfigurationError(text, where=Key(*keys), code=code)

    _check_name("procedure", options.procedure, PROCEDURE_NAMES)
    if options.procedure not in damper.procedures:
        text = f"procedure {options.procedure} cannot fit the model {damper.name!r}; expected one "
        text += f"of {', '.join(damper.procedures)}."
        refuse(text, "other-procedure", ("identification", "procedure"))
    share, free = shared_names(options, damper), options.free or ()
    asked = {"free": free, "fix": options.fixed, "share": share, "untie": options.untied}
    for key, name in ((key, name) for key, names in asked.items() for name in names):
        with blamed_on(Key(("identification", key))):
            damper.quantity(name)
    for name in free:
        if name in options.fixed:
            text = f"{name} is both free and fixed; choose one."
            refuse(text, "free-and-fixed", ("identification", "free"), ("fix",))
    for name in options.follows:
        damper.quantity(name)
        if name in options.fixed:
            text = f"{name} follows an adjuster and is fixed; choose one."
            refuse(text, "followed-and-fixed", ("identification", "fix"))
    for name in share if options.procedure == "joint" and not options.is_by_scope else ():
        if name in {*options.fixed, *free}:
            text = f"{name} is shared and also free or fixed; choose one."
            refuse(text, "shared-and-fixed", ("identification", "share"), ("free", "fix"))
    _check_name("bulk modulus", options.bulk_modulus, BULK_MODULUS_NAMES)
    text = ""
    if options.bulk_modulus == "free":
        pass
    elif options.bulk_modulus not in damper.bulk_moduli:
        text = f"the model {damper.name!r} has no gas content that K_e could follow; expected free."
    elif options.procedure != "joint":
        text = (
            "one gas content for all settings needs one fit of all settings; expected procedure "
            f"joint, found {options.procedure}."
        )
    elif GAS_FOLLOWER in {*options.fixed, *free, *share}:
        text = "K_e follows from the gas content; it cannot be free, fixed or shared too."
    if text:
        refuse(f"{options.bulk_modulus}: {text}", "no-gas-content", ("bulk_modulus",))
    for name, begin in options.start.named.items():
        started = damper.quantity(name)
        is_held = started.default is not None and name not in {*free, *share}
        with blamed_on(Key(("identification", "start_values"))):
            check_start(started, begin, is_fixed=name in options.fixed, is_held=is_held)
    for quantity in damper.quantities:
        value, (low, high) = options.fixed.get(quantity.name), quantity.plausible
        if value is None or (quantity.may_vanish and value == 0.0) or low <= value <= high:
            continue
        text = f"{quantity.name} = {value:g} is fixed, far from any damper's; expected {low:g} to "
        refuse(f"{text}{high:g}{quantity.unit_after}.", "implausible", ("identification", "fix"))


def shared_names(options: FitOptions, damper: Model) -> tuple[str, ...]:
    """The parameters that a joint fit shares, or, to detect them, that no adjuster could move."""
    shared: Iterable[str] = options.share or ()
    if options.is_by_scope:
        shared = (q.name for q in damper.quantities if q.is_shared and q.default is None)
    return tuple(name for name in shared if name not in options.untied)


def _check_name(what: str, name: str, names: tuple[str, ...]) -> None:
    if name not in names:
        raise ConfigurationError(
            f"no {what} {name!r}; there are {', '.join(names)}.{did_you_mean(name, names)}",
            where=Key(("identification", what.replace(" ", "_"))),
            code=f"unknown-{what.replace(' ', '-')}",
        )


def check_profile_names(
    names: Iterable[str], known: Sequence[str], *, fixed: Container[str] = ()
) -> None:
    """Refuse, by a ConfigurationError, names of no known parameter, or of one that is held."""
    where = Key(("identification", "profile"))
    for name in names:
        if name not in known:
            there, hint = ", ".join(known), did_you_mean(name, known)
            text = f"no parameter {name!r} to profile; there are {there}.{hint}"
            raise ConfigurationError(text, where=where, code="unknown-quantity")
        if name in fixed:
            where = Key(("identification", "profile"), ("fix",))
            text = f"{name} is both fixed and to be profiled; choose one."
            raise ConfigurationError(text, where=where, code="not-together")
