"""Parquet is read on the thread that asks for it."""

import subprocess
import sys

import pyarrow as pa
import pyarrow.parquet as pq

from dockair.scenarios.parquet_file import open_parquet, read_parquet

_COUNTED = """
import os, sys
from pathlib import Path
import pyarrow.parquet
from dockair.scenarios.parquet_file import open_parquet, read_parquet
before = len(os.listdir("/proc/self/task"))
table = read_parquet(Path(sys.argv[1]))
with open_parquet(Path(sys.argv[1])) as file:
    file.read_row_group(0, use_threads=False)
print(table.num_rows, len(os.listdir("/proc/self/task")) - before)
"""


def test_a_table_comes_back_from_a_path_of_any_name(tmp_path):
    table = pa.table({"a": [1, 2, None], "b": ["x", "", "z"]})
    path = tmp_path / "half \udce9.parquet"
    with path.open("wb") as file:
        pq.write_table(table, file)
    assert read_parquet(path).equals(table)


def test_no_thread_is_left_that_could_hold_the_file_as_python_ends(tmp_path):
    path = tmp_path / "table.parquet"
    pq.write_table(pa.table({f"c{k}": list(range(1000)) for k in range(40)}), path, row_group_size=100)
    with open_parquet(path) as file:
        assert file.read_row_group(9, use_threads=False)["c0"].to_pylist() == list(range(900, 1000))
    ran = subprocess.run([sys.executable, "-c", _COUNTED, str(path)], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == ["1000", "0"]
