"""An off-screen OpenGL context with MuJoCo's renderer in it: for the camera's background and for people's pictures.

Without multisampling, which costs tenfold off-screen; whoever wants smooth edges draws finer and averages.
"""

import os
import sys
import threading
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError, MachineError
from dockair.sim.opengl import drawing_remedy

_SMALLEST_FONT = 50


class Canvas:
    """A context, MuJoCo's renderer and its off-screen buffer.

    Args:
        model: whose meshes and textures can be drawn.
        width: of the buffer [px].
        height: of the buffer [px].
        where: who asks, for the error.
        font: MuJoCo's font scale.

    Raises:
        MachineError: no off-screen OpenGL here.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int, where: str, font: int = _SMALLEST_FONT) -> None:
        self._context, self._renderer = open_renderer(model, width, height, font, where)
        self._shape = height, width

    def render(
        self, scene: mujoco.MjvScene, colours: NDArray[np.uint8], depths: NDArray[np.float32] | None = None
    ) -> None:
        """Draw a scene and read it, rows running upward.

        The buffer is made as large as the picture: a part of it would be cleared pixel by pixel.

        Args:
            scene: what is drawn.
            colours: (rows, columns, 3), filled.
            depths: (rows, columns), filled with OpenGL's depth, 0 near to 1 far.
        """
        rect = mujoco.MjrRect(0, 0, colours.shape[1], colours.shape[0])
        self._context.make_current()
        if colours.shape[:2] != self._shape:
            mujoco.mjr_resizeOffscreen(rect.width, rect.height, self._renderer)
            self._shape = colours.shape[0], colours.shape[1]
        mujoco.mjr_render(rect, scene, self._renderer)
        mujoco.mjr_readPixels(colours, depths, rect, self._renderer)

    def close(self) -> None:
        """Free renderer and context; twice is once."""
        if self._context is not None:
            self._context.make_current()
            self._renderer.free()
            self._context.free()
        self._context = self._renderer = None


class _ThreadsContext:
    """An off-screen context, current; while it is so in the thread that made it, OpenGL lets no other have it."""

    def __init__(self, context: Any, where: str) -> None:
        self._context, self._where, self._thread = context, where, threading.current_thread()

    def make_current(self) -> None:
        """Let what is drawn next be drawn into it.

        Raises:
            DockairError: another thread has it.
        """
        try:
            self._context.make_current()
        except Exception as error:  # whatever the driver's loader raises
            thread = threading.current_thread()
            if thread is self._thread:
                raise
            expected = f"the thread in which its OpenGL context was made, {self._thread.name!r}"
            raise DockairError(self._where, expected=expected, got=thread.name) from error

    def free(self) -> None:
        """Free the context."""
        self._context.free()


def gl_context(width: int, height: int) -> Any:
    """Make an off-screen context; which kind does not depend on who imported mujoco first."""
    chosen = os.environ.get("MUJOCO_GL", "egl" if sys.platform.startswith("linux") else "")
    if chosen == "egl":
        from mujoco.egl import GLContext

        return GLContext(width, height)
    return mujoco.GLContext(width, height)


def open_renderer(model: mujoco.MjModel, width: int, height: int, font: int, where: str) -> tuple[Any, Any]:
    """Return the context, current, and MuJoCo's renderer, which draws into its off-screen buffer.

    Args:
        model: what is drawn.
        width: of the buffer [px].
        height: of the buffer [px].
        font: MuJoCo's font scale.
        where: who asks, for the error.

    Raises:
        MachineError: no off-screen OpenGL here.
    """
    quality = model.vis.quality
    samples, quality.offsamples = quality.offsamples, 0  # the renderer reads it from the model when it is made
    context: Any = None
    try:
        context = _ThreadsContext(gl_context(width, height), where)
        context.make_current()
        renderer = mujoco.MjrContext(model, font)
    except Exception as error:  # whatever the driver's loader raises, the cause is the machine
        if context is not None:
            context.free()
        raise MachineError(
            where, expected=f"an off-screen OpenGL context ({error})", remedy=drawing_remedy()
        ) from error
    finally:
        quality.offsamples = samples
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, renderer)
    mujoco.mjr_resizeOffscreen(width, height, renderer)
    return context, renderer
