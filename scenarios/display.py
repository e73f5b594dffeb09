"""Whether a window can be opened on this machine."""

import os
import sys

_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")  # by which a program under Linux finds one


def has_display() -> bool:
    """Tell whether a program that is started here finds a display; elsewhere than under Linux it always does."""
    return not sys.platform.startswith("linux") or any(os.environ.get(name) for name in _DISPLAYS)
