"""Locks on files, for what one process at a time writes: a lock ends with the process that took it, however that ends.

A lock is the open file's, and a fork has the file open, too: it would hold the lock on after its parent was killed. So
a fork closes the file of a `LockFile`, which leaves the lock to its parent.
"""

import fcntl
import os
from pathlib import Path


def has_locked(file: int) -> bool:
    """Lock an open file until it is closed, or return False where another has locked it.

    Raises:
        OSError: its file system knows no locks.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


class LockFile:
    """A file that is there, and locked, while something is written beside it.

    Args:
        path: of the file; one that a process that was killed has left is no obstacle.

    Raises:
        BlockingIOError: another has it.
        OSError: it cannot be made or locked.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: int | None = _locked(path)
        _held.add(self)

    @property
    def is_held(self) -> bool:
        """Whether it is this process that has it."""
        return self._file is not None

    def release(self) -> None:
        """Remove the file, then let go of it."""
        if self.is_held:
            try:
                self._path.unlink(missing_ok=True)
            finally:
                self.close()

    def close(self) -> None:
        """Let go of the file and leave it where it is."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
            _held.discard(self)


_held: set[LockFile] = set()


def _locked(path: Path) -> int:
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            if not has_locked(file):
                raise BlockingIOError(f"{path} is locked")
            if _is_at(path, file):
                return file
        except BaseException:
            os.close(file)
            raise
        os.close(file)  # whoever had it removed it meanwhile, and another may have made it anew


def _is_at(path: Path, file: int) -> bool:
    try:
        return os.path.samestat(os.stat(path), os.fstat(file))
    except FileNotFoundError:
        return False


def _leave_to_parent() -> None:
    for lock in list(_held):
        lock.close()


os.register_at_fork(after_in_child=_leave_to_parent)
