"""A campaign's folder: new, empty, or an earlier campaign's; somebody else's files are never touched."""

from pathlib import Path

from dockair.errors import DockairError
from dockair.scenarios.campaign import journal, manifest, table
from dockair.scenarios.campaign.whole_file import PART

SUMMARY, TIMING = "summary.json", "timing.json"
FILES = (manifest.FILE_NAME, journal.FILE_NAME, table.FILE_NAME, SUMMARY, TIMING)
_PARTS = tuple(name + PART for name in FILES)  # left by a campaign that was killed while it wrote


def default_folder(plan_name: str) -> Path:
    """Return out/campaigns/<plan>."""
    return Path("out") / "campaigns" / plan_name


def prepare(folder: Path) -> None:
    """Make the folder, or refuse it; remove what was half written.

    Raises:
        DockairError: a file, a folder with other files and no campaign, or one that cannot be written.
    """
    where, expected = f"--out {folder}", "a new or empty folder, or one with an earlier campaign"
    if folder.exists() and not folder.is_dir():
        raise DockairError(where, expected=expected, got="a file")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        present = sorted(path.name for path in folder.iterdir())
        if present and not set(present) & {*FILES, *_PARTS}:
            raise DockairError(where, expected=expected, got=f"a folder with {present[0]}")
        for name in _PARTS:
            (folder / name).unlink(missing_ok=True)
        probe = folder / (manifest.FILE_NAME + PART)
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise DockairError(where, expected="a folder that can be written", got=error.strerror) from None


def rows_of(folder: Path) -> list[dict[str, object]]:
    """Return the rows of a campaign, of one that is not over those that are done, in the order in which they were.

    Raises:
        DockairError: there is no campaign.
    """
    if (folder / table.FILE_NAME).is_file():
        return table.read_table(folder)
    path = folder / journal.FILE_NAME
    if not path.is_file():
        raise DockairError(str(folder), expected="the folder of a campaign", got="no journal in it")
    return [entry["row"] for entry in journal.read(path)[0].values()]
