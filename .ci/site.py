"""The manual as a site: tables made from the code, and the API reference; mkdocs.yml names this."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import griffe
from mkdocs.structure.files import File

import damperfit
from damperfit.cli.pages import filled
from damperfit.conditioning.log_to_trace import condition
from damperfit.identification.procedures import identify
from damperfit.io import read_curves, read_log
from damperfit.simulation import simulate
from damperfit.uncertainty.assessment import assess

# Commands stay on one line, and 120 columns of the terminal's output are seen at once.
_STYLE = "td:first-child code { white-space: nowrap } pre code { font-size: 0.7rem }\n"
_STEPS = (read_log, read_curves, condition, identify, simulate, assess)


def on_files(files: Any, config: Any) -> Any:
    """Add the page of the API, of which mkdocstrings makes the entries, and a style sheet."""
    names = sorted(set(dir(damperfit)) - {"__version__"})
    objects = (*(getattr(damperfit, name) for name in names), *_STEPS)
    entries = [f"::: {item.__module__}.{item.__qualname__}" for item in objects]
    text = "\n\n".join(["# API reference", *entries]) + "\n"
    files.append(File.generated(config, "api.md", content=text))
    files.append(File.generated(config, "site.css", content=_STYLE))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return a page with its tables."""
    return filled(markdown)


class Keywords(griffe.Extension):
    """Docstrings of functions with the keywords that join them when they are imported."""

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Replace the docstring in the source of a function of `import damperfit`."""
        if func.docstring and func.parent and func.parent.path in {"damperfit.api", _AFTER}:
            function = getattr(import_module(func.parent.path), func.name, None)
            func.docstring.value = getattr(function, "__doc__", None) or func.docstring.value


_AFTER = "damperfit.after_fit.functions"
