"""Profiles that were asked for, over all settings of a campaign."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.blas import one_blas_thread
from damperfit.damper.parameters import PARAMETER_NAMES
from damperfit.errors import ConfigurationError, SimulationError, did_you_mean
from damperfit.identification.descent import FitCancelledError
from damperfit.uncertainty.assessment import Assessment, evidence_in_turns, without_curves
from damperfit.uncertainty.joint_profiles import profile_jointly
from damperfit.uncertainty.lines import Bench, is_doubtful, lines_of
from damperfit.uncertainty.profiles import MisfitProfile, Stride
from damperfit.uncertainty.tracing import Line, trace_profile

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Sequence

    from damperfit.identification import Campaign

__all__ = ["check_profile_names", "profile_campaign"]


def check_profile_names(names: Iterable[str], *, fixed: Container[str] = ()) -> None:
    """Refuse names that are no parameters, or that are held.

    Raises
    ------
    ConfigurationError
        A name is not known, or is among the fixed.
    """
    for name in names:
        if name not in PARAMETER_NAMES:
            hint = did_you_mean(name, PARAMETER_NAMES)
            known = ", ".join(PARAMETER_NAMES)
            raise ConfigurationError(f"no parameter {name!r} to profile; there are {known}.{hint}")
        if name in fixed:
            raise ConfigurationError(f"{name} is both fixed and to be profiled; choose one.")


def profile_campaign(
    campaign: Campaign,
    assessment: Assessment,
    bench: Bench,
    *,
    names: Sequence[str],
    stride: Stride = Stride(),
    on_error: Callable[[int, Exception], None] | None = None,
) -> Assessment:
    """Return the assessment with full profiles of some parameters at every setting.

    A parameter that is fixed, or a setting whose fit is no minimum, has none. Settings that were
    finished when the caller asked to stop are kept.

    Parameters
    ----------
    campaign : Campaign
        The fits.
    assessment : Assessment
        Their errors.
    bench : Bench
        Damper, solver, threads, cancellation.
    names : sequence of str
        Parameters.
    stride : Stride
        How closely.
    on_error : callable, optional
        Told of a setting and the error that it met; without it such an error is raised.

    Raises
    ------
    ConfigurationError
        A name is not known.
    """
    check_profile_names(names)
    known = {one.setting: one for one in assessment.uncertainties}
    judged = tuple(fit for fit in campaign.fits if fit.setting in known)
    campaign = replace(campaign, fits=judged)
    turns = evidence_in_turns(campaign, bench.damper, solver=bench.solver, jobs=bench.jobs)
    evidence = [without_curves(one) for seen in turns for one in seen]
    mine = {one.fit.setting: one for one in evidence}
    sharing = campaign.sharing
    found: list[MisfitProfile] = []

    def one(line: Line) -> MisfitProfile | None:
        try:
            return trace_profile(line, stride)
        except (SimulationError, FitCancelledError):
            return None
        except Exception as error:
            if on_error is None:
                raise
            on_error(line.setting, error)
            return None

    with ThreadPoolExecutor(max(1, bench.jobs)) as pool, one_blas_thread():
        for name in dict.fromkeys(names):
            if name in sharing.jointly:
                try:
                    first = known[sharing.settings[0]]
                    traced = profile_jointly(name, evidence, first, sharing, bench, stride=stride)
                except (SimulationError, FitCancelledError):
                    traced = ()
                except Exception as error:
                    if on_error is None:
                        raise
                    on_error(sharing.settings[0], error)
                    traced = ()
            else:
                lines = lines_of(name, mine, known, sharing, bench)
                traced = tuple(p for p in pool.map(one, lines) if p is not None)
            found.extend(
                replace(
                    profile,
                    is_shared=name in sharing.found,
                    is_partial=name == "f_f" and name in sharing.found and not sharing.jointly,
                    is_doubtful=is_doubtful(
                        name, mine[profile.setting].fit, known[profile.setting]
                    ),
                )
                for profile in traced
            )
    return replace(assessment, profiles=(*assessment.profiles, *found))
