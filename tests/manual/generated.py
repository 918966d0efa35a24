"""Where the manual is, and which options its commands have."""

import re
from pathlib import Path

import typer

from damperfit.cli.main import app

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "damperfit" / "manual" / "pages"
COMMANDS = typer.main.get_command(app).commands
PLACE = re.compile(r"<!-- table: ([\w -]+) -->\n")


def options_of(command: str) -> set[str]:
    """Every spelling of every option."""
    context = typer.Context(COMMANDS[command], help_option_names=["-h", "--help"])
    options = [p for p in COMMANDS[command].get_params(context) if p.param_type_name == "option"]
    return {word for option in options for word in (*option.opts, *option.secondary_opts)}
