"""Writes a file whole or not at all, whenever the process is killed or the power goes."""

import errno
import os
from pathlib import Path

from dockair.errors import DockairError, MachineError

PART = ".part"  #: ends the name of a file that is being written
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  #: of an OSError, where the disk is to blame
_NO_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS)  # of a file system that waits for files alone


def write_whole(path: Path, data: bytes) -> None:
    """Write a file beside its place, wait for the disk, and put it there; a power cut takes it no more.

    Raises:
        MachineError: there is no room; what was there is as it was.
        OSError: the disk fails.
    """
    part = path.with_name(path.name + PART)
    try:
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)  # it takes room, and there may be none
        if error.errno not in NO_ROOM:
            raise
        remedy = "make some and give the same command again: what was there before is kept"
        raise MachineError(str(path), expected="room to write", remedy=remedy) from None
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Wait until the disk has what a folder's files are called.

    A file that was made or renamed may else be gone, or have its old name, after a power cut, though the disk has all
    that it holds. Rows that are added to a file change no name.

    Raises:
        OSError: the disk fails.
    """
    try:
        file = os.open(folder, os.O_RDONLY)
    except PermissionError:  # Windows opens no folder, and nobody one that may be written and not read: the files in it
        return  # are whole all the same, and there is no other way to wait for their names
    try:
        os.fsync(file)
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise
    finally:
        os.close(file)


def make_folder(folder: Path) -> None:
    """Make a folder, and those that it is in, where there is none; they outlive a power cut.

    Raises:
        OSError: it cannot be made.
    """
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for made in missing:
        sync_folder(made.parent)


def write_text(text: str, path: Path) -> Path:
    """Write a file that a person has named, whole or not at all, and return its path.

    Folders that are missing are made. A link stays one; what is no file (/dev/null, a pipe) takes the text as it is.

    Raises:
        DockairError: it cannot be written there.
        MachineError: there is no room.
    """
    where, expected = str(path), "a file that can be written"
    try:
        if path.is_dir():
            raise DockairError(where, expected=expected, got="a folder")
        make_folder(path.parent)
        if path.exists() and not path.is_file():
            path.write_text(text, encoding="utf-8")
        else:
            write_whole(Path(os.path.realpath(path)), text.encode())
    except OSError as error:
        if error.errno in NO_ROOM:
            raise MachineError(where, expected="room to write", remedy="make some") from None
        raise DockairError(where, expected=expected, got=error.strerror) from None
    return path
