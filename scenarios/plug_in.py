"""A navigator of one's own, named in a scenario: what it has to be, before anything is flown with it."""

import inspect
from collections.abc import Callable
from typing import Any

from dockair.errors import DockairError
from dockair.messages import Navigates
from dockair.scenarios.exact_json import import_by_name


def navigator_class_of(name: str) -> Callable[..., Navigates]:
    """Return a navigator's class by its name.

    Raises:
        DockairError: there is none, or it is no navigator: no class, without `step`, or not made of the sheets.
    """
    found = import_by_name(name)
    got = "" if isinstance(found, type) else f"an object of {type(found).__name__}"
    if not got and not callable(getattr(found, "step", None)):
        got = "a class without step"
    if not got and not _takes_one(found):
        got = f"a constructor that takes {inspect.signature(found)}"
    if got:
        expected = "a class that is made of (sheets) and has step(imu, frame) -> NavSolution"
        raise DockairError(name, expected=expected, got=got)
    return found  # type: ignore[no-any-return]


def _takes_one(made: Callable[..., Any]) -> bool:
    """Whether it can be called with one argument; what says nothing of its arguments is believed to."""
    try:
        inspect.signature(made).bind(None)
    except TypeError:
        return False
    except ValueError:
        return True
    return True
