"""Everything that one call of `compare` compares: which pairs, at what motion, by what measure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.adjustment.motions import Sine
from damperfit.comparison import (
    ComparisonOptions,
    RunComparison,
    bands_met,
    compare_runs,
    parse_tolerance,
    read_bands,
    tolerated,
)
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.problem import Option
from damperfit.queries.runs_to_compare import (
    LogRuns,
    Pair,
    holds_runs,
    pairs_of,
    read_run,
    runs_of_logs,
    with_distinct_names,
)
from damperfit.units.quantities import parse_quantity
from damperfit.units.shown_units import SI, parse_units

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.comparison import ComparedRun, Point, Tolerance
    from damperfit.configuration.options import Configuration

__all__ = ["Compared", "compare_all", "comparison_options", "one_run", "parse_bands"]


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """What was compared.

    Attributes
    ----------
    comparisons : tuple of RunComparison
        One a pair.
    alone : tuple of str
        What has no partner.
    remarks : tuple of str
        What is missing or damaged in the runs, or could not be compared.
    points : tuple of Point
        Forces held against their bands, where a tolerance was given.
    """

    comparisons: tuple[RunComparison, ...]
    alone: tuple[str, ...]
    remarks: tuple[str, ...]
    points: tuple[Point, ...] = ()


def comparison_options(
    *,
    velocities: Sequence[str | float] = (),
    amplitude: str | float | None = None,
    frequency: str | float | None = None,
    is_measured: bool = False,
    jobs: int = 1,
    units: str | None = None,
) -> ComparisonOptions:
    """Return what the texts of a command line ask.

    Raises
    ------
    ConfigurationError
        A quantity cannot be understood, or amplitude and frequency do not go together.
    """
    read = partial(parse_quantity, option="--velocity")
    speeds = sorted({abs(read(text, "velocity")) for text in velocities})
    if speeds and speeds[0] == 0.0:
        raise ConfigurationError("expected a speed other than zero", where=Option("velocity", "0"))
    if (amplitude is None) != (frequency is None):
        raise ConfigurationError(
            "{amplitude} and {frequency} make the sine together; give both or neither",
            amplitude=Option("amplitude"),
            frequency=Option("frequency"),
        )
    sine = None
    if amplitude is not None and frequency is not None:
        if is_measured:
            raise ConfigurationError(
                "{amplitude} cannot be combined with {measured}: measured forces are "
                "of the motions that were run; leave one of the two out",
                amplitude=Option("amplitude", amplitude),
                measured=Option("measured"),
            )
        sine = Sine(
            parse_quantity(amplitude, "length", option="--amplitude"),
            parse_quantity(frequency, "frequency", option="--frequency"),
        )
        for option, value in (("--amplitude", sine.amplitude), ("--frequency", sine.frequency)):
            if value <= 0.0:
                raise ConfigurationError(f"{option} {value:g}: expected more than 0")
    return ComparisonOptions(
        sine, tuple(speeds), is_measured, jobs, SI if units is None else parse_units(units)
    )


def compare_all(
    paths: Sequence[Path],
    options: ComparisonOptions,
    *,
    repeats: Sequence[Path] = (),
    tolerance: Tolerance | None = None,
    config: Path | None = None,
    reading: Configuration | None = None,
) -> Compared:
    """Return every pair compared.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        Runs, or folders of several; the first is the reference.
    options : ComparisonOptions
        What is compared.
    repeats : sequence of pathlib.Path
        Further runs of the reference.
    tolerance : Tolerance, optional
        Bands that the forces are held against; with nominal ones a single run will do.
    config : pathlib.Path, optional
        The damper of results that do not tell theirs.
    reading : Configuration, optional
        How raw logs are read and conditioned; without it as ``config`` says.

    Raises
    ------
    ConfigurationError
        There is nothing to compare.
    LogError
        No log of a run can be used.
    """
    logs = _logs([*paths, *repeats], options, config, reading)
    nominal = tolerance is not None and bool(tolerance.bands)
    is_single = nominal and len(paths) == 1 and not holds_runs(paths[0], logs)
    pairs, alone = ((), ()) if is_single else pairs_of(paths, logs)
    if repeats and len({pair.first for pair in pairs}) > 1:
        raise ConfigurationError(
            "{repeats} are of one reference, and there are several; compare one damper at a time",
            repeats=Option("repeats"),
        )
    _refuse_repeats(repeats, pairs)
    places = list(dict.fromkeys(p for pair in pairs for p in (pair.first, pair.second)))
    places = places or list(paths)
    wanted = [*places, *(one for one in repeats if one not in places)]
    raw = logs.by_place
    found = with_distinct_names(
        [
            raw[place]
            if place in raw
            else read_run(place, config=config, is_measured=options.is_measured)
            for place in wanted
        ]
    )
    called = options.names
    found = tuple(
        replace(run, name=called[place], place=called[place]) if place in called else run
        for place, run in zip(wanted, found, strict=True)
    )
    known: dict[Path, ComparedRun] = dict(zip(wanted, found, strict=True))
    comparisons = tuple(
        compare_runs(
            known[pair.first],
            known[pair.second],
            options,
            repeats=[known[place] for place in repeats],
        )
        for pair in pairs
    )
    remarks = [*logs.remarks]
    remarks += [f"{run.place}: {remark}" for run in found for remark in run.remarks]
    remarks += [f"{one.second.place}: {remark}" for one in comparisons for remark in one.remarks]
    points: tuple[Point, ...] = ()
    if tolerance is not None and nominal:
        held = [known[place] for place in places]
        points = tuple(p for run in held for p in bands_met(run, tolerance, options))
    elif tolerance is not None:
        points = tuple(p for one in comparisons for p in tolerated(one, tolerance))
    return Compared(comparisons, alone, tuple(dict.fromkeys(remarks)), points)


def one_run(
    place: Path,
    options: ComparisonOptions,
    *,
    config: Path | None = None,
    reading: Configuration | None = None,
) -> ComparedRun:
    """Return a single run, to be kept.

    Parameters
    ----------
    place : pathlib.Path
        Results folder, baseline, or raw logs.
    options : ComparisonOptions
        Whether measured curves alone are meant.
    config, reading
        As of `compare_all`.

    Raises
    ------
    ConfigurationError
        There is none, or there are several.
    LogError
        No log can be used.
    """
    logs = _logs([place], options, config, reading)
    named = [name for name in logs.groups.get(place, {}) if name]
    if named:
        raise ConfigurationError(
            f"logs of {len(named)} dampers ({', '.join(named[:3])}"
            f"{', ...' * (len(named) > 3)}); a baseline is of one: give its folder",
            subject=place,
        )
    if place in logs.by_place:
        return logs.by_place[place]
    return read_run(place, config=config, is_measured=options.is_measured)


def _logs(
    places: Sequence[Path],
    options: ComparisonOptions,
    config: Path | None,
    reading: Configuration | None,
) -> LogRuns:
    """Return the raw logs among some places; none where fitted runs are compared."""
    if not options.is_measured:
        return LogRuns()
    return runs_of_logs(places, reading or load_configuration(config), jobs=options.jobs)


def _refuse_repeats(repeats: Sequence[Path], pairs: Sequence[Pair]) -> None:
    """Refuse runs that are no further ones of the reference."""
    taken = {
        one.resolve(): word
        for pair in pairs
        for one, word in ((pair.second, "what is compared with it"), (pair.first, "A itself"))
    }
    seen: set[Path] = set()
    for place in repeats:
        word = taken.get(place.resolve(), "given twice" if place.resolve() in seen else "")
        if word:
            raise ConfigurationError(
                f"is {word}; give further runs of the reference, each once",
                where=Option("repeats", place),
            )
        seen.add(place.resolve())


def parse_bands(text: str | None) -> Tolerance | None:
    """Return the tolerance that the text of a command line means: a file, or per cent and newtons.

    Raises
    ------
    ConfigurationError
        It is neither.
    """
    if text is None:
        return None
    path = Path(text)
    # "2.5%" has a suffix too, as pathlib sees it.
    is_file = path.is_file() or path.suffix[1:2].isalpha()
    return read_bands(path) if is_file else parse_tolerance(text)
