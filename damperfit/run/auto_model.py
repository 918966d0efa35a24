"""Logs in, the model that they support out: searched on few settings, then fitted at all."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from damperfit.conditioning.polarity import YIELDS, held_share
from damperfit.configuration.damper_section import damper_record
from damperfit.configuration.options import GAS, Configuration, followed, gas_in_words, unmatched
from damperfit.damper.model import Model, Quantity
from damperfit.damper.purdy.parameters import Damper
from damperfit.damper.valve_dampers import Monotube, ValveDamper
from damperfit.errors import ConfigurationError
from damperfit.identification.options import DETECT, FitOptions, GivenStart, shared_names
from damperfit.identification.sharing import Follows
from damperfit.laws.criterion import FLOOR_PERCENT
from damperfit.laws.description import physics_in, undecided
from damperfit.laws.law_fit import (
    UNDETERMINED,
    Candidate,
    ComparedCandidate,
    LawFit,
    LawSearch,
    SettingLogs,
    most_unlike,
    rank_rivals,
    yielding_sentences,
)
from damperfit.laws.search import follows_by_scope, search_laws
from damperfit.laws.structures import LAYOUTS
from damperfit.problem import Failure, Problem, as_subject, failure_lines, in_a_row, note
from damperfit.reporting.answer import Answer
from damperfit.reporting.sheet import Sheet, number, percent
from damperfit.reporting.tables import rival_sheet, tried_laws_sheet
from damperfit.run.identify import gather
from damperfit.run.logs import LogBatch
from damperfit.run.preparation import by_damper, prepare
from damperfit.tables.files import finite, json_values
from damperfit.tested.setting import Setting
from damperfit.workers import available_cores

# What is not determined of a damper whose layout, dimensions or gas were not declared.

# What a law has of its own, and the lengths that make the paper's gas volume.
_VALVES = {"rebound", "compression"}
GAS_LENGTHS = {"gas_length", "gas_piston_diameter"}
# Dimensions whose error bends the loop, and what of the rig takes its shape.
_DIMENSIONS = {
    "rod_diameter": "the rod",
    "piston_diameter": "the bore",
    "gas_pressure": "the gas pressure",
}
_OF_RIG = {
    "k_s": "elasticity",
    "play": "play",
    "rubber": "its rubber",
    "lag": "the lag of the force",
    "moving_mass": "the moving mass",
}

# Against a law the evidence is very strong from here on (Kass and Raftery, J. Am. Stat. Assoc. 90
# (1995) 773); of those that remain so many are listed.
_DECIDED, _MOST_LEFT = 10.0, 3


def declared_dimensions(
    configuration: Configuration, damper: Damper | ValveDamper
) -> dict[str, Any]:
    """What a layout takes from the damper: what was declared, as `--model NAME` does."""
    own = {field.name for field in fields(damper) if field.init}
    shared = {field.name for field in fields(ValveDamper) if field.name in own} - _VALVES
    if isinstance(damper, ValveDamper):
        return {name: getattr(damper, name) for name in shared}
    values = {name: getattr(damper, name) for name in shared}
    values["gas_volume"] = damper.gas_volume
    declared = {key.removeprefix("damper.") for key in configuration.declared}
    if declared & GAS_LENGTHS:
        declared |= {"gas_volume"}
    return {name: value for name, value in values.items() if name in declared}


def _declared(configuration: Configuration) -> set[str]:
    """Declared values among those that a layout takes from the damper."""
    if isinstance(configuration.damper, Damper):
        return {*declared_dimensions(configuration, configuration.damper)}
    return {name.removeprefix("damper.") for name in configuration.declared}


def is_monotube_open(configuration: Configuration, search: LawSearch, layout: str | None) -> bool:
    """Whether a monotube is excluded only by an undeclared gas pressure.

    Its rod side is empty in bump at the gas pressure times the annulus.
    """
    taken = search.chosen.fits[0].model
    return (
        layout is None
        and "damper.model" not in configuration.declared
        and isinstance(taken, ValveDamper)
        and Monotube.name not in {taken.name, *search.alike}
        and "gas_pressure" not in _declared(configuration)
    )


def open_layout(
    configuration: Configuration, fit: LawFit, layout: str | None, *, is_open: bool
) -> tuple[str, ...]:
    """Return what is not determined of the layout, but for layouts that fit equally, as text."""
    if is_open and isinstance(fit.model, ValveDamper):
        name, pressure = fit.model.name.replace("_", " "), 1e-5 * fit.model.gas_pressure
        text = (
            f"The layout, {name} or monotube: the gas pressure is not declared, and a monotube "
            f"with more than the {pressure:.3g} bar that were taken may fit as well. Pressures and "
            "orifices of the valves differ with it (intervals of identify hold both). Declare the "
            "layout (damper.model, or a layout for models), or the gas pressure as measured."
        )
    elif not isinstance(fit.model, Damper) or "damper.model" in configuration.declared:
        return ()
    elif layout is not None:
        text = (
            f"The valves of the {layout.replace('_', ' ')}: the paper's model, which has others, "
            f'is enough for these logs. damper.model = "{layout}" fits them all the same.'
        )
    else:
        text = (
            "The layout: the paper's model is enough for these logs, but a damper that is built "
            "otherwise may fit it as well, with other resistances and pressures for the same "
            "forces. Where the maker's drawing shows another layout, name it (damper.model, or a "
            "layout for models)."
        )
    return (text,)


def open_dimensions(configuration: Configuration, fit: LawFit) -> tuple[str, ...]:
    """Return what of the rig may be the doing of undeclared dimensions, in a sentence."""
    damper = configuration.damper
    if not isinstance(fit.model, ValveDamper) or not isinstance(damper, Damper | ValveDamper):
        return ()
    declared = _declared(configuration)
    missing = [words for name, words in _DIMENSIONS.items() if name not in declared]
    parts = [words for name, words in _OF_RIG.items() if name in fit.free]
    if not missing or not parts:
        return ()
    text = (
        f"Whether {as_subject(parts)} the rig's: {as_subject(missing)} not declared, and a wrong "
        "one may look like that. Declare them as measured."
    )
    return (text,)


def assumed_gas(configuration: Configuration, tried: Sequence[Candidate]) -> tuple[Problem, ...]:
    """The undeclared gas that the layouts tried need, in a sentence."""
    damper = configuration.damper
    has_valves = any(isinstance(law.fits[0].model, ValveDamper) for law in tried)
    if not has_valves or not isinstance(damper, Damper):
        return ()
    declared = declared_dimensions(configuration, damper)
    missing = {name: getattr(ValveDamper(), name) for name in GAS if name not in declared}
    if not missing:
        return ()
    text = (
        f"laws of real valves were tried with {gas_in_words(missing)}, the defaults of the "
        "model twin_tube and its like: declare what your damper has"
    )
    return (note("assumed", text),)


# What settings have in common.


def ties_of(
    configuration: Configuration, adjusters: tuple[str, ...], *, is_adjusted: bool = False
) -> Callable[[Model, Sequence[str]], Follows]:
    """Return from a model and what is free to the adjusters that each quantity follows.

    What is the damper's or the rig's follows none, and the rest is each setting's own; so is
    everything where each setting is to be fitted by itself. With ``is_adjusted`` what is declared
    to follow an adjuster does.
    """
    options, declared = configuration.identification, configuration.declared
    is_separate = "identification.procedure" in declared and options.procedure != "joint"
    share = options.share if "identification.share" in declared else None

    def follows(model: Model, free: Sequence[str]) -> Follows:
        if is_separate:
            return dict.fromkeys(free, adjusters)
        ties = dict(follows_by_scope(model, free, adjusters))
        if share and not options.is_detecting:
            ties = {name: adjusters for name in free if name not in share}
        named = followed(configuration.document["adjusters"], model, is_law_open=True)
        if is_adjusted and named:  # what is not declared to follow one is the damper's
            ties = {name: adjusters for name in free if model.quantity(name).is_offset}
            ties |= {n: tuple(a for a in adjusters if a in named[n]) for n in free if n in named}
        return ties | {name: adjusters for name in free if name in options.untied}

    return follows


# Logs in, the law that they support out: a search on few settings, then a fit at all of them.


@dataclass(frozen=True, eq=False, repr=False)
class LawChoice(Answer):
    """What was tried, and the chosen law at every setting.

    `compared` are the settings that `search` tried all laws on, `fits` the chosen law, one a
    setting, `lost` settings that it cannot be simulated at, `rivals` models of the literature at
    those compared, if asked for. `failures` are logs that cannot be used, `remarks` say what was
    done with the logs. `undecided` is what the logs leave open, and which test would decide it;
    `alike`, of these, what may be taken for each other; `open_layouts` what the logs exclude only
    with an undeclared gas pressure; `assumed` what the configuration takes of the damper where
    it was not declared.
    """

    search: LawSearch
    compared: tuple[Setting, ...]
    fits: tuple[LawFit, ...]
    failures: tuple[Failure, ...]
    lost: tuple[Setting, ...] = ()
    rivals: tuple[Candidate, ...] = ()
    remarks: tuple[Problem, ...] = ()
    undecided: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()
    open_layouts: tuple[str, ...] = ()
    assumed: tuple[Problem, ...] = ()

    @property
    def layouts_alike(self) -> tuple[str, ...]:
        """Layouts that are not excluded beside the one that was taken."""
        return (*self.search.alike, *self.open_layouts)

    @property
    def supported(self) -> str:
        """What the logs support, in a few words."""
        also = f" or, as well, {self.search.also}" if self.search.also else ""
        return f"{self.search.chosen.title}{also}"

    @property
    def sentences(self) -> tuple[str, ...]:
        """The physics that the chosen law sees; none where something else does as well."""
        if self.search.also:
            return ()
        yielding = yielding_sentences(self.search, self.fits)
        return yielding or physics_in(self.fits, self.layouts_alike)

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """What the logs support, and the physics that it sees."""
        return " ".join((f"The logs support {self.supported}.", *self.sentences))

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the laws that were tried, the chosen one by setting, models of the literature."""
        document = self.document()
        tried = tried_laws_sheet(document, is_narrow=True)
        return (tried, _chosen_sheet(self.fits), rival_sheet(document))

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values, as it stands in run.json."""
        search, n_eff = self.search, self.search.n_eff
        return {
            "chosen": self.supported,
            "model": search.chosen.fits[0].model.name,
            "compared_settings": [setting.cell for setting in self.compared],
            "effective_samples": None if math.isnan(n_eff) else n_eff,
            "laws": [
                {"law": law.candidate.title, "model": law.candidate.fits[0].model.name}
                | {"is_chosen": law.is_taken, **_figures(law.candidate), "change": law.change}
                | {"gain": finite(law.gain), "bic": finite(law.bic), "reason": law.reason}
                for law in search.laws
            ],
            "settings": [
                {
                    "setting": fit.setting.cell,
                    "values": dict(fit.values),
                    "free": list(fit.free),
                    "at_bound": list(fit.at_bound),
                    "not_told": list(fit.undetermined),
                    "mse_percent": fit.mse_percent,
                    "stretch_mse_percent": list(fit.segment_mses),
                    "held_out_mse_percent": finite(fit.held_out_percent),
                    "held_out": fit.held_out or None,
                    "evaluations": fit.evaluations,
                }
                for fit in self.fits
            ],
            "lost_settings": [setting.cell for setting in self.lost],
            "rivals": [
                {"title": rival.title, "model": rival.fits[0].model.name}
                | {key: getattr(rival.fits[0].model, key, "") for key in ("source", "caveat")}
                | _figures(rival)
                for rival in self.rivals
            ],
            "layouts_alike": list(self.layouts_alike),
            "spread": {str(s.cell): dict(own) for s, own in search.spread.items()},
            "exchanges": [
                {
                    "part": other.part,
                    "instead": other.instead,
                    "times_mse": other.times,
                    "values": {str(s.cell): asdict(values) for s, values in other.values.items()},
                }
                for other in search.exchanges
            ],
            "sentences": list(self.sentences),
            "doubt": search.doubt,
            "undecided": list(self.undecided),
            "remaining": [
                {
                    "title": law.title,
                    "damper": json_values(damper_record(law.fits[0].model)),
                    "settings": [
                        {"setting": fit.setting.cell, "values": dict(fit.values)}
                        for fit in law.fits
                    ],
                }
                for law in remaining(search)
            ],
        }


def _figures(tried: Candidate) -> dict[str, Any]:
    return {
        "free": list(tried.fits[0].free),
        "at_bound": list(tried.at_bound),
        "mse_percent": tried.mse_percent,
        "held_out_mse_percent": finite(tried.held_out_percent),
    }


def _chosen_sheet(fits: Sequence[LawFit]) -> Sheet:
    """Return what the chosen structure found: a row a quantity, a column a setting."""

    def value(fit: LawFit, quantity: Quantity) -> str:
        name = quantity.name
        mark = "!" if name in fit.at_bound else "?" * (name in fit.undetermined)
        return number(getattr(fit.values, name) / 10.0**quantity.power, digits=4) + mark

    shown = [q for q in fits[0].model.quantities if q.name in fits[0].free]
    rows = [(q.label, q.shown_unit or q.unit, *(value(fit, q) for fit in fits)) for q in shown]
    rows.append(("MSE", "%", *(percent(fit.mse_percent) for fit in fits)))
    rows.append(("MSE held out", "%", *(percent(fit.held_out_percent) for fit in fits)))
    notes = []
    if any(fit.at_bound for fit in fits):
        notes.append("! at a bound: not determined by these logs")
    if any(fit.undetermined for fit in fits):
        notes.append(
            f"? not determined by these logs: {UNDETERMINED:g} times as much or little would do as "
            "well"
        )
    headings = ("setting", "", *(str(fit.setting) for fit in fits))
    is_number = (False, False, *(True for _ in fits))
    return Sheet(headings, ("",) * len(headings), tuple(rows), is_number, tuple(notes))


def remaining(search: LawSearch) -> list[Candidate]:
    """Return the laws that the logs have not decided against, the nearest first.

    Those of which n ln((m + m_0)/(m_c + m_0)) + (k - k_c) ln n, with m the geometric mean of the
    MSE and k the numbers at the settings that both were fitted at, is less than `_DECIDED`.
    """
    chosen = {fit.setting: fit for fit in search.chosen.fits}
    left: dict[str, tuple[float, Candidate]] = {}
    for tried in (law.candidate for law in search.laws):
        pairs = [(fit, chosen[fit.setting]) for fit in tried.fits if fit.setting in chosen]
        # With a default freed it is the same structure.
        is_same = tried.fits[0].model == search.chosen.fits[0].model
        if is_same or not pairs or math.isnan(search.n_eff):
            continue
        times = [
            math.log((a.mse_percent + FLOOR_PERCENT) / (b.mse_percent + FLOOR_PERCENT))
            for a, b in pairs
        ]
        more = sum(len(a.free) - len(b.free) for a, b in pairs)
        against = search.n_eff * sum(times) / len(times) + more * math.log(search.n_eff)
        if against < min(_DECIDED, left.get(tried.title, (math.inf,))[0]):
            left[tried.title] = (against, tried)
    return [tried for _, tried in sorted(left.values(), key=lambda pair: pair[0])[:_MOST_LEFT]]


def choose_law(  # noqa: PLR0913 - what a user may ask of it
    configuration: Configuration,
    logs: Sequence[str],
    *,
    layout: str | None = None,
    jobs: int | None = None,
    setting: Setting | None = None,
    start: GivenStart = GivenStart(),
    on_law: Callable[[ComparedCandidate], None] = lambda _: None,
    on_rival: Callable[[Candidate], None] | None = None,
) -> LawChoice:
    """Return the law that the logs support; a ConfigurationError: no log can be used.

    ``layout`` is one of `LAYOUTS`, by default that of the model that is declared, or any;
    ``start`` a place more where every law may start, as far as it has these quantities. ``on_law``
    is called with every law that was judged, ``on_rival`` with every model of the literature;
    without it they are not ranked.
    """
    workers = jobs or available_cores()
    batch, named = gather(configuration, logs, jobs=workers, setting=setting)
    by_damper(batch, is_one=True)
    prepare(configuration, batch, configuration.hold_out, named, is_law_open=True)
    evidence = _evidence(batch, start, configuration.identification.fixed)
    if not evidence:
        lines = "; ".join(failure_lines(batch.failures)[:3])
        why = f": {lines}" if lines else ""
        raise ConfigurationError(
            f"no log can be used to compare models{why}; damperfit inspect shows what is wrong "
            "with them",
            code="no-log",
        )
    options, declaring = configuration.identification, configuration
    if all(log.gas_pressure is not None for own in evidence for log in own.fitted):
        declaring = replace(
            configuration, declared=configuration.declared | {"damper.gas_pressure"}
        )
    ends, adjusters = most_unlike(evidence), evidence[0].setting.adjusters
    extremes = tuple(logs for logs in evidence if logs.setting in ends)
    search = search_laws(
        _plain(configuration),
        _layouts(configuration, layout),
        evidence,
        follows=ties_of(configuration, adjusters),
        adjusted=ties_of(configuration, adjusters, is_adjusted=True),
        solver=options.solver,
        on_law=on_law,
        n_starts=options.starts,
        jobs=workers,
        is_tying=_is_tying(configuration),
        held_share=_held_share(extremes),
        held_by_some=_held_by_some(evidence),
    )
    rivals: tuple[Candidate, ...] = ()
    if on_rival is not None:
        rivals = rank_rivals(extremes, solver=options.solver, on_rival=on_rival, jobs=workers)
    fits = search.chosen.fits
    fitted, best = {fit.setting for fit in fits}, fits[0]
    is_open = is_monotube_open(declaring, search, layout)
    doubts = (
        *open_layout(configuration, best, layout, is_open=is_open),
        *open_dimensions(declaring, best),
    )
    return LawChoice(
        search,
        compared=tuple(own.setting for own in evidence),
        fits=fits,
        failures=tuple(batch.failures),
        lost=tuple(own.setting for own in evidence if own.setting not in fitted),
        rivals=rivals,
        remarks=(
            *batch.remarks,
            *assumed_gas(declaring, [law.candidate for law in search.laws]),
            *_tied_still(options.untied, best),
        ),
        undecided=(*doubts, *undecided(search, fits, evidence)),
        alike=(*doubts, *undecided(search, fits, evidence, has_parts_alone=True)),
        open_layouts=(Monotube.name,) if is_open else (),
        assumed=configuration.notes,
    )


def _tied_still(untied: Sequence[str], best: LawFit) -> Iterator[Problem]:
    """What was to be each setting's own, and is no part of the law."""
    if lost := [name for name in untied if name not in best.free]:
        text = f"{in_a_row(lost)} cannot be untied: the law that was chosen fits none of that name"
        yield Problem("nothing-to-untie", text)


