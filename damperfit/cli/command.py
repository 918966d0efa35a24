"""A command of a function: its options are the function's keywords, and it prints the result.

Besides them it has only options of its output (`PRESENTATION`). Its help has panels by purpose.
"""

import csv
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from importlib import import_module
from inspect import Parameter, Signature, cleandoc, signature, unwrap
from pathlib import Path
from typing import Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

from damperfit import __version__
from damperfit.arguments import PANELS, Keyword, keyword_of, option_of
from damperfit.cli.console import say, set_colour, show_steps
from damperfit.errors import ConfigurationError
from damperfit.problem import Option
from damperfit.sections import SECTIONS

COMMON = ("json", "quiet", "debug", "version")
_OF_ALL = ("verbose", "color", "no_progress", "log_file")
# Kinds that may be given several times; any other is one text, which `damperfit.arguments` reads.
_SEVERAL = {"texts", "names", "quantities", "values", "pairs", "paths", "arguments"}
# These read logs or simulate; questions about results take the configuration of their run.
_CONFIGURED = {
    *("identify", "inspect", "models", "fleet", "simulate", "sweep", "samples", "config"),
}


class Shown(NamedTuple):
    """Options of a command's output: JSON, no notes, tracebacks, a summary, a list, no progress."""

    json: bool = False
    quiet: bool = False
    debug: bool = False
    github_summary: bool = False
    list: bool = False
    no_progress: bool = False


