"""What is done, a line of JSON a flight, on the disk before the next is counted; a campaign that was killed reads it.

A line that was being written when the power went is the last one and not whole: it is cut off, and its flight is flown
again. A line that could not be written (no room) is cut off likewise. One process writes at a time.
"""

import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from dockair.errors import DockairError, MachineError
from dockair.scenarios.campaign.row import is_row
from dockair.scenarios.file_lock import has_locked
from dockair.scenarios.whole_file import NO_ROOM, sync_folder

FILE_NAME = "journal.jsonl"
_BEGINS = b'{"key": "'  # every entry, as `append` is given it

Entry = dict[str, Any]  #: key, row, wall_time_s, traceback


class Journal:
    """The journal of a folder, open for one campaign; use it in a `with` statement.

    Args:
        folder: that holds it, or will.
        unread: there is no looking into it, for it will be cleared: damage is no matter then.

    Raises:
        DockairError: another process writes it; a line is no entry, and not the last one torn; it cannot be opened.
    """

    def __init__(self, folder: Path, *, unread: bool = False) -> None:
        self.path = folder / FILE_NAME
        self.entries: dict[str, Entry] = {}
        self._size = 0
        try:
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise DockairError(str(self.path), expected="a file that can be written", got=error.strerror) from None
        try:
            self._lock()
            if not unread:
                self.entries, self._size = read(self.path)
                os.ftruncate(self._file, self._size)
            sync_folder(folder)  # once: it may have been made just now, and rows are on the disk only if it is
        except BaseException:
            os.close(self._file)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        os.close(self._file)

    def append(self, entry: Entry) -> None:
        """Write an entry; when this returns, it outlives a power cut.

        Raises:
            MachineError: there is no room; what was there is as it was.
            DockairError: the folder has been moved or removed, and the entry with it: no table could be written.
        """
        line = (json.dumps(entry, allow_nan=False) + "\n").encode()
        try:
            written = 0
            while written < len(line):
                written += os.write(self._file, line[written:])
            os.fsync(self._file)
        except OSError as error:
            os.ftruncate(self._file, self._size)
            if error.errno not in NO_ROOM:
                raise
            remedy = f"make some and give the same command again, {len(self.entries)} flights are kept"
            raise MachineError(str(self.path), expected="room to write", remedy=remedy) from None
        self._size += len(line)
        self.entries[entry["key"]] = entry
        self._require_in_place()

    def clear(self) -> None:
        """Forget everything."""
        os.ftruncate(self._file, 0)
        os.fsync(self._file)  # before a new manifest says that other rows are to come: those of before are none of them
        self.entries, self._size = {}, 0

    def _require_in_place(self) -> None:
        try:
            in_place = os.path.samestat(os.stat(self.path), os.fstat(self._file))
        except OSError:
            in_place = False
        if not in_place:
            expected = "the journal to stay where the campaign began (moved back, the same command goes on)"
            raise DockairError(str(self.path), expected=expected, got="another file or none")

    def _lock(self) -> None:
        try:
            alone = has_locked(self._file)
        except OSError as error:
            raise DockairError(str(self.path), expected="a file that can be locked", got=error.strerror) from None
        if not alone:
            expected = "a folder in which no campaign is running"
            raise DockairError(str(self.path.parent), expected=expected, got="another process at work")


def begins_like_one(path: Path) -> bool:
    """Whether a file may be a journal: empty, or beginning as every entry does as far as it was written."""
    with path.open("rb") as file:
        head = file.read(len(_BEGINS))
    return _BEGINS.startswith(head.rstrip(b"\0"))


def read(path: Path) -> tuple[dict[str, Entry], int]:
    """Return the entries by key, later ones in place of earlier, and how many bytes they take.

    Raises:
        DockairError: it cannot be read; a line is no entry, and not the last one torn.
    """
    entries: dict[str, Entry] = {}
    try:
        size, lines = 0, path.read_bytes().splitlines(keepends=True)
    except OSError as error:
        raise DockairError(str(path), expected="a journal that can be read", got=error.strerror) from None
    for number, line in enumerate(lines, start=1):
        entry = _entry(line)
        if entry is None and (number < len(lines) or _is_whole(line)):
            expected = "an entry of a campaign (`dockair campaign --fresh` begins it anew)"
            raise DockairError(f"{path}:{number}", expected=expected, got=line[:40])
        if entry is not None:
            entries[entry["key"]] = entry
            size += len(line)
    return entries, size


def _is_whole(line: bytes) -> bool:
    """Whether a line was written to its end: what it holds is then of no power cut, as an older version's row."""
    try:
        json.loads(line)
    except (ValueError, RecursionError):
        return False
    return line.endswith(b"\n")


def _entry(line: bytes) -> Entry | None:
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not (line.endswith(b"\n") and isinstance(entry, dict) and is_row(row := entry.get("row"))):
        return None
    timed = isinstance(entry.get("wall_time_s"), int | float)
    return entry if timed and entry.get("key") == f"{row['scenario_hash']}:{row['seed']}" else None