def _is_tying(configuration: Configuration) -> bool:
    """Whether the logs say what follows an adjuster: unless they are declared."""
    is_declared = {"identification.procedure", "identification.share"} & configuration.declared
    followers = configuration.document["adjusters"].values()
    return not is_declared and not any(names for names in followers if not isinstance(names, str))


def with_chosen_law(configuration: Configuration, choice: LawChoice) -> Configuration:
    """Return the configuration with what was chosen: the damper, what is free, where to start.

    What somebody has asked for of quantities that the law does not have is left out.
    """
    best = choice.search.chosen.fits[0]
    made = replace(
        configuration,
        chosen_law=choice.document(),
        chosen_mse={fit.setting: fit.mse_percent for fit in choice.fits},
        log_offsets=choice.search.offsets,
    )
    is_declared = isinstance(best.model, Damper) and best.model == configuration.damper
    if is_declared and not _freed(best):
        return made
    adjusters = configuration.document["adjusters"]
    if lost := {*unmatched(adjusters, best.model)}:  # it follows no adjuster
        adjusters = {
            name: own if isinstance(own, str) else [n for n in own if n not in lost]
            for name, own in adjusters.items()
        }
    values = {fit.setting: asdict(fit.values) for fit in choice.fits}
    follows = followed(adjusters, best.model, is_law_open=True)
    options = _options_of(configuration, best)
    if choice.search.is_of_one_model:
        options = _tied(configuration, options, choice.search, is_adjusted=bool(follows))
    options = replace(
        options,
        follows=follows or options.follows,
        start=GivenStart(by_setting=values, is_of_one_model=choice.search.is_of_one_model),
        is_leaving_out=True,
    )
    made = made.with_damper(best.model, identification=options)
    own = made.document["identification"]
    own = {
        **own,
        "procedure": options.procedure,
        "free": list(options.free or ()),
        "fix": {name: value for name, value in own["fix"].items() if name in options.fixed},
        "share": own["share"] if options.share is None else list(options.share),
        "bulk_modulus": options.bulk_modulus,
    }
    # What stood at its default was not measured.
    chosen = {"damper.model", "damper.rebound", "damper.compression", "damper.mounting"}
    chosen |= {"damper.friction"}
    if isinstance(best.model, Damper) and "damper.gas_volume" in configuration.declared:
        chosen |= {f"damper.{name}" for name in GAS_LENGTHS}  # made of that volume
    if isinstance(best.model, ValveDamper) and isinstance(damper := configuration.damper, Damper):
        chosen |= {f"damper.{name}" for name in declared_dimensions(configuration, damper)}
    return replace(
        made,
        declared=configuration.declared | chosen,
        document={**made.document, "adjusters": adjusters, "identification": own},
        profile=tuple(name for name in made.profile if name in best.model.names),
    )


