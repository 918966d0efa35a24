"""Figures as descriptions (`description`), and the files that matplotlib draws of them.

`report_plots` says which figures a report has; each is described in `all_settings`, `parameters`,
`one_log` or `sweep`.
"""

__all__: list[str] = []
