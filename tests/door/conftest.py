"""Calls of a notebook fit the same few logs: most tests ask what a call gives, not how it fits."""

import pytest

from tests.kept_fits import kept_fits


@pytest.fixture(scope="module", autouse=True)
def _fits_are_kept():
    with kept_fits():
        yield
