"""``damperfit help``: the pages of the manual in the terminal."""

from __future__ import annotations

from dataclasses import replace

import typer

from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_json, print_lines, print_renderable

__all__ = ["show_help"]


def _help(topic: str | None = None) -> None:
    """Take what the command takes."""


@command(_help, name="help", takes_context=True)
def show_help(how: Shown, context: typer.Context, topic: str | None) -> int:
    """Show a page of the manual, or list the pages.

    Example: damperfit help trust
    """
    from damperfit.manual import TOPICS, read_page

    commands = {} if context.parent is None else getattr(context.parent.command, "commands", {})
    if topic is None:
        pages = [read_page(one) for one in TOPICS]
        if how.json:
            print_json({"topics": {page.topic: page.title for page in pages}})
        else:
            wide = max(map(len, TOPICS))
            print_lines(
                [
                    *(f"{page.topic:{wide}}  {page.title}" for page in pages),
                    "",
                    "damperfit help TOPIC shows one of them, or what a command takes.",
                ]
            )
    elif topic not in TOPICS and topic in commands:
        text = commands[topic].get_help(typer.Context(commands[topic], context.parent, topic))
        record = {"command": topic, "text": text}
        print_json(record) if how.json else print_lines(text.splitlines())
    else:
        _show(topic, json=how.json, commands=tuple(commands))
    return 0


def _show(topic: str, *, json: bool, commands: tuple[str, ...]) -> None:
    from damperfit.cli.pages import filled
    from damperfit.errors import ConfigurationError, did_you_mean
    from damperfit.manual import TOPICS, read_page

    if topic.strip().lower() not in TOPICS:
        hint = did_you_mean(topic.strip().lower(), (*TOPICS, *commands))
        raise ConfigurationError(
            f"help {topic}: there is no such topic.{hint} damperfit help lists them"
        )
    page = read_page(topic)
    page = replace(page, source=filled(page.source))
    if json:
        print_json({"topic": page.topic, "title": page.title, "text": page.text})
        return
    from rich.markdown import Markdown

    print_renderable(Markdown(page.text, hyperlinks=False))
