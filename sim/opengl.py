"""Whether this machine can draw off-screen, found out in a process of its own.

In a process of its own for three reasons: a missing library ends in an exception far from its cause
(`'NoneType' object has no attribute 'eglQueryString'`, an import error, a type error), or in no exception at all; a
context made here would not survive a fork; and `import mujoco` itself fails where `MUJOCO_GL` asks for a library that
is missing. This module imports nothing of MuJoCo.
"""

import ctypes
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from dockair.errors import DockairError

APT_PACKAGES = "libegl1 libgl1-mesa-dri libopengl0"
BACKENDS = ("auto", "mujoco", "analytic")
TIMEOUT_S = 120.0
_NO_OPENGL = ("disable", "disabled", "off", "false", "0")  # what MuJoCo takes for none
_WINDOWED = ("", "enable", "enabled", "on", "true", "1", "glfw", "glx")  # what it takes for the window system's own
_NEEDED = {  # of each group one
    "egl": (("libEGL.so.1", "libEGL.so"), ("libOpenGL.so.0", "libOpenGL.so", "libGL.so.1", "libGL.so")),
    "osmesa": (("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),),
}

#: Run by a fresh interpreter; prints who renders.
RENDER_SCRIPT = """
import mujoco
model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom size="1"/></worldbody></mujoco>')
renderer = mujoco.Renderer(model, 16, 16)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
renderer.update_scene(data)
assert renderer.render().shape == (16, 16, 3)
from OpenGL.GL import GL_RENDERER, glGetString
print(glGetString(GL_RENDERER).decode())
renderer.close()
"""


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of trying to draw."""

    renderer: str  #: who drew; empty if nobody
    reason: str = ""  #: why nobody, one line
    said: str = ""  #: what was said by what failed


def kind_of_context(environment: Mapping[str, str] = os.environ) -> str:
    """Return `egl`, `glfw` and so on: what would be tried here; empty for the window system's own."""
    return environment.get("MUJOCO_GL", "egl" if sys.platform.startswith("linux") else "").lower().strip()


def drawing_remedy(environment: Mapping[str, str] = os.environ) -> str:
    """Return what to do where nothing can be drawn: install the libraries, or no longer ask for others or for none."""
    if kind_of_context(environment) not in ("", "egl"):
        return "unset MUJOCO_GL, or set it to egl"
    return f"type: sudo apt-get install -y {APT_PACKAGES}"


def try_drawing(script: str = RENDER_SCRIPT, timeout_s: float = TIMEOUT_S) -> Trial:
    """Draw one small picture in another process.

    Args:
        script: what that process runs; it prints who renders.
        timeout_s: when to give it up.
    """
    kind = kind_of_context()
    if kind in _NO_OPENGL:
        return Trial("", f"MUJOCO_GL is {os.environ['MUJOCO_GL']}")
    environment = dict(os.environ) | ({"MUJOCO_GL": kind} if kind else {})
    try:
        run = subprocess.run(
            [sys.executable, "-c", script], env=environment, capture_output=True, text=True, timeout=timeout_s
        )
    except subprocess.TimeoutExpired:
        return Trial("", f"no picture within {timeout_s:.0f} s")
    if run.returncode == 0:
        return Trial(run.stdout.strip())
    said = (run.stderr.strip().splitlines() or [f"ended with status {run.returncode}"])[-1]
    return Trial("", f"no picture through {kind or 'the window system'}", said)


@cache
def _trial() -> Trial:
    return try_drawing()


def available_backend(wanted: str = "auto") -> str:
    """Return which of the camera's backgrounds runs here, "mujoco" or "analytic"; tried once a process.

    Args:
        wanted: either, which is then returned untried, or "auto" for "mujoco" where it can draw.

    Raises:
        DockairError: not one of the three.
    """
    if wanted not in BACKENDS:
        raise DockairError("camera.background", expected="one of the ways to draw it", got=wanted, exists=BACKENDS)
    if wanted != "auto":
        return wanted
    return "mujoco" if _trial().renderer else "analytic"


def why_analytic() -> str:
    """Why `available_backend()` is "analytic"; empty if it is not."""
    return _trial().reason


def let_mujoco_be_imported() -> None:
    """Take back a `MUJOCO_GL` that MuJoCo does not know, or whose library is missing.

    `import mujoco` would fail on it, with physics and all.

    To be called before the first import of mujoco; does nothing after it.
    """
    if "mujoco" in sys.modules or not sys.platform.startswith("linux"):
        return
    wanted = os.environ.get("MUJOCO_GL", "").lower().strip()
    groups = _NEEDED.get(wanted, ())
    known = wanted in (*_NEEDED, *_WINDOWED, *_NO_OPENGL)
    if not known or not all(any(map(_loads, group)) for group in groups):
        os.environ["MUJOCO_GL"] = _NO_OPENGL[1]


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True
