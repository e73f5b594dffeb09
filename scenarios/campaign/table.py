"""The rows as Parquet: the same rows make the same bytes."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.campaign.row import COLUMNS, column_names, is_row
from dockair.scenarios.parquet_file import read_parquet
from dockair.scenarios.whole_file import write_whole

FILE_NAME = "flights.parquet"


def write_table(rows: Sequence[Mapping[str, Any]], folder: Path) -> Path:
    """Write `flights.parquet` into a folder, whole or not at all, and return its path."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds = {"text": pa.string(), "bool": pa.bool_(), "int": pa.int64(), "float": pa.float64()}
    columns = {}
    for name in column_names(rows):
        values = [row.get(name) for row in rows]
        kind = COLUMNS.get(name) or _kind(values)
        if kind == "text":
            values = [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
        columns[name] = pa.array(values, kinds[kind])
    data = pa.BufferOutputStream()
    pq.write_table(pa.table(columns), data, compression="ZSTD")
    write_whole(folder / FILE_NAME, data.getvalue().to_pybytes())
    return folder / FILE_NAME


def read_table(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of a folder's `flights.parquet`.

    Raises:
        DockairError: it is damaged, or somebody else's.
    """
    import pyarrow as pa

    path = folder / FILE_NAME
    expected = "the table of a campaign (removed, it is made again by the command that flew it)"
    try:
        rows: list[dict[str, Any]] = read_parquet(path).to_pylist()
    except (pa.ArrowException, OSError, ValueError) as error:
        raise DockairError(str(path), expected=expected, got=" ".join(str(error).split())) from None
    if not all(map(is_row, rows)):
        raise DockairError(str(path), expected=expected, got="rows of something else")
    return rows


def _kind(values: Sequence[Any]) -> str:
    """Return the kind of a drawn key's column; whole numbers among others become floats, anything else text."""
    present = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in present):
        return "bool"
    if any(isinstance(value, bool | str) for value in present):
        return "text"
    return "int" if all(isinstance(value, int) for value in present) else "float"
