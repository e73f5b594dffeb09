"""An off-screen OpenGL context with MuJoCo's renderer in it: for the camera's background and for people's pictures.

Without multisampling, which costs tenfold off-screen; whoever wants smooth edges draws finer and averages.
"""

import os
import sys
from typing import Any

import mujoco

from dockair.errors import MachineError


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
        context = gl_context(width, height)
        context.make_current()
        renderer = mujoco.MjrContext(model, font)
    except Exception as error:  # whatever the driver's loader raises, the cause is the machine
        if context is not None:
            context.free()
        raise MachineError(
            where,
            expected=f"an off-screen OpenGL context ({error})",
            remedy="install libegl1 libgl1-mesa-dri libopengl0 (Debian, Ubuntu: apt-get install)",
        ) from error
    finally:
        quality.offsamples = samples
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, renderer)
    mujoco.mjr_resizeOffscreen(width, height, renderer)
    return context, renderer
