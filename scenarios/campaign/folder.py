"""A campaign's folder: new, empty, or an earlier campaign's; somebody else's files are never touched."""

import os
from pathlib import Path

from dockair.errors import DockairError
from dockair.scenarios.campaign import journal, manifest, table
from dockair.scenarios.whole_file import PART, make_folder

SUMMARY, TIMING = "summary.json", "timing.json"
RESULTS = (table.FILE_NAME, SUMMARY, TIMING)  #: written at the end
REPORT = "report.html"  #: `dockair report` writes it there unless it is told otherwise
_OWN = (journal.FILE_NAME, manifest.FILE_NAME, *RESULTS)


def default_folder(plan_name: str) -> Path:
    """Return out/campaigns/<plan>."""
    return Path("out") / "campaigns" / plan_name


def make(folder: Path, *, fresh: bool = False) -> None:
    """Make the folder, or refuse it; what is in it stays as it is.

    Other programs, too, write a manifest.json or a summary.json. A campaign's folder is known by its journal, which is
    there before any other file.

    Args:
        folder: to be written to.
        fresh: what was flown there is forgotten, so that a journal damaged in its first line, which its manifest says
            is one, is no matter.

    Raises:
        DockairError: a file, a folder with other files and no campaign, or one that cannot be made.
    """
    check(folder, fresh=fresh)
    try:
        make_folder(folder)
    except OSError as error:
        raise DockairError(f"--out {folder}", expected="a folder that can be written", got=error.strerror) from None


def check(folder: Path, *, fresh: bool = False) -> None:
    """Refuse what `make` would, as far as can be told without making anything.

    Args:
        folder: as of `make`.
        fresh: as of `make`.

    Raises:
        DockairError: as `make`.
    """
    where = f"--out {folder}"
    expected = f"a new or empty folder, or one with the {journal.FILE_NAME} of an earlier campaign"
    try:
        if folder.exists() and not folder.is_dir():
            raise DockairError(where, expected=expected, got="a file")
        present = _names_in(folder)
        if present and journal.FILE_NAME not in present:
            raise DockairError(where, expected=expected, got=f"a folder with {present[0]}")
        damaged = bool(present) and not journal.begins_like_one(folder / journal.FILE_NAME)
        if damaged and not (fresh and _has_manifest(folder)):
            raise DockairError(where, expected=expected, got=f"a folder with another {journal.FILE_NAME}")
    except OSError as error:
        raise DockairError(where, expected="a folder that can be written", got=error.strerror) from None


def _names_in(folder: Path) -> list[str]:
    """What is in a folder; nothing where there is none.

    Raises:
        OSError: there cannot be one.
    """
    try:
        return sorted(os.listdir(folder))
    except FileNotFoundError:
        return []


def _has_manifest(folder: Path) -> bool:
    try:
        return "scenarios" in manifest.read_manifest(folder)["plan"]
    except DockairError:
        return False


def is_own_file(path: Path) -> bool:
    """Whether a path is a campaign's own file, which nobody else may write: by its name, beside rows."""
    path = Path(os.path.realpath(path))
    rows = (path.with_name(name) for name in (journal.FILE_NAME, table.FILE_NAME))
    return path.name.removesuffix(PART) in _OWN and any(map(os.path.lexists, rows))


def remove_parts(folder: Path) -> None:
    """Remove what a campaign that was killed has half written; only for who holds the journal's lock.

    Raises:
        DockairError: the folder cannot be written.
    """
    parts = [folder / (name + PART) for name in (manifest.FILE_NAME, *RESULTS)]
    try:
        parts[0].touch()  # can files be made here? better asked now than after the flights
        for part in parts:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise DockairError(f"--out {folder}", expected="a folder that can be written", got=error.strerror) from None


def remove_results(folder: Path) -> None:
    """Remove table, summary, timing and report: they are of other flights than the journal, which `rows_of` reads."""
    for name in (*RESULTS, REPORT):
        (folder / name).unlink(missing_ok=True)


def rows_of(folder: str | Path) -> list[dict[str, object]]:
    """Return the rows of a campaign, of one that is not over those that are done, in the order in which they were.

    Raises:
        DockairError: there is no campaign, or its files are damaged.
    """
    folder = Path(folder)
    if os.path.isfile(folder / table.FILE_NAME):
        return table.read_table(folder)
    return [entry["row"] for entry in entries_of(folder).values()]


def entries_of(folder: Path) -> dict[str, journal.Entry]:
    """Return what a folder's journal holds.

    Raises:
        DockairError: there is none, it cannot be read, or it is damaged.
    """
    path = folder / journal.FILE_NAME
    if not os.path.isfile(path):  # Path.is_file raises where a name is too long
        raise DockairError(str(folder), expected="the folder of a campaign", got="no journal in it")
    return journal.read(path)[0]
