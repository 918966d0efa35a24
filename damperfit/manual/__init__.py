"""The manual: one page a topic, for the terminal (`damperfit help`) and for the site (`mkdocs`)."""

import re
from collections.abc import Iterable
from importlib.resources import files
from typing import NamedTuple

from damperfit.errors import ConfigurationError, did_you_mean

# In the order in which they are read; the menu of the site is the same.
TOPICS = (
    *("start", "logs", "signs", "quality", "adjusters", "holdout", "compare", "advise", "valves"),
    *("passport", "ride", "watch", "export", "gates", "fleet", "python", "model", "models", "fit"),
    *("trust", "commands", "configuration", "files", "glossary", "proof", "limits", "citation"),
)
_COMMENT = re.compile(r"^<!--.*?-->\n\n?", flags=re.MULTILINE | re.DOTALL)
_PICTURE = re.compile(r"^!\[([^]]*)\]\([^)]*\)\n\n?", flags=re.MULTILINE)
_LINK = re.compile(r"\[([^]]+)\]\((\w+)\.md(?:#[\w-]+)?\)")


class Page(NamedTuple):
    """One page of the manual: its topic, one of `TOPICS`, and the Markdown of its file."""

    topic: str
    source: str

    @property
    def title(self) -> str:
        """What it is about, in a few words."""
        return self.source.partition("\n")[0].removeprefix("# ")

    @property
    def text(self) -> str:
        """Markdown for a terminal: no comments, no pictures, links as names of topics."""
        plain = _PICTURE.sub("", _COMMENT.sub("", self.source))
        return _LINK.sub(r"\1 (`damperfit help \2`)", plain)


def read_page(topic: str, others: Iterable[str] = ()) -> Page:
    """Return the page of a topic; a ConfigurationError: there is none, nor another."""
    name = topic.strip().lower()
    if name not in TOPICS:
        raise ConfigurationError(
            f"help {topic}: there is no such topic.{did_you_mean(name, (*TOPICS, *others))} "
            "damperfit help lists them",
            code="unknown-topic",
        )
    source = files(__name__).joinpath("pages", f"{name}.md").read_text(encoding="utf-8")
    return Page(name, source)


def read_schema() -> str:
    """Return the JSON schema of run.json, with the meaning of each key."""
    return files(__name__).joinpath("pages", "run.schema.json").read_text(encoding="utf-8")
