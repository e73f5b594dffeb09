"""The code that flies a campaign: every file that decides a flight or its row, and whether one has changed meanwhile.

Processes begin all through a campaign, and each imports the sources and reads the sheets as they are at that moment.
The files are therefore looked at again before a process begins and before a row is written down: whatever the journal
holds was flown by the code that the manifest names.
"""

import importlib
import os
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from hashlib import blake2b
from itertools import accumulate
from pathlib import Path

import dockair
from dockair.errors import DockairError
from dockair.scenarios.assembly.measured import FITTED_IN
from dockair.scenarios.campaign.jobs import Job

#: What of `scenarios` decides neither a flight nor its row; whatever is not named here counts. Plans, the library and
#: what reads plans are in the jobs' keys, but for what of the library decides flights of other scenarios.
_NOT_FLOWN = frozenset(
    # commands, pages, pictures; files that a flight of a campaign does not write, and how a file is written
    "allan_tool.py bench cli.py commands design_ring display.py doctor.py envs file_lock.py judgement/no_attempt.py "
    "library message_log.py output_folder.py parameters_page.py picture plans recording replay.py report reproduce "
    "reproductions_page.py statistics.py std_streams.py studio.py whole_file.py "
    # of the campaign what plans before its flights, or keeps, counts and shows their rows as they are
    "campaign/code.py campaign/copies.py campaign/draws.py campaign/dry_run.py campaign/folder.py campaign/gate.py "
    "campaign/journal.py campaign/manifest.py campaign/plan.py campaign/plan_file.py campaign/points.py "
    "campaign/progress.py campaign/summary.py campaign/table.py".split()
)
_OF_ALL = f"library/{FITTED_IN}.toml"  # its light, against which `assembly.measured` holds a scenario's own
_NO_SOURCES = (".pyc", ".nbi", ".nbc", ".md", "~", "#")  # ends of names: caches, documents, what editors leave
_OURS, _SHEETS = "dockair", "sheets"
_SETTLED_NS = 2_000_000_000  # a file younger than the ticks of any file system's clock may change and look the same

Name = tuple[str, str]  #: whose a file is, and what it is called there


class Code:
    """The files that decide a campaign's flights, as they were when it began.

    Args:
        modules: of navigators of one's own.
        sheets: paths that the scenarios name; the jobs' keys have them, so that they are in no digest here.
    """

    def __init__(self, modules: Iterable[str] = (), sheets: Iterable[str] = ()) -> None:
        self._modules, self._sheets = sorted(set(modules)), sorted(set(sheets))
        self._known: dict[Path, tuple[tuple[int, ...], str]] = {}
        self._begun = self._contents()

    @property
    def digest(self) -> str:
        """Digest of Dockair's files."""
        return self._digest_of(_OURS)

    @property
    def plug_ins(self) -> dict[str, str]:
        """Module -> digest, of navigators of one's own."""
        return {module: self._digest_of(module) for module in self._modules}

    def require_unchanged(self, where: str) -> None:
        """Refuse to go on when a file is not as it was.

        Args:
            where: the campaign's folder, as its user would write it.

        Raises:
            DockairError: one has changed, has come or has gone.
        """
        now = self._contents()
        names = self._begun.keys() | now.keys()
        changed = sorted(name for name in names if self._begun.get(name) != now.get(name))
        if changed:
            expected = "the code that the campaign began with (restored, the same command goes on; --fresh begins anew)"
            others = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
            raise DockairError(where, expected=expected, got=f"a change of {changed[0][1]}{others}")

    def _contents(self) -> dict[Name, str]:
        files: dict[Name, Path] = {(_OURS, name): path for name, path in dockair_files().items()}
        for module in self._modules:
            files |= {(module, name): path for name, path in plug_in_files(module).items()}
        files |= {(_SHEETS, path): Path(path) for path in self._sheets}
        return {name: self._content(path) for name, path in files.items()}

    def _content(self, path: Path) -> str:
        """Return a digest of a file, read again only where its entry in the folder has changed; "" of none."""
        try:
            stat = path.stat()
            entry = (stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)
            known = self._known.get(path)
            if known is not None and known[0] == entry:
                return known[1]
            content = blake2b(path.read_bytes(), digest_size=16).hexdigest()
        except (FileNotFoundError, NotADirectoryError):
            return ""
        if time.time_ns() - max(stat.st_mtime_ns, stat.st_ctime_ns) > _SETTLED_NS:
            self._known[path] = entry, content
        return content

    def _digest_of(self, owner: str) -> str:
        digest = blake2b(digest_size=8)
        for (whose, name), content in sorted(self._begun.items()):
            if whose == owner:
                digest.update(f"{name}\0{content}\0".encode())
        return digest.hexdigest()


def code_of(jobs: Sequence[Job]) -> Code:
    """Return the code that flies the jobs."""
    sheets = {path for job in jobs for path in (job.scenario.hardware.camera, job.scenario.hardware.ring) if path}
    return Code({job.plug_in for job in jobs if job.plug_in}, sheets)


def dockair_files() -> dict[str, Path]:
    """Return Dockair's files that decide a flight or its row: world, sensors, navigation, loop, parameters, worker."""
    package = Path(dockair.__file__).parent
    found = {f"{package.name}/{path.name}": path for path in package.glob("*.py")}
    for folder in (package / name for name in ("sim", "nav", "scenarios", "assets")):
        for path in _files_below(folder):
            name = path.relative_to(folder).as_posix()
            if folder.name != "scenarios" or _is_flown(name):
                found[f"{folder.name}/{name}"] = path
    return found


def _is_flown(name: str) -> bool:
    """Whether a file of `scenarios` decides a flight or its row."""
    return name == _OF_ALL or not {name, name.partition("/")[0]} & _NOT_FLOWN


def plug_in_files(module: str) -> dict[str, Path]:
    """Return the sources of somebody's module: its file, and every .py of the outermost package that it is in."""
    file = importlib.import_module(module).__file__
    own = {} if file is None else {Path(file).name: Path(file)}
    for name in accumulate(module.split("."), "{}.{}".format):
        package = sys.modules[name]
        if hasattr(package, "__path__") and package.__file__:  # a folder without __init__.py is nobody's package
            root = Path(package.__file__).parent
            sources = (path for path in _files_below(root) if path.suffix == ".py")
            return own | {path.relative_to(root.parent).as_posix(): path for path in sources}
    return own


def _files_below(folder: Path) -> Iterator[Path]:
    """Yield the files of a folder and of those in it; neither caches nor what is hidden."""
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name != "__pycache__" and not name.startswith(".")]
        yield from (Path(place, name) for name in names if not name.startswith(".") and not name.endswith(_NO_SOURCES))
