"""A class by its name: "module:Class" of a module that is installed or where one stands, "file.py:Class" by its file.

The module of a file is called as the file is, without ".py". A process has one module of a name: a second file of the
same name is refused, and so is a file beside it that would be taken for one beside another navigator.
"""

import importlib
import keyword
import os
import sys
import traceback
from pathlib import Path
from typing import Any

from dockair.errors import DockairError

_PYTHON = ".py"
_BY_FILE: set[str] = set()  # folders that a module was imported from by its file


def name_of(cls: type[Any]) -> str:
    """Return "module:Class"."""
    return f"{cls.__module__}:{cls.__qualname__}"


def file_and_class(name: str) -> tuple[str, str]:
    """Return the path in "file.py:Class" and the class; "" for the path where a module is named."""
    file, _, path = name.rpartition(":")
    return (file, path) if file.endswith(_PYTHON) else ("", name.partition(":")[2])


def by_module(name: str) -> str:
    """Return "module:Class" of a class that may be named by its file: however its path is written, it is the same."""
    file, path = file_and_class(name)
    return f"{Path(file).stem}:{path}" if file else name


def import_by_name(name: str) -> Any:
    """Return the class called "module:Class" or "file.py:Class".

    Raises:
        DockairError: there is none, its module raises an exception, or another file's module has its name.
    """
    file, path = file_and_class(name)
    module = by_module(name).partition(":")[0]
    expected = 'an importable "module:Class"'
    if file:
        expected = f"a class in {file}"
        _prepare(file, module)
    try:
        found: Any = importlib.import_module(module)
    except (Exception, SystemExit) as error:  # somebody's own module may raise anything, and may end the process
        if _is_no_module(module, error):
            raise DockairError(name, expected=expected, got=str(error)) from None
        raise DockairError(name, expected=expected, got=said_by(error, module.partition(".")[0])) from error
    if file:
        _require_from(found, file)
    try:
        for part in path.split("."):
            found = getattr(found, part)
    except AttributeError as error:
        raise DockairError(name, expected=expected, got=str(error)) from None
    return found


def require_importable(file: str) -> None:
    """Refuse a file that is none, or whose name no module has.

    Raises:
        DockairError: one of these.
    """
    if not os.path.isfile(file):  # False, too, where nobody may look
        raise DockairError(file, expected="the path of a Python file", got=f"{file}, where no file is")
    module = Path(file).stem
    if not module.isidentifier() or keyword.iskeyword(module):
        expected = "a file that is named as a module may be: of letters, digits and _"
        raise DockairError(file, expected=expected, got=Path(file).name)


def _prepare(file: str, module: str) -> None:
    """Put a file's folder first on the path of imports, unless it has been imported already."""
    require_importable(file)
    if module in sys.modules:
        _require_from(sys.modules[module], file)
        return
    folder = os.path.realpath(Path(file).parent)
    for beside in sorted(Path(folder).glob(f"*{_PYTHON}")):
        other = getattr(sys.modules.get(beside.stem), "__file__", None)
        if other and os.path.dirname(os.path.realpath(other)) in _BY_FILE - {folder}:
            _refuse_namesake(beside.stem, str(beside), other)
    _BY_FILE.add(folder)
    sys.path.insert(0, folder)
    importlib.invalidate_caches()  # the file may be newer than what is known of its folder


def _require_from(module: Any, file: str) -> None:
    """Refuse a module of the same name out of another file."""
    imported = getattr(module, "__file__", None)
    if not imported or os.path.realpath(imported) != os.path.realpath(file):
        _refuse_namesake(module.__name__, file, imported or "Python itself")


def _refuse_namesake(module: str, file: str, imported: str) -> None:
    expected = f"a file of another name: in one process there is one module {module}"
    raise DockairError(file, expected=expected, got=f"{module} imported from {imported} before")


def _is_no_module(module: str, error: BaseException) -> bool:
    """Whether there is no module of this name, rather than one that fails."""
    if isinstance(error, ModuleNotFoundError):
        return error.name is not None and f"{module}.".startswith(f"{error.name}.")
    return module in ("", ".") or module.startswith(".")


def said_by(error: BaseException, package: str = "") -> str:
    """Return what an exception says, and where it was raised, in one line.

    Args:
        error: that was raised.
        package: whose deepest line is named if it had a part in it, rather than that of the library it called.
    """
    said = " ".join(f"{type(error).__name__}: {error}".split())
    if isinstance(error, SyntaxError):  # it names the place itself
        return said
    calls = list(traceback.walk_tb(error.__traceback__))
    own = [call for call in calls if str(call[0].f_globals.get("__name__")).partition(".")[0] == package]
    frame, line = (own or calls)[-1]
    return f"{said} ({frame.f_code.co_filename}, line {line})"
