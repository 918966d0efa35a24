"""Templates filled in; every text is made printable and escaped here, and nowhere else."""

from __future__ import annotations

from functools import cache
from importlib import resources

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from damperfit.report.text import printable

__all__ = ["asset", "draw", "page_text", "verbatim"]


def draw(template: str, **parts: object) -> str:
    """Return a template of `page/templates` with these parts in it.

    Parameters
    ----------
    template : str
        File name.
    **parts : object
        By the names that the template has for them; text is escaped, but for what `verbatim` marks.
    """
    return _environment().get_template(template).render(parts)


def page_text(text: object) -> Markup:
    r"""Return text that a page and a plot show as it is, control characters as escapes.

    Plots need it where they are described, for plotly reads labels as a small HTML of its own.

    Examples
    --------
    >>> print(page_text("<b>run_1\x1b[0m"))
    &lt;b&gt;run_1\x1b[0m
    """
    return text if isinstance(text, Markup) else escape(printable(str(text)))


def verbatim(text: str) -> Markup:
    """Return text that stands on the page as it is: scripts and styles of ours, never of a log."""
    return Markup(text)  # noqa: S704 - for what is escaped or ours


def asset(name: str) -> Markup:
    """Return the page's style or script."""
    place = resources.files("damperfit.report.page") / name
    return verbatim(place.read_text(encoding="utf-8"))


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("damperfit.report.page"),
        autoescape=True,
        finalize=page_text,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
