"""The jobs of the command line for a notebook: `calls` has them, `results` what they return.

What is offered is looked up at the top of the package, as in ``damperfit.identify``.
"""

__all__: list[str] = []
