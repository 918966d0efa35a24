"""Which structure the logs support: one search over one fit of all settings.

    1  the paper's model, setting by setting; it is taken where it leaves less than
       `ENOUGH_PERCENT`
    2  bleed and blow-off in each stroke on everything that a mounting may have, in each layout,
       from each setting's own loops and from each other's; then all settings in one fit, with one
       value for what is the damper's or the rig's
    3  from the best layout on, moves of one part (`structures.moves`): each is started from the
       structure at hand and from the loops, screened in a few evaluations, the best four are
       followed to their minimum, and the best by the criterion is taken, until none is better
    4  the parts in the other layouts; models that yield, where the logs do (before the moves, too:
       where these fit far better there are none); the paper's model again

Structures are compared by the `criterion`, fitted as `structure_fits` does.

What is neither the damper's nor the rig's is each setting's own, until the logs bear out that it
follows one adjuster, or none (`LinearisedTies`): before parts are removed, for they may be worth
their numbers where these are fewer.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from damperfit.damper.model import Model
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.errors import SimulationError
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.identification.logs import compare, effective_samples
from damperfit.identification.sharing import Follows
from damperfit.laws.criterion import ONE, Criterion, LinearisedTies
from damperfit.laws.law_fit import (
    GAIN,
    SEEN_APART,
    YIELDING,
    Candidate,
    ComparedCandidate,
    Exchange,
    LawSearch,
    SettingLogs,
    are_alike,
    held_against,
    is_open_to,
    most_unlike,
    times_worse,
    unbelievable,
)
from damperfit.laws.structure_fits import END, LOOK, StructureFit, StructureFits
from damperfit.laws.structures import (
    BOTH,
    Structure,
    everything,
    exchanges,
    moves,
    with_part,
)
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting

# Settings that moves are screened at; the chosen structure is fitted at all.
_MOST_COMPARED = 5
# Candidates that are followed to their minimum after each screening.
_FOLLOWED = 4
# One that promised so many times a margin to be worse is not screened again.
_HOPELESS = 4.0
# Candidates that are looked at beside all settings, of those that two settings show.
_LOOKED_AT = 8
_ROUNDS = 20
# The first fit of a layout that did so many times worse is not followed up.
_FAR_WORSE = 8.0
# Two predictions this near each other differ by noise.
_NO_WORSE = 1.1


class _Search:
    """What has been tried, and what is to be said of the structure that is taken."""

    def __init__(self, fits: StructureFits, on_law: Callable[[ComparedCandidate], None]) -> None:
        self.fits, self.criterion, self.on_law = fits, Criterion(fits), on_law
        self.alike: tuple[str, ...] = ()
        self.fits_alike: list[StructureFit] = []
        self.first_layouts: dict[str, float] = {}
        self.held_share, self.is_held_by_some = math.nan, False
        self.also, self.doubt = "", ""
        self.compared = self.most_unlike(fits.evidence, _MOST_COMPARED)
        self.laws: list[ComparedCandidate] = []
        self.followed_up: list[StructureFit] = []
        self.spread: dict[Setting, dict[str, float]] = {}
        self._yielding: list[Candidate] | None = None

    def most_unlike(self, settings: Iterable[Setting], most: int = 2) -> list[Setting]:
        """Settings to compare at."""
        return most_unlike([self.fits.evidence[s] for s in settings], most)

    # moves

    def improved(self, fit: StructureFit) -> StructureFit:
        """Take moves until none is better by the criterion.

        First those that add or replace: a part is missed where another one's absence hides it.
        Of them those that were near a gain when they were last screened, and were not refused since
        the structure grew; then those that remove; when these gain nothing either, all the others.
        """
        rises: dict[str, float] = {}  # by move, when it was last screened
        refused = set[str]()
        for _ in range(_ROUNDS):
            may_gain = self.criterion.may_gain
            additions = {w: c for w, c in moves(fit.structure).items() if may_gain(c, fit)}
            size, margin = len(fit.structure.free), self.criterion.margin(fit)
            smaller = [words for words, c in additions.items() if len(c.free) < size]
            removals = {words: additions.pop(words) for words in smaller}
            near = {w for w in additions if w not in refused and rises.get(w, 0.0) <= margin}
            hopeful = {w for w in additions if rises.get(w, 0.0) <= _HOPELESS * margin}
            better = self.followed(fit, additions, near, rises) or self.with_ties(fit)
            if better is not None:
                refused.clear()
            elif (better := self.followed(fit, removals, {*removals}, rises)) is not None:
                refused |= near
            elif (better := self.followed(fit, additions, hopeful - near, rises)) is not None:
                refused.clear()
            else:
                break
            fit = better
        self.spread = self.criterion.spread(fit, self.followed_up)
        return fit

    def followed(
        self,
        fit: StructureFit,
        structures: Mapping[str, Structure],
        which: set[str],
        rises: dict[str, float],
    ) -> StructureFit | None:
        """The best of some candidates that screening puts first, at its minimum; None: no better.

        What is better beside the best is tried on top of it.
        """
        criterion, margin = self.criterion.of, self.criterion.margin(fit)
        began: Mapping[str, str] = {}
        candidates = {words: structure for words, structure in structures.items() if words in which}
        pair = self.most_unlike(fit.values)
        if len(fit.values) > len(pair) and candidates:
            few = self.screened(candidates, self.fits.at(fit, pair, ONE), fit, {})
            rises |= {words: rise for rise, words, _ in few}
            began = {w: g.began for rise, w, g in few[:_LOOKED_AT] if rise <= margin}
            candidates = {words: candidates[words] for words in began}
        screened = self.screened(candidates, fit, fit, began)
        rises |= {words: rise for rise, words, _ in screened}
        ends = []
        for rise, words, glance in screened[:_FOLLOWED]:
            if rise > margin:
                break
            if (minimum := self.candidate(glance, fit, words)) is not None:
                ends.append((criterion(minimum), words, minimum))
        ends = sorted(ends, key=lambda end: end[0])
        before = criterion(fit)
        if not ends or ends[0][0] >= before - 1e-6:
            return None
        best = ends[0][2]
        for cost, words, _ in ends[1:]:
            again = moves(best.structure).get(words) if cost < before else None
            begun = None if again is None else self.fits.glanced(again, best)
            minimum = None if begun is None else self.candidate(begun, best, words)
            if minimum is not None and criterion(minimum) < criterion(best) - 1e-6:
                best = minimum
        return best

    def candidate(
        self, glance: StructureFit, beside: StructureFit, words: str
    ) -> StructureFit | None:
        """A candidate followed to its minimum, and kept with what it gains."""
        try:
            minimum = self.fits.settled(glance)
            gain = self.criterion.of(beside) - self.criterion.of(minimum)
        except SimulationError:
            return None
        self.record(minimum, beside, words, gain, is_taken=gain > 1e-6)
        self.followed_up.append(minimum)
        return minimum

    def screened(
        self,
        candidates: Mapping[str, Structure],
        near: StructureFit,
        fit: StructureFit,
        began: Mapping[str, str],
    ) -> list[tuple[float, str, StructureFit]]:
        """By how much the criterion of each promises to rise above that of a fit.

        All after a few evaluations beside the fit, which may be at fewer settings, the first of
        them after some more.
        """
        glances: list[tuple[float, str, StructureFit]] = []
        rises: dict[ValveDamper, float] = {}
        for words, structure in candidates.items():
            halves = [rises[d] for d in structure.strokes_beside(fit.structure) if d in rises]
            if min(halves, default=-math.inf) > self.criterion.margin(fit):
                continue  # what neither stroke gains both do not
            glance = self.fits.glanced(structure, near, began.get(words, ""))
            if glance is not None:
                glances.append((self.criterion.rise(glance, near, fit), words, glance))
                rises[structure.damper] = glances[-1][0]
        glances.sort(key=lambda item: item[0])
        for k, (rise, words, glance) in enumerate(glances[:_LOOKED_AT]):
            if rise <= 0.0 and glance.minimum.status == 0:
                minimum = glance.model.minimise(glance.values, LOOK)
                again = replace(glance, minimum=minimum)
                glances[k] = (self.criterion.rise(again, near, fit), words, again)
        return sorted(glances, key=lambda item: item[0])

    def record(
        self, fit: StructureFit, beside: StructureFit, words: str, gain: float, *, is_taken: bool
    ) -> None:
        """Keep a candidate, and say it to who waits for it."""
        tried, other = self.fits.candidate(fit), self.fits.candidate(beside)
        is_larger = len(fit.model.border) >= len(beside.model.border)
        small, large = (other, tried) if is_larger else (tried, other)
        moved = f"MSE {other.mse_percent:.2g} to {tried.mse_percent:.2g} %"
        held = other.held_out_percent, tried.held_out_percent
        if not math.isnan(held[1]):
            moved += f", held out {held[0]:.2g} to {held[1]:.2g} %"
        self.keep(
            tried, f"{moved}; criterion {'lower' if gain > 0.0 else 'higher'} by {abs(gain):.0f}",
            is_taken=is_taken, change=words, bic=gain if is_larger else -gain,
            gain=small.mse_percent / max(large.mse_percent, 1e-300),
        )  # fmt: skip

    def keep(
        self, tried: Candidate, reason: str, *, is_taken: bool, change: str = "", **figures: float
    ) -> None:
        """Keep what was compared with another than its neighbour."""
        self.laws.append(ComparedCandidate(tried, is_taken, reason, change=change, **figures))
        self.on_law(self.laws[-1])

    # layouts

    def best_layout(self, layouts: Sequence[ValveDamper]) -> StructureFit | None:
        """Bleed and blow-off in each stroke and everything that a mounting may have."""
        fits: list[StructureFit] = []
        pair = self.most_unlike(self.compared)
        for layout in layouts:
            whole = replace(
                layout, rebound=BOTH, compression=BOTH, mounting=everything(layout.mounting)
            )
            with suppress(SimulationError):
                fits.append(self.fits.first(Structure(whole), pair))
        if not fits:
            return None
        tried = [self.fits.candidate(fit) for fit in fits]
        best = min(tried, key=lambda candidate: candidate.score)
        near = []
        for fit, candidate in zip(fits, tried, strict=True):
            times = times_worse(best, candidate)
            self.first_layouts[fit.structure.damper.name] = times
            is_alone, is_near = len(fits) == 1, times < SEEN_APART
            reason = _of_layout(best, candidate, is_alone=is_alone, is_near=is_near)
            self.keep(candidate, reason, is_taken=candidate is best, change="layout")
            near += [fit] if is_near else []
        near = [self.fits.extended(fit, self.compared) for fit in near]
        taken = min(near, key=lambda fit: self.fits.candidate(fit).score)
        for law in self.fits.candidate(taken).fits:  # the effective samples of what it leaves
            fitted = self.fits.evidence[law.setting].fitted
            segments = [segment for trace in fitted for segment in trace.segments]
            self.criterion.n_eff[law.setting] = sum(
                effective_samples(rest, max(x.n_cycles, 1))
                for rest, x in zip(law.residuals, segments, strict=True)
            )
        return taken

    def in_its_layout(
        self, fit: StructureFit, layouts: Sequence[ValveDamper], *, is_again: bool = False
    ) -> StructureFit:
        """The parts that were found in the other layouts: those that do as well are alike.

        Where another layout is taken, moves from there, and once more the other layouts.
        """
        law = self.fits.candidate(fit)
        tried = {law: fit}
        for layout in layouts:
            is_far = self.first_layouts.get(layout.name, math.inf) > _FAR_WORSE
            if layout.name != fit.structure.damper.name and not is_far:
                with suppress(SimulationError):
                    other = self.fits.laid_out(fit, layout)
                    tried[self.fits.candidate(other)] = other
        best = min(tried, key=lambda candidate: candidate.score)
        best = law if are_alike(best, law) else best
        near = [tried[c] for c in tried if c is best or are_alike(best, c)]
        for candidate, other in [*tried.items()][1:]:
            reason = _of_layout(best, candidate, is_alone=False, is_near=other in near)
            self.keep(candidate, reason, is_taken=candidate is best, change="layout")
        # Of layouts that do as well, that which takes the least for it.
        taken = min(near, key=self.criterion.of)
        self.fits_alike = [other for other in near if other is not taken]
        self.alike = tuple(other.structure.damper.name for other in self.fits_alike)
        if taken is fit or is_again:
            return taken
        return self.in_its_layout(self.improved(taken), layouts, is_again=True)

    # ties

    def with_ties(self, fit: StructureFit) -> StructureFit | None:
        """The fit with other ties, if the criterion is lower; None where it is not."""
        setting = fit.model.settings[0]
        if not self.fits.may_tie or len(fit.values) < 2:
            return None
        ways = [(), *((name,) for name, _ in setting.evident if len(setting.evident) > 1)]
        linear = LinearisedTies(self.criterion, fit)
        steps = linear.better(dict(fit.structure.ties), [*ways, setting.adjusters])
        for ties in (steps[-1], steps[0]) if len(steps) > 1 else steps:
            structure = replace(fit.structure, ties=tuple(sorted(ties.items())))
            model = self.fits.model(structure, fit.model.settings)
            model = replace(model, weights=fit.model.weights)
            try:
                first = model.minimise(model.with_common(linear.values(ties)), END)
                tied = self.fits.minimised(structure, model, first.extra.values)
                gain = self.criterion.of(fit) - self.criterion.of(tied)
            except SimulationError:
                continue
            self.record(tied, fit, "with other ties", gain, is_taken=gain > 0.0)
            if gain > 0.0:
                return tied
        return None

    def tied(
        self, fit: StructureFit, follows: Callable[[Model, Sequence[str]], Follows]
    ) -> StructureFit:
        """The structure with what settings have in common by their adjusters; and moves from there.

        Only then: beside valves that are tied wrongly every other part would be chosen for them.
        """
        fits, before, settings = self.fits, fit.model, fit.model.settings
        fits.follows = follows
        if fits.model(fit.structure, settings).border == before.border:
            return fit
        candidates = []
        for near in (fit, *self.fits_alike):
            with suppress(SimulationError):
                whole = fits.extended(near, settings)
                model = fits.model(whole.structure, settings)
                candidates.append(fits.from_single(whole.structure, model, whole.values))
                # A part that single settings do without may be what all of them need.
                damper = replace(near.structure.damper, rebound=BOTH, compression=BOTH)
                candidates.append(fits.first(Structure(damper, near.structure.freed), settings))
        best = min(candidates, key=self.criterion.of, default=fit)
        names = [near.structure.damper.name for near in (fit, *self.fits_alike)]
        self.alike = tuple(name for name in names if name != best.structure.damper.name)
        return self.improved(best)

    def at_all(self, fit: StructureFit) -> StructureFit:
        """The structure at every setting."""
        n_eff = self.criterion.n_eff
        usual = float(np.median([*n_eff.values()]))
        for setting in self.fits.evidence:
            n_eff.setdefault(setting, usual)
        return self.fits.extended(fit, list(self.fits.evidence))

    # against what is no candidate of the search

    def simplest(self, plain: Model) -> Candidate | None:
        """The model as declared, setting by setting, at the weakest and the strongest force.

        Its offset is free where the model leaves something without.
        """
        offsets = tuple(q.name for q in plain.quantities if q.is_offset and q.default is not None)
        ends = self.most_unlike(self.fits.evidence)
        tried = self.fits.separately(plain, ends)
        if offsets and (tried is None or tried.leaves_something):
            tried = self.fits.separately(plain, ends, freed=offsets)
        return tried

    def held_against_paper(self, simplest: Candidate, fit: StructureFit) -> Candidate:
        """The paper's model where the valves are not worth their numbers."""
        settings = [result.setting for result in simplest.fits]
        law = self.fits.candidate(fit)
        beside = Candidate(law.title, tuple(r for r in law.fits if r.setting in settings))
        more = len(law.fits[0].free) - len(simplest.fits[0].free)
        n = sum(self.criterion.n_eff.values())
        gain = simplest.mse_percent / max(beside.mse_percent, 1e-300)
        bic = n * math.log(gain) - more * len(law.fits) * math.log(n)
        is_worse = beside.held_out_percent > _NO_WORSE * simplest.held_out_percent
        is_taken = gain < GAIN or bic <= 0.0 or is_worse
        if more <= 0:
            is_taken = simplest.score < beside.score
        reason = f"MSE {simplest.mse_percent:.2g} to {beside.mse_percent:.2g} % with valves"
        self.keep(simplest, reason, is_taken=is_taken, change="smallest law", bic=bic, gain=gain)
        if is_taken:
            self.alike = ()
        return simplest if is_taken else law

    def held_against_declared(self, fit: StructureFit, declared: ValveDamper) -> StructureFit:
        """The valves as declared, where they do as well."""
        try:
            other = self.fits.first(Structure(declared), self.compared)
        except SimulationError:
            return fit
        gain = self.criterion.of(fit) - self.criterion.of(other)
        self.record(other, fit, "as declared", gain, is_taken=gain > 0.0)
        return other if gain > 0.0 else fit

    def beside_yielding(self, law: Candidate) -> tuple[Candidate, list[Candidate]]:
        """A law at the weakest and the strongest force, and there the models that yield."""
        ends = self.most_unlike(self.fits.evidence)
        if self._yielding is None:
            tried = (self.fits.separately(kind(), ends) for kind in YIELDING)
            self._yielding = [candidate for candidate in tried if candidate is not None]
        fits = tuple(result for result in law.fits if result.setting in ends)
        return Candidate(law.title, fits), self._yielding

    def is_hopeless(self, fit: StructureFit) -> bool:
        """Whether what yields fits and predicts far better than every part of valves together.

        Friction that builds up over a distance yields as well: valves are given up only beside it.
        """

        def is_far(fit: StructureFit) -> bool:
            beside, others = self.beside_yielding(self.fits.candidate(fit))
            return any(times_worse(other, beside) > _FAR_WORSE for other in others)

        if not is_far(fit):
            return False
        sliding = Structure(with_part(fit.structure.damper, "presliding"))
        with suppress(SimulationError):
            if (glance := self.fits.glanced(sliding, fit)) is not None:
                return is_far(self.fits.settled(glance))
        return True

    def yielding(self, law: Candidate, share: float, by_some: float) -> Candidate:
        """A model that yields before it slides, where the logs do and valves fit them less well."""
        is_unasked = math.isnan(share) and not math.isnan(by_some)
        if is_unasked and (law.leaves_something or unbelievable(law)):
            share, self.is_held_by_some = by_some, True
        self.held_share = share
        if math.isnan(share):
            return law
        beside, others = self.beside_yielding(law)
        best = min(others, key=lambda other: other.score, default=beside)
        taken = law
        for other in others:
            is_better, reason = held_against(beside, other, share)
            taken = other if is_better and other is best else taken
            self.keep(other, reason, is_taken=is_better and other is best, change="what yields")
        if taken is not law:
            self.alike = ()
        elif others and is_open_to(beside, best):
            self.also = best.title
        else:
            self.doubt = unbelievable(beside)
        return taken

    def result(self, chosen: Candidate, fit: StructureFit | None = None) -> LawSearch:
        """What was tried, and the structure to take, at every setting."""
        is_of_one_model = fit is not None and chosen is self.fits.candidate(fit)
        whole: Candidate | None = chosen
        if not is_of_one_model:
            model, every = chosen.fits[0].model, list(self.fits.evidence)
            free, separately = chosen.freed, self.fits.separately
            whole = separately(model, every, freed=free, near=chosen, is_whole=True)
        whole = whole or chosen
        laws = [replace(law, is_taken=False) for law in self.laws if law.candidate is not chosen]
        first = ComparedCandidate(whole, True, "the lowest criterion of all settings together")
        *_, last = (first, *(law for law in self.laws if law.candidate is chosen))
        laws.append(replace(last, candidate=whole, is_taken=True))
        n_eff = float(sum(self.criterion.n_eff.values())) or math.nan
        search = LawSearch(
            tuple(laws), whole, n_eff, self.alike, self.held_share, self.also,
            is_held_by_some=self.is_held_by_some, doubt=self.doubt,
        )  # fmt: skip
        if fit is None or not is_of_one_model:
            return search
        return replace(
            search, is_of_one_model=True, follows=fit.model.follows, offsets=self.offsets(whole),
            exchanges=tuple(self.exchanged(fit)), spread=self.spread,
        )  # fmt: skip

    def exchanged(self, fit: StructureFit) -> Iterator[Exchange]:
        """Yield what one part in place of another fits about as well."""
        for part, instead, structure in exchanges(fit.structure):
            glance = self.fits.glanced(structure, fit)
            if glance is None or glance.promised > GAIN * fit.minimum.cost:
                continue
            with suppress(SimulationError):
                other = self.fits.settled(glance)
                if (times := self.criterion.times_misfit(fit, other)) < GAIN:
                    yield Exchange(part, instead, times, other.values)

    def offsets(self, law: Candidate) -> dict[str, float]:
        """By how much each log's offset lies beside the mean one of its setting."""
        beside: dict[str, float] = {}
        for fit in law.fits:
            logs = self.fits.evidence[fit.setting].fitted
            if len(logs) < 2 or not any(fit.model.quantity(n).is_offset for n in fit.free):
                continue
            missing = {}
            for log in logs:
                model = compare(fit.values, log, fit.model, solver=self.fits.solver)
                missing[log.name] = float(np.mean((log.force - model.force)[log.compared]))
            mean = float(np.mean([*missing.values()]))
            beside |= {name: own - mean for name, own in missing.items()}
        return beside


