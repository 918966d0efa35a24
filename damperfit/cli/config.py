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
    from damperfit.account import json_values
    from damperfit.config import load_settings, settings_toml

    settings = load_settings(config)
    if json:
        print_json(json_values(settings.document))
    else:
        print_lines(settings_toml(settings).splitlines())
    return 0
