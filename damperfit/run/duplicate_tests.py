"""Logs of one setting beside each other: copies count once, contradictions cost their setting."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.conditioning.duplicates import (
    REPEATS,
    contradiction,
    copies_in,
    is_same_test,
    rod_area_ratio,
)
from damperfit.errors import ContradictionError
from damperfit.identification.unlike_motions import contradictory_motions
from damperfit.problem import Failure, Option, Problem, listed_names

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model
    from damperfit.recording import Trace
    from damperfit.run.logs import LogBatch
    from damperfit.tested.setting import Setting


_MANY = 20
_OFF = 0.05  # an area of the rod that is further off is another's


def once_each(batch: LogBatch) -> LogBatch:
    """Return the batch with each test once; a test under two settings is a failure of both."""
    copies = copies_in(batch.traces, {log.log: log.path for log in batch.logs})
    again = {id(copy) for several in copies.values() for copy in several}
    firsts = {one.name: one for one in batch.traces if id(one) not in again}
    bad = {
        name: others
        for name, several in copies.items()
        if (others := [one for one in several if one.setting != firsts[name].setting])
    }
    failures = []
    for name, others in bad.items():
        tests = [f"{one.name} setting {one.setting}" for one in (firsts[name], *others)]
        said = (
            f"the same test under several settings: {listed_names(tests)}; check which is right "
            "and leave out the rest"
        )
        failures.append(Failure(Problem("two-settings", said), ContradictionError.__name__))
    said_of_copies = _copies_in_words({k: v for k, v in copies.items() if k not in bad})
    return replace(
        batch,
        traces=tuple(one for name, one in firsts.items() if name not in bad),
        failures=(*batch.failures, *failures),
        remarks=(*batch.remarks, *said_of_copies),
    )


def _copies_in_words(copies: Mapping[str, Sequence[Trace]]) -> Iterator[str]:
    for first, several in list(copies.items())[:_MANY]:
        n = len(several) - 1
        others = f" and {n} other log{'s' * (n > 1)}" if n else ""
        yield f"{several[0].name}{others}: the same test as {first}; it counts once"
    if len(copies) > _MANY:
        yield f"and so do {len(copies) - _MANY} other tests that were given several times"


def without_copies(
    batch: LogBatch, held_out: Sequence[Trace]
) -> tuple[LogBatch, tuple[Trace, ...]]:
    """Return the batch, and what is held out without the tests that are fitted by another name."""
    kept, said = [], []
    for trace in held_out:
        others = (one for one in batch.traces if one.name != trace.name)
        first = next((one for one in others if is_same_test(one, trace)), None)
        if first is None:
            kept.append(trace)
        else:
            said.append(
                f"{trace.name}: the same test as {first.name}, which is fitted; it is not held out"
            )
    return replace(batch, remarks=(*batch.remarks, *said)), tuple(kept)


def without_contradictions(
    batch: LogBatch, *, is_averaging: bool, is_warmed: bool = False
) -> LogBatch:
    """Return the batch without the settings whose logs contradict each other, which fail.

    Parameters
    ----------
    batch : LogBatch
        What was read.
    is_averaging : bool
        Such logs are to be fitted together all the same; then it is only said.
    is_warmed : bool
        What temperature does is fitted: logs of different temperatures may differ.
    """
    worst = {
        setting: found
        for setting, traces in _by_setting(batch).items()
        if (found := contradiction(traces, is_warmed=is_warmed))
    }
    together = (
        f"setting {setting}: {found.sentence}; fitted together, as one damper repeats within "
        f"{100.0 * REPEATS:g} %: leave one out if the setting or the damper differs"
        for setting, found in worst.items()
        if found.excess <= 1.0
    )
    batch = replace(batch, remarks=(*batch.remarks, *together))
    said = {setting: one.sentence for setting, one in worst.items() if one.excess > 1.0}
    return _contradicting(batch, said, is_averaging=is_averaging)


def without_contradictory_motions(batch: LogBatch, configuration: Configuration) -> LogBatch:
    """Return the batch without the settings whose logs of other motions contradict each other.

    Parameters
    ----------
    batch : LogBatch
        What was read; logs of one motion have been compared.
    configuration : Configuration
        The model, how it is fitted, and whether such logs are averaged.
    """
    said = {
        setting: sentence
        for setting, traces in _by_setting(batch).items()
        if (
            sentence := contradictory_motions(
                traces, configuration.damper, configuration.identification
            )
        )
    }
    return _contradicting(batch, said, is_averaging=configuration.rig.is_averaging)


def _by_setting(batch: LogBatch) -> dict[Setting, list[Trace]]:
    groups: dict[Setting, list[Trace]] = defaultdict(list)
    for trace in batch.traces:
        if trace.setting is not None:
            groups[trace.setting].append(trace)
    return groups


def _contradicting(
    batch: LogBatch, sentences: Mapping[Setting, str], *, is_averaging: bool
) -> LogBatch:
    """Return the batch without these settings, which fail, or with a word on them."""
    if is_averaging:
        said = (f"setting {one}: {sentence}; averaged" for one, sentence in sentences.items())
        return replace(batch, remarks=(*batch.remarks, *said))
    failures = [
        Failure(
            Problem(
                "logs-differ",
                "{sentence}, more than their scatter; check whether the setting or the damper "
                "differs, leave one out, or fit them together by {average}",
                subject=f"setting {setting}",
                values={
                    "sentence": sentence,
                    "average": Option("rig", "average", "contradictions"),
                },
            ),
            ContradictionError.__name__,
            setting=setting,
        )
        for setting, sentence in sentences.items()
    ]
    kept = tuple(trace for trace in batch.traces if trace.setting not in sentences)
    return replace(batch, traces=kept, failures=(*batch.failures, *failures))


def with_rod_remark(batch: LogBatch, damper: Model) -> LogBatch:
    """Return the batch with a word where the pressures tell of another rod than is declared."""
    ratio = rod_area_ratio(batch.traces, damper)
    if ratio is None or abs(ratio - 1.0) <= _OFF:
        return batch
    said = (
        "the level of the force over the gas pressures of the tests corresponds to a rod of "
        f"{ratio:.3g} times the declared area: check rod_diameter, the pressures, and whether the "
        "force was tared between the tests"
    )
    return replace(batch, remarks=(*batch.remarks, said))
