"""The help of a command: its options in panels, by what they are for; all commands in full."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from typer.core import TyperCommand, TyperGroup

from damperfit.errors import ConfigurationError
from damperfit.keywords import PANELS

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["PanelledCommand", "UncutCommands"]

_WHOLE = 1000  # characters of a summary: none is that long


class UncutCommands(TyperGroup):
    """The commands, each with its whole sentence, wrapped where the terminal is narrow."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write them under one heading."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, one.get_short_help_str(_WHOLE)) for name, one in commands if one]
            )


class PanelledCommand(TyperCommand):
    """A command whose help has panels."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse words that no argument takes; a lone number is meant as setting."""
        ctx.allow_extra_args = True
        rest: list[str] = super().parse_args(ctx, args)
        if rest and not ctx.resilient_parsing:
            words = " ".join(rest)
            known = {name for param in self.params for name in param.opts}
            hint = ""
            if "--setting" in known and words.isdecimal():
                hint += f"; for setting {words} give --setting {words}"
            if "--parameters" in known and Path(words).exists():
                hint += f"; for the results there give --parameters {words}"
            raise ConfigurationError(
                f"unexpected argument{'s' * (len(rest) > 1)} {words}{hint}; see damperfit "
                f"{ctx.info_name} --help",
                code="unexpected-argument",
                subject=ctx.info_name,
            )
        return rest

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return what follows the command's name in its usage."""
        return ["[OPTIONS]", *(_word(param) for param in self._arguments(ctx))]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, then the options panel by panel."""
        arguments = [
            (_word(param), " ".join(filter(None, [getattr(param, "help", ""), _need(param)])))
            for param in self._arguments(ctx)
        ]
        if arguments:
            with formatter.section("Arguments"):
                formatter.write_dl(arguments)
        rows: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            record = None if param.param_type_name == "argument" else param.get_help_record(ctx)
            if record is not None:
                panel = getattr(param, "rich_help_panel", None) or PANELS[-1]
                rows.setdefault(panel, []).append(record)
        for panel in PANELS:
            if panel in rows:
                with formatter.section(panel):
                    formatter.write_dl(rows[panel])

    def _arguments(self, ctx: Any) -> Iterator[Any]:
        return (one for one in self.get_params(ctx) if one.param_type_name == "argument")


def _word(param: Any) -> str:
    word = str(param.metavar or (param.name or "").upper())
    return word if param.required or word.startswith("[") else f"[{word}]"


def _need(param: Any) -> str:
    return " [required]" if param.required else ""
