"""File formats of a robot trajectory: a table name -> module with `save` and `load`."""
