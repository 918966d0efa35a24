"""What a run does unless told otherwise: defaults.toml, then a file, then the command line."""
