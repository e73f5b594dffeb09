"""Published tables and curves: `assets/reference/<name>.csv`, comment lines first, then a header."""

import csv
from importlib.resources import files


def read_reference(name: str) -> list[dict[str, str]]:
    """Return the rows of a table by its columns' names, as text."""
    lines = files("dockair.assets").joinpath("reference", f"{name}.csv").read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))
