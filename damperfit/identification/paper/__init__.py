"""What only the paper's own damper and its procedure need of the identification."""

__all__: list[str] = []