def _of_layout(best: Candidate, candidate: Candidate, *, is_alone: bool, is_near: bool) -> str:
    """Say why a layout is taken, or is not, beside the best."""
    what = "fits" if math.isnan(best.held_out_percent) else "fits and predicts"
    if is_alone:
        return "the only layout that was tried"
    if candidate is best:
        return f"the layout that {what} best"
    words = best.fits[0].model.name.replace("_", " ")
    return f"{words} {what} {'hardly ' if is_near else ''}better"


def follows_by_scope(model: Model, free: Sequence[str], adjusters: tuple[str, ...]) -> Follows:
    """Return what each quantity follows: all adjusters, unless it is the damper's or the rig's."""
    of = {name: model.quantity(name) for name in free}
    return {name: adjusters for name, q in of.items() if q.is_offset or not q.is_shared}


@one_blas_thread()
def search_laws(  # noqa: PLR0913 - what a user may ask of it
    plain: Model,
    layouts: Sequence[ValveDamper],
    evidence: Sequence[SettingLogs],
    *,
    follows: Callable[[Model, Sequence[str]], Follows] | None = None,
    adjusted: Callable[[Model, Sequence[str]], Follows] | None = None,
    solver: SolverOptions = SolverOptions(),
    on_law: Callable[[ComparedCandidate], None] = lambda _: None,
    n_starts: int = 1,
    jobs: int = 1,
    held_share: float = math.nan,
    held_by_some: float = math.nan,
    is_tying: bool = False,
) -> LawSearch:
    """Return which structure the logs of all settings support, fitted at all of them.

    `plain` is the paper's damper, or one of valves as it is declared, `layouts` the damper in each
    layout that it may have. `follows` gives from a model and what is free the adjusters that each
    quantity follows: by default all of them, but none for what is the damper's or the rig's;
    `adjusted` does where adjusters are declared, and what was found is fitted so at the end.
    `on_law` is called with every structure that was compared. `n_starts` are those of the first fit
    at each setting, spread over a factor of ten to both sides. The result does not depend on the
    workers, `jobs`. `held_share` is what the logs hold of their force down to a tenth of the speed,
    where they yield before they slide, else NaN; `held_by_some` the most that one holds, where not
    all of them yield: asked where valves leave something. A `SimulationError`: no structure can be
    simulated on these logs.
    """
    adjusters = min(logs.setting for logs in evidence).adjusters

    def by_scope(model: Model, free: Sequence[str]) -> Follows:
        return follows_by_scope(model, free, adjusters)

    by_setting = {x.setting: x for x in sorted(evidence, key=lambda logs: logs.setting)}
    may_tie = follows is None or is_tying
    fits = StructureFits(by_setting, follows or by_scope, solver, n_starts, jobs, may_tie)
    search = _Search(fits, on_law)
    simplest = search.simplest(plain)
    has_valves = isinstance(plain, ValveDamper)
    if simplest is not None and not has_valves and not simplest.leaves_something:
        search.keep(simplest, "its misfit is too small to matter", is_taken=True)
        return search.result(simplest)
    fit = search.best_layout(layouts)
    if fit is None:
        if simplest is None:
            raise SimulationError(
                "no structure can be simulated on these logs.", code="not-integrated"
            )
        search.keep(simplest, "no other can be simulated on these logs", is_taken=True)
        return search.result(simplest)
    if math.isnan(held_share) or not search.is_hopeless(fit):
        fit = search.improved(fit)
        if isinstance(plain, ValveDamper):
            fit = search.held_against_declared(fit, plain)
        fit = search.at_all(search.in_its_layout(fit, layouts))
        if adjusted is not None:
            fit = search.tied(fit, adjusted)
    chosen = search.fits.candidate(fit)
    if simplest is not None and not has_valves:
        chosen = search.held_against_paper(simplest, fit)
    return search.result(search.yielding(chosen, held_share, held_by_some), fit)
