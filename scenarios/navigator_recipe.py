"""How to make the navigator that flew again, to the last bit of its numbers: `navigator.json` of a recording.

It holds the navigator's class, its calibration sheets and settings, and a digest of its sources, of `nav` and of the
leaves.
"""

import json
import platform
import sys
from dataclasses import dataclass
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self

import dockair
from dockair.calibration import NavigationSheets
from dockair.errors import DockairError
from dockair.messages import Navigates
from dockair.scenarios.class_by_name import by_module
from dockair.scenarios.exact_json import decode, encode
from dockair.scenarios.plug_in import make_navigator, navigator_class_of

NAVIGATOR = "navigator.json"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NavigatorRecipe:
    """How to make the navigator that flew."""

    class_name: str  #: "module:Class", or "file.py:Class"
    sheets: NavigationSheets
    settings: Any = None  #: second argument of the constructor; None leaves it to the class

    def build(self) -> Navigates:
        """Return a new navigator in its first state.

        Raises:
            DockairError: no such class, it is no navigator, or its constructor raises an exception.
        """
        given = (self.sheets,) if self.settings is None else (self.sheets, self.settings)
        return make_navigator(navigator_class_of(self.class_name), *given)

    def write(self, out_dir: Path) -> None:
        """Write `navigator.json`."""
        table = {
            "navigator": self.class_name,
            "code": code_fingerprint(self.class_name),
            "sheets": encode(self.sheets),
            "settings": encode(self.settings),
        }
        (out_dir / NAVIGATOR).write_text(json.dumps(table, indent=1, allow_nan=False) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, out_dir: Path) -> Self:
        """Read `navigator.json`."""
        path = recorded_file(out_dir, NAVIGATOR)
        try:
            table = json.loads(path.read_text(encoding="utf-8"))
            sheets, settings = decode(table["sheets"]), decode(table["settings"])
            return cls(class_name=table["navigator"], sheets=sheets, settings=settings)
        except (ValueError, TypeError, KeyError) as error:  # no JSON, or not what was written there
            got = f"{type(error).__name__}: {error}"
            raise DockairError(str(path), expected="a navigator as a flight records it", got=got) from None


def code_fingerprint(class_name: str) -> str:
    """Return a digest of a navigator's sources, and of Python's and its libraries' versions.

    The sources are those of `nav`, of the leaves that it stands on, and the file of the navigator's own module.

    Args:
        class_name: "module:Class" or "file.py:Class", which has been imported.
    """
    package, module = Path(dockair.__file__).parent, by_module(class_name).partition(":")[0]
    digest = blake2b(digest_size=16)
    for path in sorted([*package.glob("*.py"), *package.joinpath("nav").rglob("*.py")]):
        digest.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    own = getattr(sys.modules.get(module), "__file__", None)
    digest.update(module.encode() + (Path(own).read_bytes() if own else b""))
    for library in ("numpy", "scipy", "numba", "opencv-python-headless", "filterpy"):
        digest.update(f"{library} {version(library)}".encode())
    digest.update(platform.python_version().encode())
    return digest.hexdigest()


def recorded_code(out_dir: str | Path) -> str:
    """Return the `code_fingerprint` of the recording."""
    return str(json.loads(recorded_file(Path(out_dir), NAVIGATOR).read_text(encoding="utf-8")).get("code", ""))


def recorded_file(out_dir: Path, name: str) -> Path:
    """Return the path of a file of a recording.

    Raises:
        DockairError: there is none.
    """
    path = out_dir / name
    if not path.is_file():
        expected = "a flight by camera, recorded with --record window or full"
        raise DockairError(str(path), expected=expected, got="no such file")
    return path
