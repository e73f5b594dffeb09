"""Names of pictures; published tables and curves: `assets/reference/<name>.csv`, comments first, then a header."""

import csv
from importlib.resources import files


def picture_name(wanted: str) -> str:
    """Return the file name of a reproduction's picture: `sensor/band` is drawn in `sensor-band.png`."""
    return wanted.replace("/", "-") + ".png"


def read_reference(name: str) -> list[dict[str, str]]:
    """Return the rows of a table by its columns' names, as text."""
    lines = files("dockair.assets").joinpath("reference", f"{name}.csv").read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def read_figure(name: str, figure: str) -> dict[str, float]:
    """Return the quantities that are printed for one figure, from a table with columns figure, quantity, value."""
    return {row["quantity"]: float(row["value"]) for row in read_reference(name) if row["figure"] == figure}
