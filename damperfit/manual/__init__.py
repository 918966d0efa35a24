"""The manual: one page a topic, for the terminal (`damperfit help`) and for the site (`mkdocs`)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib.resources import files

from damperfit.errors import ConfigurationError, did_you_mean

__all__ = ["TOPICS", "Page", "read_page", "read_schema"]

# In the order in which they are read; the menu of the site is the same.
TOPICS = (
    "start",
    "logs",
    "signs",
    "quality",
    "adjusters",
    "holdout",
    "compare",
    "advise",
    "valves",
    "passport",
    "ride",
    "watch",
    "export",
    "gates",
    "fleet",
    "python",
    "model",
    "models",
    "fit",
    "trust",
    "commands",
    "configuration",
    "files",
    "glossary",
    "proof",
    "limits",
    "citation",
)
_COMMENT = re.compile(r"^<!--.*?-->\n\n?", flags=re.MULTILINE | re.DOTALL)
_PICTURE = re.compile(r"^!\[([^]]*)\]\([^)]*\)\n\n?", flags=re.MULTILINE)
_LINK = re.compile(r"\[([^]]+)\]\((\w+)\.md(?:#[\w-]+)?\)")


@dataclass(frozen=True, slots=True)
class Page:
    """One page of the manual.

    Attributes
    ----------
    topic : str
        One of `TOPICS`.
    source : str
        Markdown as it stands in the file.
    """

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


def read_page(topic: str) -> Page:
    """Return the page of a topic.

    Raises
    ------
    ConfigurationError
        There is none.

    Examples
    --------
    >>> read_page("glossary").title
    'Glossary'
    """
    name = topic.strip().lower()
    if name not in TOPICS:
        raise ConfigurationError(
            f"help {topic}: there is no such topic.{did_you_mean(name, TOPICS)} "
            "damperfit help lists them",
            code="unknown-topic",
        )
    source = files(__name__).joinpath("pages", f"{name}.md").read_text(encoding="utf-8")
    return Page(name, source)


def read_schema() -> str:
    """Return the JSON schema of run.json, with the meaning of each key."""
    return files(__name__).joinpath("pages", "run.schema.json").read_text(encoding="utf-8")
