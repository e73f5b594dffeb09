"""Where results are written: a flight's into an empty folder or over an earlier flight, never over others' files."""

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


def default_output_folder(scenario_name: str, seed: int) -> Path:
    """Return out/<scenario>-<seed>."""
    return Path("out") / f"{scenario_name}-{seed}"


def check_output_folder(folder: Path) -> None:
    """Refuse a folder that no flight may be written to; change nothing.

    Raises:
        DockairError: it is not a folder, or holds files but no flight.
    """
    expected = "a new or empty folder, or one with an earlier flight"
    if folder.exists() and not folder.is_dir():
        raise DockairError(f"--out {folder}", expected=expected, got="a file")
    present = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    if present and not set(present) & set(FLIGHT_FILES):
        raise DockairError(f"--out {folder}", expected=expected, got=f"a folder with {present[0]}")


def prepare_output_folder(folder: Path) -> None:
    """Make the folder, and remove an earlier flight's files from it; other files stay.

    Raises:
        DockairError: as `check_output_folder`, or it cannot be written.
    """
    try:
        check_output_folder(folder)
        for name in FLIGHT_FILES:
            (folder / name).unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / "result.json"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise DockairError(f"--out {folder}", expected="a folder that can be written", got=error.strerror) from None


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
