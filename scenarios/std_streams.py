"""Standard output and error that outlive their readers: a command is done, and its status said, whoever listens."""

import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class _Outliving(io.FileIO):
    """A file descriptor that leads nowhere once its reader has gone."""

    def write(self, data: "ReadableBuffer", /) -> int | None:  # type: ignore[override]
        try:
            return super().write(data)
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return memoryview(data).nbytes


def outlive_readers() -> None:
    """Make this process's output go on without a reader, and without a stream where it was started with it closed.

    Streams that somebody has put in their place stay as they are.
    """
    _open_closed_ones()
    if sys.stdout is sys.__stdout__:
        sys.stdout = _outliving(sys.stdout, 1, errors="surrogateescape")  # a path may be of any bytes
    if sys.stderr is sys.__stderr__:
        sys.stderr = _outliving(sys.stderr, 2, errors="backslashreplace")


def _open_closed_ones() -> None:
    """Lead closed descriptors nowhere: the next file to be opened would get their numbers, and what is printed."""
    while (file := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(file)


def _outliving(stream: TextIO | None, number: int, errors: str) -> TextIO:
    file = _Outliving(number, "w", closefd=False)
    encoding = "utf-8" if stream is None else stream.encoding
    at_once = isinstance(stream, io.TextIOWrapper) and (stream.line_buffering or stream.write_through)
    return io.TextIOWrapper(io.BufferedWriter(file), encoding=encoding, errors=errors, line_buffering=at_once)
