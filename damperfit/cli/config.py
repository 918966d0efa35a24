"""``damperfit config``: the complete configuration in force, as TOML."""

from __future__ import annotations

from damperfit.cli.console import print_json, print_lines
from damperfit.cli.options import (
    ConfigOption,
    DebugOption,
    JsonOption,
    QuietOption,
    VersionOption,
)

__all__ = ["config"]


def config(
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Print the complete configuration in force, as TOML.

    Example: damperfit config > my_damper.toml
    """
    from damperfit.configuration.loading import configuration_toml, load_configuration
    from damperfit.run.ending import json_values

    configuration = load_configuration(config)
    if json:
        print_json(json_values(configuration.document))
    else:
        print_lines(configuration_toml(configuration).splitlines())
    return 0
