"""TOML files that are asked for by name or by path: the packaged ones of one kind, how to find, show and read them."""

import json
import os
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from dockair.errors import DockairError


@dataclass(frozen=True, slots=True)
class TomlFiles:
    """Files of one kind."""

    kind: str  #: what one of them is called in an error
    packaged: str  #: what a packaged one is called in an error
    subfolder: str  #: of the package, that holds those with a name
    command: str  #: of the command line, that one is for

    @property
    def folder(self) -> Path:
        """Where the packaged files are."""
        return Path(str(files("dockair.scenarios"))) / self.subfolder

    def names(self) -> list[str]:
        """Names of the packaged files, the default first."""
        return sorted((path.stem for path in self.folder.glob("*.toml")), key=lambda name: (name != "default", name))

    def find(self, name_or_path: str | Path) -> Path:
        """Return the path of a file.

        Args:
            name_or_path: a name among the packaged files, or the path of a TOML file.

        Raises:
            DockairError: no such file.
        """
        path = Path(name_or_path)
        if isinstance(name_or_path, str) and path.suffix.lower() != ".toml" and os.sep not in name_or_path:
            other = PLANS if self is SCENARIOS else SCENARIOS
            if name_or_path in other.names():
                raise other.misplaced(self.kind, self.kind, name_or_path)
            if name_or_path not in self.names():
                expected = f"{self.packaged}, or the path of a TOML file"
                raise DockairError(self.kind, expected=expected, got=name_or_path, exists=self.names())
            return self.folder / f"{name_or_path}.toml"
        if not os.path.exists(path):  # Path.exists raises where a name is too long
            raise DockairError(str(path), expected=f"a {self.kind} file", got="no such file")
        return path

    def shown(self, path: Path) -> str:
        """Return what an error calls a file that was found: the packaged ones by their name."""
        return path.name if path.parent == self.folder else str(path)

    def misplaced(self, where: str, wanted: str, given: str | Path) -> DockairError:
        """Return the refusal of one of these where another kind is wanted.

        Args:
            where: it was given.
            wanted: kind.
            given: its name or path.
        """
        return DockairError(where, expected=f"a {wanted}", got=f"a {self.kind}, for dockair {self.command} {given}")


SCENARIOS = TomlFiles("scenario", "a scenario of the library", "library", "fly")
PLANS = TomlFiles("plan", "a packaged plan", "plans", "campaign")


def read_toml(path: Path) -> dict[str, Any]:
    """Return a file's table.

    Args:
        path: of the file.

    Raises:
        DockairError: not TOML, or not to be read.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))  # some editors begin a file with a byte order mark
    except (ValueError, RecursionError) as error:  # not TOML, not UTF-8; a number of 5000 digits, brackets 1000 deep
        raise DockairError(str(path), expected="TOML", got=str(error)) from None
    except OSError as error:
        raise DockairError(str(path), expected="a file that can be read", got=error.strerror) from None


def toml_value(text: str) -> object:
    """Return the value that a text of the command line means."""
    try:
        table = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text  # a shell has eaten the quotes, or a name that needs none
    return table["value"] if len(table) == 1 else text


def toml_text(text: str) -> str:
    """Return a text as TOML writes it in one line, in quotes."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")  # TOML's strings, but for this one
