"""``damperfit config``: the complete configuration in force, as TOML."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_json, print_lines

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["config"]


def _config(config: Path | None = None) -> None:
    """Take what the command takes."""


@command(_config, name="config")
def config(how: Shown, config: Path | None) -> int:
    """Print the complete configuration in force, as TOML.

    Example: damperfit config > my_damper.toml
    """
    from damperfit.configuration.loading import configuration_toml, load_configuration
    from damperfit.tables.documents import json_values

    configuration = load_configuration(config)
    if how.json:
        print_json(json_values(configuration.document))
    else:
        print_lines(configuration_toml(configuration).splitlines())
    return 0