def command(
    function: Callable[..., Any] | None = None,
    *,
    name: str = "",
    shown: Sequence[str] = COMMON,
    takes_context: bool = False,
    example: str,
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Return a decorator that makes a command of a function that prints the result of `function`.

    Without `function` the arguments are those of the decorated function.
    """

    def decorated(run: Callable[..., int]) -> Callable[..., int]:
        source = unwrap(run if function is None else function)
        called = name or source.__name__
        declared = signature(source).parameters.values()
        keywords = [keyword for keyword in declared if keyword.name not in {"options", "context"}]

        def typed(*arguments: Any, **given: Any) -> int:
            given.update(zip((keyword.name for keyword in keywords), arguments, strict=False))
            given.pop("version", None)
            given.pop("log_file", None)  # opened by `main`, so that wrong usage stands in it
            set_colour(given.pop("color", None))
            if given.pop("verbose", False):
                show_steps()
            options = Shown(**{key: given.pop(key) for key in Shown._fields if key in given})
            if called in _CONFIGURED and given["config"] is None:
                given["config"] = _own_configuration(is_quiet=options.quiet)
            try:
                return run(options, **given)
            except KeyboardInterrupt:  # typer ends without a word
                raise typer.Abort from None

        about = run.__doc__ if hasattr(run, "__name__") else (source.__doc__ or "").split("\n")[0]
        typed.__doc__ = f"{cleandoc(about or '')}\n\nExample: damperfit {example}"
        typed.__name__ = called
        parameters = [
            parameter(called, keyword.name, keyword.default)
            for keyword in keywords
            if keyword_of(called, keyword.name) is not None
        ]
        parameters += [parameter("", shared) for shared in (*shown, *_OF_ALL)]
        if takes_context:
            of_typer = Parameter("context", Parameter.KEYWORD_ONLY, annotation=typer.Context)
            parameters.insert(0, of_typer)
        return with_options(typed, parameters)

    return decorated


def _own_configuration(*, is_quiet: bool) -> str | None:
    """Return the configuration of $DAMPERFIT_CONFIG, else damperfit.toml here or above."""
    name = os.environ.get("DAMPERFIT_CONFIG") or None
    if name is None:
        with suppress(OSError):  # the working folder is gone
            working = Path.cwd()
            places = (folder / "damperfit.toml" for folder in (working, *working.parents))
            path = next((place for place in places if place.is_file()), None)
            name = None if path is None else path.name if path.parent == working else str(path)
    elif not Path(name).exists():
        where = f"DAMPERFIT_CONFIG={name}"
        raise ConfigurationError("no such file", subject=where, code="no-such-file")
    if name is not None and not is_quiet:
        say(f"note: configuration of {name}")
    return name


def parameter(called: str, name: str, default: Any = None) -> Parameter:
    """Return the option, or argument, of a keyword; its default is the keyword's."""
    keyword = keyword_of(called, name)
    assert keyword is not None, name
    kind: Any = bool if keyword.kind == "flag" else list[str] if keyword.kind in _SEVERAL else str
    details: Any = {"help": keyword.help, "autocompletion": _completion_of(name, keyword)}
    if keyword.kind in {"argument", "arguments"}:
        is_list = keyword.kind == "arguments" and default is not Parameter.empty
        default = ... if default is Parameter.empty else None if is_list else default
        info: Any = typer.Argument(default, metavar=keyword.metavar, **details)
    else:
        details |= {"callback": _print_version, "is_eager": True} if name == "version" else {}
        details |= {"metavar": keyword.metavar or None, "rich_help_panel": keyword.panel}
        default = bool(default) if kind is bool else default and str(default)
        info = typer.Option(default, option_of(name), *keyword.names, **details)
    kind = kind | None if default is None else kind
    return Parameter(name, Parameter.KEYWORD_ONLY, default=info, annotation=kind)


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        typer.echo(f"damperfit {__version__}")
        raise typer.Exit


def with_options(run: Callable[..., Any], parameters: Sequence[Parameter]) -> Callable[..., Any]:
    """Return a function that typer sees with these options and arguments."""
    run.__signature__ = Signature(parameters, return_annotation=int)  # type: ignore[attr-defined]
    run.__annotations__ = {item.name: item.annotation for item in parameters}
    return run


# Completion in the shell; each list is looked up when it is needed.


def _listed(*places: str) -> Callable[[Any], Iterable[str]]:
    """Return a function of the names of tables in modules."""
    pairs = [place.rpartition(".") for place in places]
    return lambda _: [n for module, _, name in pairs for n in getattr(import_module(module), name)]


def _topics(context: typer.Context) -> Iterable[str]:
    commands = getattr(getattr(context.parent, "command", None), "commands", ())
    return (*_listed("damperfit.manual.TOPICS")(context), *commands)


def _procedures(_: typer.Context) -> Iterable[str]:
    from damperfit.damper.model import MODELS

    return dict.fromkeys(name for model in MODELS.values() for name in model.procedures)


def _quantities(context: typer.Context) -> Iterable[str]:
    """Columns of the model that was typed before, else of the paper's."""
    from damperfit.damper.model import MODELS

    model = MODELS.get(context.params.get("model") or "", MODELS["purdy"])
    return model().names


def _settings(context: typer.Context) -> Iterable[str]:
    """Settings of the results that were typed before, or would be taken."""
    given = context.params.get("parameters") or context.params.get("results") or "results"
    # An argument is not bound yet while what follows it is completed.
    place = Path(context.args[0] if context.args else given)
    table = place / "parameters.csv" if place.is_dir() else place
    with table.open(encoding="utf-8") as file:
        return [row["setting"] for row in csv.DictReader(file)]


# Words, or a function that returns them, by keyword.
_WORDS: dict[str, tuple[str, ...] | Callable[[Any], Iterable[str]]] = {
    "stroke": ("rebound", "compression"),
    "color": ("auto", "always", "never"),
    "covariate": ("temperature",),
    "skew": ("auto",),
    "bulk_modulus": ("free", "appendix1"),
    "model": lambda context: ("auto", *_listed("damperfit.damper.model.MODELS")(context)),
    "to": _listed("damperfit.exporting.targets.TARGETS"),
    "check": _listed("damperfit.checks.CHECK_LISTS", "damperfit.checks.CHECKS"),
    "layout": _listed("damperfit.laws.structures.LAYOUTS"),
    "topic": _topics,
    "procedure": _procedures,
    "setting": _settings,
    **dict.fromkeys(("free", "share", "untie", "profile", "for_"), _quantities),
}


def _completion_of(name: str, keyword: Keyword) -> Callable[..., list[str]] | None:
    """Return the completion of a keyword's values; None where any text is one."""
    section, _, key = keyword.key.partition(".")
    entry = SECTIONS[section].entries().get(key) if section in SECTIONS else None
    offered = (entry.words if entry is not None else ()) or _WORDS.get(name)
    if "|" in keyword.kind:
        offered = tuple(keyword.kind.split("|"))
    if offered is None:
        return None

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        """Return the words that complete what was typed, after a comma the last item."""
        first, comma, last = incomplete.rpartition(",")
        words: Iterable[str] = ()
        with suppress(Exception):  # results that cannot be read complete nothing
            words = offered if isinstance(offered, tuple) else offered(ctx)
        return [f"{first}{comma}{word}" for word in words if word.startswith(last)]

    return complete


# Help


class Commands(TyperGroup):
    """The commands, each with its whole sentence, wrapped where the terminal is narrow."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write them under one heading."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, entry.get_short_help_str(1000)) for name, entry in commands if entry]
            )


class PanelledCommand(TyperCommand):
    """A command whose help has panels."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse a second value of an option, and words that no argument takes."""
        ctx.allow_extra_args, given = True, [*args]
        extra: list[str] = super().parse_args(ctx, args)
        values, _, order = self.make_parser(ctx).parse_args(given)
        for option in () if ctx.resilient_parsing else order:
            is_once = not (option.multiple or getattr(option, "is_flag", True))  # arguments are not
            if is_once and order.count(option) > 1:
                text, place = "given already; it takes one value", values[option.name]
                raise ConfigurationError(text, where=Option(option.name, place), code="given-twice")
        if extra and not ctx.resilient_parsing:
            words = " ".join(extra)
            options = {name for param in self.params for name in param.opts}
            hint = ""
            if "--setting" in options and words.isdecimal():
                hint += f"; for setting {words} give --setting {words}"
            if "--parameters" in options and Path(words).exists():
                hint += f"; for the results there give --parameters {words}"
            text = f"unexpected argument{'s' * (len(extra) > 1)} {words}{hint}; see damperfit "
            raise ConfigurationError(
                f"{text}{ctx.info_name} --help", code="unexpected-argument", subject=ctx.info_name
            )
        return extra

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the words after the command's name in its usage."""
        params = self.get_params(ctx)
        return ["[OPTIONS]", *(_word(p) for p in params if p.param_type_name == "argument")]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, then the options panel by panel."""
        rows: dict[str, list[tuple[str, str]]] = {panel: [] for panel in ("Arguments", *PANELS)}
        param: Any
        for param in self.get_params(ctx):
            if param.param_type_name == "argument":
                needed = "[required]" if param.required else ""
                rows["Arguments"].append((_word(param), f"{param.help or ''} {needed}".strip()))
            elif (record := param.get_help_record(ctx)) is not None:
                rows[getattr(param, "rich_help_panel", None) or PANELS[-1]].append(record)
        for panel, lines in rows.items():
            if lines:
                with formatter.section(panel):
                    formatter.write_dl(lines)


def _word(param: Any) -> str:
    word = str(param.metavar or (param.name or "").upper())
    return word if param.required or word.startswith("[") else f"[{word}]"
