"""Results as named tables with units, and the files that hold them.

`columns` declares every column once; `rows` fills them from what was fitted and assessed; `files`
lays rows out as Arrow tables, writes them and reads them back.
"""
