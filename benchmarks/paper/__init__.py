"""The paper's tables on recordings of ours: see `__main__`."""
