"""Traces and fits of commands, made once for the same logs: most tests of commands fit three.

For tests that ask what a run says and writes; how it fits is asked in `identification/`. What
breaks a fit on purpose, or counts what it does, takes the fixture `fitted_anew`.
"""

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import pytest

from damperfit.identification import Campaign
from damperfit.recording import Trace
from damperfit.run import identify, logs
from damperfit.run.identify import Watch


@dataclass(frozen=True)
class _Asked:
    """What a trace or a fit depends on, as bytes; and how it is made."""

    content: bytes
    what: tuple[Any, ...] = field(compare=False)
    how: dict[str, Any] = field(compare=False)


class _IsNotKeptError(Exception):
    """Others would not have met what this fit has met."""


_fits, _condition = identify._fits, logs.condition


@cache
def _conditioned(asked: _Asked) -> Trace:
    return _condition(*asked.what)


def _kept_trace(*what) -> Trace:
    return _conditioned(_Asked(pickle.dumps(what), what, {}))


@cache
def _fitted(asked: _Asked) -> Campaign:
    found = _fits(*asked.what, **asked.how)
    if found.failures or not found.is_complete:
        raise _IsNotKeptError(found)
    return found


def _kept(configuration, batch, *, jobs, watch) -> Campaign:
    told = []

    def tell(fit) -> None:
        told.append(fit)
        watch.on_fit(fit)

    what = (batch.traces, configuration.damper, configuration.identification, jobs)
    how = {"jobs": jobs, "watch": Watch(on_fit=tell, cancelled=watch.cancelled)}
    try:
        found = _fitted(_Asked(pickle.dumps(what), (configuration, batch), how))
    except _IsNotKeptError as error:
        return error.args[0]
    if not told:
        for fit in found.fits:
            watch.on_fit(fit)
    return found


@contextmanager
def kept_fits() -> Iterator[None]:
    """Let commands that run in this process share what they have fitted."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(identify, "_fits", _kept)
        patch.setattr(logs, "condition", _kept_trace)
        yield


@pytest.fixture(scope="module", autouse=True)
def _fits_are_kept():
    """Imported by the `conftest.py` of folders whose tests ask what a run says."""
    with kept_fits():
        yield


@contextmanager
def fits_anew() -> Iterator[None]:
    """Take that back."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(identify, "_fits", _fits)
        yield
