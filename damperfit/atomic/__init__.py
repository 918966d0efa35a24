"""A set of files appears whole or not at all, whatever ends the run and whoever else writes."""

from damperfit.atomic.file_set import FileSet, check_writable, file_set, write_text
from damperfit.atomic.recovery import reserved, settle

__all__ = ["FileSet", "check_writable", "file_set", "reserved", "settle", "write_text"]
