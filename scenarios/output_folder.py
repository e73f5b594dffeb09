"""Where results are written: a flight's into an empty folder or over an earlier flight, never over others' files.

An earlier flight is replaced by a whole one only: while a flight goes on its files are in a folder within, and a lock
keeps other flights out. Files are put in place one by one; `result.json`, which says that a flight is whole, is the
first to go and the last to come.
"""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dockair.errors import DockairError
from dockair.scenarios.file_lock import LockFile

_SAYS_WHOLE = "result.json"  # of a flight's files: where it is, all the others are, and of the same flight

#: What a flight writes, in the order in which it is put in place; only these are ever replaced.
FLIGHT_FILES = (
    "episode.rrd",
    "flight.parquet",
    "flight.png",
    "messages.parquet",
    "estimates.parquet",
    "navigator.json",
    "as_built.json",
    "scenario_camera.toml",
    "scenario_ring.toml",
    "scenario.toml",
    _SAYS_WHOLE,
)

_UNDER_WAY, _LOCK = ".flight", ".flight.lock"  # what a flight that was killed has left is the next one's to remove


def default_output_folder(scenario_name: str, seed: int) -> Path:
    """Return out/<scenario>-<seed>."""
    return Path("out") / f"{scenario_name}-{seed}"


def check_output_folder(folder: Path) -> None:
    """Refuse a folder that no flight may be written to; change nothing.

    Raises:
        DockairError: it is not a folder, or holds files but no flight, or a folder in the place of a flight's file.
    """
    expected = "a new or empty folder, or one with an earlier flight"
    try:
        if folder.exists() and not folder.is_dir():
            raise DockairError(f"--out {folder}", expected=expected, got="a file")
        present = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
        in_the_way = [name for name in present if name in FLIGHT_FILES and (folder / name).is_dir()]
    except OSError as error:
        raise DockairError(f"--out {folder}", expected=expected, got=error.strerror) from None
    if present and not set(present) & {*FLIGHT_FILES, _UNDER_WAY, _LOCK}:
        raise DockairError(f"--out {folder}", expected=expected, got=f"a folder with {present[0]}")
    if in_the_way:
        raise DockairError(f"--out {folder / in_the_way[0]}", expected="a file, or nothing", got="a folder")


class FlightFolder:
    """A folder while a flight is being written to it; no other flight may be, until this one is kept or forgotten.

    Args:
        folder: made if there is none; what is there stays until the flight is kept.

    Attributes:
        under_way: empty folder within, for the flight's files.

    Raises:
        DockairError: as `check_output_folder`, or it cannot be written, or another flight is being written there.
    """

    def __init__(self, folder: Path) -> None:
        check_output_folder(folder)
        self._folder, self.under_way = folder, folder / _UNDER_WAY
        where = f"--out {folder}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = LockFile(folder / _LOCK)
            try:
                if self.under_way.exists():
                    shutil.rmtree(self.under_way)
                self.under_way.mkdir()
            except BaseException:
                self._lock.release()
                raise
        except BlockingIOError:
            got = "another flight is being written there"
            raise DockairError(where, expected="a folder for this flight alone", got=got) from None
        except OSError as error:
            raise DockairError(where, expected="a folder that can be written", got=error.strerror) from None

    def keep(self) -> None:
        """Put the files of the flight that is over in the place of an earlier one's; other files stay."""
        written = {path.name for path in self.under_way.iterdir()}
        (self._folder / _SAYS_WHOLE).unlink(missing_ok=True)  # the earlier flight's: soon it is not whole
        for name in FLIGHT_FILES:
            if name in written:
                (self.under_way / name).replace(self._folder / name)
            else:
                (self._folder / name).unlink(missing_ok=True)
        self.forget()

    def forget(self) -> None:
        """Remove what a flight that came to nothing has written; one that is kept, or another's, stays."""
        if self._lock.is_held:
            shutil.rmtree(self.under_way, ignore_errors=True)
            self._lock.release()


def is_flights_file(path: Path) -> bool:
    """Whether a path is a flight's own file, which nobody else may write: by its name, beside another such file."""
    path = Path(os.path.realpath(path))
    others = (path.with_name(name) for name in FLIGHT_FILES if name != path.name)
    return path.name in FLIGHT_FILES and any(map(os.path.lexists, others))


@contextmanager
def utf8_path_of(folder: Path) -> Iterator[Path]:
    """Give a path of a folder for who takes no other than UTF-8: its own, or a link's that is removed afterwards."""
    if _is_utf8(str(folder)):
        yield folder
        return
    with tempfile.TemporaryDirectory() as elsewhere:
        link = Path(elsewhere) / "folder"
        link.symlink_to(folder.absolute())
        yield link


def _is_utf8(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def made_folder(folder: Path) -> Path:
    """Return the folder, made if there was none and tried: better asked now than after what is to be written there.

    Raises:
        DockairError: it cannot be made, or no file in it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise DockairError(f"--out {folder}", expected="a folder that can be written", got=error.strerror) from None
    return folder
