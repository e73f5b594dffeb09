"""A navigator of one's own, named in a scenario: what it has to be, and what is said when it fails.

An exception out of somebody's own navigator is that somebody's mistake: one line that names the place. One out of
Dockair's navigators is a mistake of ours and keeps its traceback. What is logged shares no array with somebody's own
navigator, which may overwrite those that it keeps from one tick to the next.
"""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.messages import (
    CameraFrame,
    ImuSample,
    LedObservation,
    Navigates,
    NavSolution,
    PodSignal,
    TankerAnnouncement,
)
from dockair.scenarios.answer import check_answer
from dockair.scenarios.class_by_name import import_by_name, name_of, said_by

T = TypeVar("T")


def navigator_class_of(name: str) -> Callable[..., Navigates]:
    """Return a navigator's class by its name, or by its file's.

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


def make_navigator(navigator_class: Callable[..., Navigates], *given: Any) -> Navigates:
    """Return a navigator, made of what it is given.

    Raises:
        DockairError: it is somebody's own, and its constructor raises an exception.
    """
    made = _called(navigator_class, "a navigator that can be made of the sheets", navigator_class, *given)
    if not callable(getattr(made, "step", None)):  # a class may make anything
        expected = "a navigator with step(imu, frame)"
        raise DockairError(name_of(navigator_class), expected=expected, got=type(made).__name__)  # type: ignore[arg-type]
    return made


def step_navigator(
    navigator: Navigates, imu: Sequence[ImuSample], frame: CameraFrame | LedObservation | None
) -> NavSolution:
    """Return what a navigator answers in a control tick.

    Raises:
        DockairError: it is somebody's own and raises an exception, or answers something else than a NavSolution whose
            fields are what `dockair.messages` says.
    """
    is_ours = _is_ours(type(navigator))
    if not is_ours:
        imu = tuple(_copied(sample) for sample in imu)
        frame = _copied(frame) if isinstance(frame, LedObservation) else frame  # a frame's pixels are read-only
    answer = _called(type(navigator), "step(imu, frame) without an exception", navigator.step, imu, frame)
    if not isinstance(answer, NavSolution):
        expected = "a NavSolution from step(imu, frame)"
        raise DockairError(name_of(type(navigator)), expected=expected, got=type(answer).__name__)
    if is_ours:
        return answer
    answer = _copied(answer)
    check_answer(name_of(type(navigator)), answer)
    return replace(answer, command=_copied(answer.command))


def announce_to(navigator: Navigates, announcement: TankerAnnouncement) -> None:
    """Tell a navigator what the tanker is about to do, if it listens.

    Raises:
        DockairError: it is somebody's own and raises an exception.
    """
    _tell(navigator, "announce", announcement)


def signal_to(navigator: Navigates, signal: PodSignal) -> None:
    """Show a navigator what the pod's light begins to show, if it looks.

    Raises:
        DockairError: it is somebody's own and raises an exception.
    """
    _tell(navigator, "signal", signal)


def _tell(navigator: Navigates, method: str, message: TankerAnnouncement | PodSignal) -> None:
    listens = getattr(navigator, method, None)
    if listens is not None:
        _called(type(navigator), f"{method}(message) without an exception", listens, message)


def _called(owner: Any, expected: str, function: Callable[..., T], *given: Any) -> T:
    """Call a navigator's class or method; turn what somebody's own raises into one line."""
    try:
        return function(*given)
    except DockairError:
        raise
    except (Exception, SystemExit) as error:  # somebody's own code may raise anything
        if _is_ours(owner):
            raise
        package = owner.__module__.partition(".")[0]
        raise DockairError(name_of(owner), expected=expected, got=said_by(error, package)) from error


def _copied(message: T) -> T:
    """Return a message with arrays of its own, and these numpy's plain ones: no matrix, and nothing masked."""
    values = {f.name: getattr(message, f.name) for f in fields(message) if f.init}  # type: ignore[arg-type]
    arrays = {name: _plain(value) for name, value in values.items() if isinstance(value, np.ndarray)}
    return replace(message, **arrays)  # type: ignore[type-var]


def _plain(array: NDArray[Any]) -> NDArray[Any]:
    """Return a copy, of floats that numpy's linear algebra takes: neither of 16 bits nor of more than 64."""
    is_odd = array.dtype.kind == "f" and array.dtype.itemsize not in (4, 8)
    return np.array(array, dtype=np.float64 if is_odd else None)


def _is_ours(owner: Any) -> bool:
    return bool(owner.__module__.partition(".")[0] == "dockair")


def _takes_one(made: Callable[..., Any]) -> bool:
    """Whether it can be called with one argument; what says nothing of its arguments is believed to."""
    try:
        inspect.signature(made).bind(None)
    except TypeError:
        return False
    except ValueError:
        return True
    return True
