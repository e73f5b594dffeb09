"""What a navigator of one's own has to answer: each field of a `NavSolution` by its type, its shape and its range.

The loop, the log and the referee take a solution as it is; what is wrong with one is said where it is answered.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from dockair.errors import DockairError
from dockair.messages import NavSolution, ReceiverCommand, Window

_ARRAYS: dict[str, tuple[int | str, ...]] = {
    "p_PD_B": (3,),
    "v_PD_B": (3,),
    "R_BD": (3, 3),
    "covariance": (9, 9),
    "candidates_px": ("n", 2),
    "led_pixels_px": (8, 2),
}
_WHILE_VALID = ("p_PD_B", "v_PD_B")  # are finite then
_TEXTS = ("phase", "status", "phase_reason")
_FLAGS = ("valid", "contact_usable")
_NUMBERS = ("frame_time_stamp_s", "heading_rad", "heading_sigma_rad")  # or NaN
_COMMAND_ARRAYS, _COMMAND_NUMBERS = ("velocity_m_s", "acceleration_m_s2"), ("turn_rate_rad_s", "climb_rad")
_ORTHONORMAL = 1e-3  # of R_BD R_BD^T - 1


def check_answer(name: str, answer: NavSolution) -> None:
    """Refuse a solution that could not be flown, logged or judged.

    Args:
        name: of the navigator, for the error.
        answer: of its step.

    Raises:
        DockairError: a field that is not what `dockair.messages` says.
    """

    def check(field: str, value: Any, holds: Callable[[Any], bool], expected: str) -> None:
        if not holds(value):
            raise DockairError(f"{name}: {field}", expected=expected, got=_shown(value))

    for field in _TEXTS:
        check(field, getattr(answer, field), lambda value: isinstance(value, str), "text")
    for field in _FLAGS:
        check(field, getattr(answer, field), lambda value: isinstance(value, bool | np.bool_), "True or False")
    check("time_stamp_s", answer.time_stamp_s, _is_finite, "a finite number")
    for field in _NUMBERS:
        check(field, getattr(answer, field), _is_number, "a number, or NaN")
    check("exposure_s", answer.exposure_s, lambda value: _is_number(value) and not value <= 0.0, "above 0, or NaN")
    for field, shape in _ARRAYS.items():
        value = getattr(answer, field)
        check(field, value, partial(_has_shape, shape=shape), f"an array {_in_words(shape)}")
        if answer.valid and field in _WHILE_VALID:
            check(field, value, lambda value: bool(np.isfinite(value).all()), "finite numbers while valid")
    # the log and the environments write it as quaternion and as rotation vector, whatever `valid` says
    check("R_BD", answer.R_BD, _is_rotation, "a rotation, also while not valid")
    variances = np.diag(answer.covariance)
    check("covariance", variances, lambda value: not (value < 0.0).any(), "no variance below 0")
    check("window", answer.window, _is_window, "a Window of whole numbers, or None")
    command = answer.command
    check("command", command, lambda value: isinstance(value, ReceiverCommand), "a ReceiverCommand")
    for field in _COMMAND_ARRAYS:
        check(f"command.{field}", getattr(command, field), _is_vector, "an array of 3 finite numbers")
    for field in _COMMAND_NUMBERS:
        check(f"command.{field}", getattr(command, field), _is_finite, "a finite number")


def _is_number(value: Any) -> bool:
    return isinstance(value, float | int | np.floating | np.integer) and not isinstance(value, bool)


def _is_finite(value: Any) -> bool:
    return _is_number(value) and math.isfinite(value)


def _has_shape(value: Any, shape: tuple[int | str, ...]) -> bool:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu" or value.ndim != len(shape):
        return False
    return all(wanted in ("n", got) for wanted, got in zip(shape, value.shape, strict=True))


def _is_vector(value: Any) -> bool:
    return _has_shape(value, (3,)) and bool(np.isfinite(value).all())


def _is_rotation(R: Any) -> bool:
    if not np.isfinite(R).all():
        return False
    return bool((np.abs(R @ R.T - np.eye(3)) < _ORTHONORMAL).all()) and float(np.linalg.det(R)) > 0.0  # no reflection


def _is_window(value: Any) -> bool:
    if value is None:
        return True
    edges = ("row_start", "row_stop", "column_start", "column_stop")
    return isinstance(value, Window) and all(isinstance(getattr(value, edge), int | np.integer) for edge in edges)


def _in_words(shape: tuple[int | str, ...]) -> str:
    """As numpy writes it."""
    return f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''}) of numbers"


def _shown(value: Any) -> str:
    """In one line: an array of other shape or kind by these, small ones by their numbers; a list as what it is."""
    if isinstance(value, np.ndarray):
        if value.ndim > 0 and value.size <= 9 and value.dtype.kind in "fiu":
            return f"{value.tolist()}"
        return f"an array {value.shape} of {value.dtype}"
    said = " ".join(repr(value).split())[:80]
    return f"the list {said}" if isinstance(value, list) else said
