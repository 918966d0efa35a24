"""What a run does unless told otherwise: the defaults, then a file, then the command line."""
