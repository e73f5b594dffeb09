"""Writes a file whole or not at all, whenever the process is killed."""

import errno
import os
from pathlib import Path

from dockair.errors import MachineError

PART = ".part"  #: ends the name of a file that is being written
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  #: of an OSError, where the disk is to blame


def write_whole(path: Path, data: bytes) -> None:
    """Write a file beside its place, wait for the disk, and put it there.

    Raises:
        MachineError: there is no room; what was there is as it was.
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