def _freed(fit: LawFit) -> tuple[str, ...]:
    """What a fit has free although the model would hold it."""
    return tuple(name for name in fit.free if fit.model.quantity(name).default is not None)


def _options_of(configuration: Configuration, best: LawFit) -> FitOptions:
    """What is fitted of the law that was taken, and how."""
    model, options = best.model, configuration.identification
    procedure = model.procedures[0]
    share: tuple[str, ...] | None = None
    if "identification.procedure" in configuration.declared:
        procedure = options.procedure if options.procedure in model.procedures else procedure
    if "identification.share" in configuration.declared or configuration.damper.name == model.name:
        share = options.share
    if share is not None and share != (DETECT,):
        share = tuple(name for name in share if name in model.names)
    options = replace(
        options,
        procedure=procedure,
        share=share,
        free=None,
        fixed={name: value for name, value in options.fixed.items() if name in model.names},
        bulk_modulus=options.bulk_modulus if options.bulk_modulus in model.bulk_moduli else "free",
        untied=tuple(name for name in options.untied if name in model.names),
    )
    if not _freed(best):
        return options
    shared: tuple[str, ...] = ()
    if procedure == "paper":
        shared = shared_names(replace(options, share=None), model)
    elif procedure == "joint" and not options.is_detecting:
        shared = shared_names(options, model)
    return replace(options, free=tuple(name for name in best.free if name not in shared))


