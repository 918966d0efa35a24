"""A run exported to other programs: `targets` makes the files, `check` holds them against the logs.

(`damperfit.export` is the function, so the package has another name.)
"""
