"""Calls of a notebook fit the same few logs: most tests ask what a call gives, not how it fits."""

from tests.kept_fits import _fits_are_kept  # noqa: F401