def _tied(
    configuration: Configuration, options: FitOptions, search: LawSearch, *, is_adjusted: bool
) -> FitOptions:
    """What is fitted of a structure that was chosen at all settings together, as it was chosen."""
    if "identification.procedure" in configuration.declared:
        return options
    if is_adjusted:  # what follows an adjuster is passed on beside this
        return replace(options, procedure="joint")
    best, follows = search.chosen.fits[0], search.follows
    adjusters = best.setting.adjusters
    own = tuple(name for name in best.free if follows.get(name) == adjusters)
    tied = {name: a for name, a in follows.items() if name not in own}
    return replace(
        options,
        procedure="joint",
        share=tuple(name for name in best.free if name not in own),
        free=own,
        follows=tied,
    )


def _evidence(
    batch: LogBatch, start: GivenStart, fixed: Mapping[str, float]
) -> tuple[SettingLogs, ...]:
    settings = {trace.setting for trace in batch.traces if trace.setting is not None}
    return tuple(
        SettingLogs(
            setting,
            tuple(trace for trace in batch.traces if trace.setting == setting),
            tuple(trace for trace in batch.held_out if trace.setting == setting),
            start.of(setting),
            fixed,
        )
        for setting in sorted(settings)
    )


def _held_share(evidence: Sequence[SettingLogs]) -> float:
    """Return the share of the force that all logs hold at low speed where they yield; else NaN."""
    # Every setting has to: valves hold more of it the more they are preloaded.
    shares = [held_share(log) for logs in evidence for log in logs.fitted]
    least = min((share for share in shares if math.isfinite(share)), default=math.nan)
    return least if least >= YIELDS else math.nan


