"""The web page: `page` puts it together, `tables` says which tables it has, `templates/` HTML."""

__all__: list[str] = []
