"""Reads Parquet on the thread that asks for it.

A thread of Arrow's own that still holds a file of Python's as Python ends aborts the process, or hangs it, after all
its work is done (github.com/apache/arrow, issues 34314 and 50482).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def open_parquet(path: Path) -> Iterator[Any]:
    """Give a file's `pyarrow.parquet.ParquetFile`, which reads nothing ahead; read from it with `use_threads=False`.

    Raises:
        OSError, pyarrow.ArrowException: it cannot be read, or is no Parquet file.
    """
    import pyarrow.parquet as pq  # slow to import; only those who read wait for it

    with path.open("rb") as data, pq.ParquetFile(data, pre_buffer=False) as file:  # Arrow takes no path but of UTF-8
        yield file


def read_parquet(path: Path) -> Any:
    """Return a file's `pyarrow.Table`; raises as `open_parquet`."""
    with open_parquet(path) as file:
        return file.read(use_threads=False)