def _held_by_some(evidence: Sequence[SettingLogs]) -> float:
    """The most that a setting holds in all of its logs; NaN where none yields."""
    shares = [_held_share([logs]) for logs in evidence]
    return max((share for share in shares if math.isfinite(share)), default=math.nan)


def _plain(configuration: Configuration) -> Model:
    """The damper that laws of valves must beat: the paper's, unless another model is declared."""
    damper = configuration.damper
    if not isinstance(damper, ValveDamper) or "damper.model" in configuration.declared:
        return damper
    paper = Damper()
    own = {field.name for field in fields(paper) if field.init}
    if "damper.ambient_pressure" not in configuration.declared:
        own.discard("ambient_pressure")  # its equation leaves the air out
    taken = {name: getattr(damper, name) for name in own if hasattr(damper, name)}
    length = damper.gas_volume / (0.25 * math.pi * paper.gas_piston_diameter**2)
    low, high, _ = paper.ranges["gas_length"]
    if not low <= length <= high:  # the volume is what counts
        length = min(max(length, low), high)
        taken["gas_piston_diameter"] = math.sqrt(4.0 * damper.gas_volume / (math.pi * length))
    return replace(paper, **taken, gas_length=length)


def _layouts(configuration: Configuration, layout: str | None) -> list[ValveDamper]:
    """The damper in each layout that it may have."""
    damper = configuration.damper
    if not isinstance(damper, Damper | ValveDamper):
        raise ConfigurationError(
            f"models: damper.model = {damper.name} has no geometry from which to build a "
            "layout; declare [damper] for the paper's model or for real valves",
            code="no-geometry",
        )
    if layout is None and "damper.model" in configuration.declared and damper.name in LAYOUTS:
        layout = damper.name
    kinds = LAYOUTS if layout is None else {layout: LAYOUTS[layout]}
    declared = declared_dimensions(configuration, damper)
    return [kind(**declared) for kind in kinds.values()]
