"""Tables as rows of strings, one file a table; whoever draws one starts from its `Sheet`.

`rounding` makes numbers into text, `notes_below_tables` holds the sentences below the tables.
"""

__all__: list[str] = []
