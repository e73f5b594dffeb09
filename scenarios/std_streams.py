"""Standard output and error that outlive their readers: a command is done, and its status said, whoever listens."""

import codecs
import errno
import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

from dockair.scenarios.whole_file import NO_ROOM

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_STDOUT = 1
_ANY_TEXT = "dockair.any_text"


def _any_text(error: UnicodeError) -> tuple[str | bytes, int]:
    """Print a path's bytes as they are, and a sign that the stream's encoding lacks as its number."""
    try:
        return codecs.lookup_error("surrogateescape")(error)
    except UnicodeError:
        return codecs.lookup_error("backslashreplace")(error)


codecs.register_error(_ANY_TEXT, _any_text)


class _Outliving(io.FileIO):
    """A file descriptor that leads nowhere once its reader has gone, or its disk is full.

    A full disk is an error where results go, once: what is still held back goes nowhere as the process ends. It is
    passed over where errors go, for a status has to be said all the same.
    """

    def write(self, data: "ReadableBuffer", /) -> int | None:  # type: ignore[override]
        try:
            return super().write(data)
        except OSError as error:
            if error.errno not in (errno.EPIPE, *NO_ROOM):
                raise
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            if error.errno != errno.EPIPE and self.fileno() == _STDOUT:
                raise
            return memoryview(data).nbytes


def outlive_readers() -> None:
    """Make this process's output go on without a reader, and without a stream where it was started with it closed.

    Streams that somebody has put in their place stay as they are. Closed descriptors lead nowhere already (`__main__`).
    """
    if sys.stdout is sys.__stdout__:
        sys.stdout = _outliving(sys.stdout, _STDOUT, errors=_ANY_TEXT)
    if sys.stderr is sys.__stderr__:
        sys.stderr = _outliving(sys.stderr, 2, errors="backslashreplace")


def _outliving(stream: TextIO | None, number: int, errors: str) -> TextIO:
    file = _Outliving(number, "w", closefd=False)
    encoding = "utf-8" if stream is None else stream.encoding
    at_once = isinstance(stream, io.TextIOWrapper) and (stream.line_buffering or stream.write_through)
    return io.TextIOWrapper(io.BufferedWriter(file), encoding=encoding, errors=errors, line_buffering=at_once)
