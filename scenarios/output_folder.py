"""Where results are written: a flight's into an empty folder or over an earlier flight, never over others' files.

An earlier flight is replaced by a whole one only: while a flight goes on its files are in a folder within.
"""

import shutil
import tempfile
from pathlib import Path

from dockair.errors import DockairError

#: What a flight writes; only these are ever replaced.
FLIGHT_FILES = (
    "result.json",
    "episode.rrd",
    "flight.parquet",
    "flight.png",
    "messages.parquet",
    "estimates.parquet",
    "navigator.json",
    "as_built.json",
)


_UNDER_WAY = ".flight"  # what a flight that was killed has left is the next one's to remove


def default_output_folder(scenario_name: str, seed: int) -> Path:
    """Return out/<scenario>-<seed>."""
    return Path("out") / f"{scenario_name}-{seed}"


def check_output_folder(folder: Path) -> None:
    """Refuse a folder that no flight may be written to; change nothing.

    Raises:
        DockairError: it is not a folder, or holds files but no flight.
    """
    expected = "a new or empty folder, or one with an earlier flight"
    try:
        if folder.exists() and not folder.is_dir():
            raise DockairError(f"--out {folder}", expected=expected, got="a file")
        present = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    except OSError as error:
        raise DockairError(f"--out {folder}", expected=expected, got=error.strerror) from None
    if present and not set(present) & {*FLIGHT_FILES, _UNDER_WAY}:
        raise DockairError(f"--out {folder}", expected=expected, got=f"a folder with {present[0]}")


def prepare_output_folder(folder: Path) -> Path:
    """Make the folder, and return one within for the files of the flight that begins; what is there stays.

    Raises:
        DockairError: as `check_output_folder`, or it cannot be written.
    """
    try:
        check_output_folder(folder)
        under_way = folder / _UNDER_WAY
        if under_way.exists():
            shutil.rmtree(under_way)
        under_way.mkdir(parents=True)
    except OSError as error:
        raise DockairError(f"--out {folder}", expected="a folder that can be written", got=error.strerror) from None
    return under_way


def keep_flight(folder: Path) -> None:
    """Put the files of the flight that is over in the place of an earlier one's; other files stay."""
    written = {path.name for path in (folder / _UNDER_WAY).iterdir()}
    for name in FLIGHT_FILES:
        if name in written:
            (folder / _UNDER_WAY / name).replace(folder / name)
        else:
            (folder / name).unlink(missing_ok=True)
    forget_flight(folder)


def forget_flight(folder: Path) -> None:
    """Remove what a flight that came to nothing has written."""
    shutil.rmtree(folder / _UNDER_WAY, ignore_errors=True)


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
