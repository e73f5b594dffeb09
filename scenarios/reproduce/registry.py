"""What can be reproduced, by id.

A reproduction is a function of a folder for its picture, or None for no picture. It returns

    {"id": ..., "source": ..., "rows": [{"case": ..., "ours": {...}, "reference": {...}}]}

with units in the keys; `ours` has every key of `reference`. A module of this folder's folders, which are called as the
first part of the id, is one when it has ID, TITLE and `reproduce`, or several when it has REPRODUCTIONS, id -> (title,
function); no other list names it.
"""

import pkgutil
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios import reproduce as _package
from dockair.scenarios.output_folder import made_folder

Reproduction = Callable[[Path | None], dict[str, Any]]


def _found() -> dict[str, tuple[str, Reproduction]]:
    """Id -> title and function, of every module in the folders beside this one."""
    found: dict[str, tuple[str, Reproduction]] = {}
    for info in pkgutil.walk_packages(_package.__path__, f"{_package.__name__}."):
        if info.ispkg or info.name == __name__:
            continue
        module = import_module(info.name)
        found |= getattr(module, "REPRODUCTIONS", {})
        if hasattr(module, "ID"):
            found[module.ID] = module.TITLE, module.reproduce
    return found


_REPRODUCTIONS = _found()


def ids() -> tuple[str, ...]:
    """Return the ids, sorted."""
    return tuple(sorted(_REPRODUCTIONS))


def titles() -> dict[str, str]:
    """Return what each id shows."""
    return {wanted: _REPRODUCTIONS[wanted][0] for wanted in ids()}


def reproduce(wanted: str, out: Path | None = None) -> dict[str, Any]:
    """Run one reproduction; with `out`, a folder that need not exist, its picture is put there.

    Raises:
        DockairError: no such id, or a folder that cannot be written.
    """
    if wanted not in _REPRODUCTIONS:
        raise DockairError("reproduce", expected="the id of a reproduction", got=wanted, exists=ids())
    if out is not None:
        made_folder(out)
    return _REPRODUCTIONS[wanted][1](out)
