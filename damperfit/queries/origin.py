"""Whose parameters a table holds: the configuration with the damper of the run that wrote it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.results import Run
from damperfit.tables import unknown_schema

if TYPE_CHECKING:
    from pathlib import Path

    from damperfit.configuration.options import Configuration

__all__ = ["damper_of_table"]


def damper_of_table(
    table: Path, configuration: Configuration, *, config: Path | None = None
) -> tuple[Configuration, str]:
    """Return the configuration with the damper that a table belongs to, and a line on it.

    Parameters
    ----------
    table : pathlib.Path
        Of parameters.
    configuration : Configuration
        As the user gave it.
    config : pathlib.Path, optional
        The file it came from, for the message.

    Raises
    ------
    ConfigurationError
        The user declares another damper than the one that was fitted.
    """
    run = Run.load(table)
    meant = run.configured(configuration, config=config, takes_motion=True)
    if run.declared_damper is None:
        said = f"; {run.source} does not say whose parameters these are"
    else:
        said = f", that of {run.source}"
    if schema := unknown_schema(run.record):
        said = f"{said}; {schema}"
    return meant, meant.damper_sentence_from(said)
