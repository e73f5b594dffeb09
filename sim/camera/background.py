"""What the LEDs stand in front of, as expected electrons: the sky, before it the scene's solids, through the lens.

    sky (`sky`) ─► solids over it (`drawn` or `traced`) ─► distortion, blocks to pixels, stray light (`blocks`)

All three work on blocks of k x k pixels (sheet `background`, reduction) in units of a white Lambertian surface in
normal sunlight. The solids are drawn by MuJoCo's off-screen renderer ("mujoco") or, on machines without OpenGL, by
rays ("analytic"); everything else is the same code. A window is drawn alone: with "analytic" it equals the full
frame's crop to the bit, with "mujoco" up to edges that fall on the other side of a block's centre.

The Sun stands where the model's first light comes from; how strong it and the light from all sides are, the sky says.
The air that haze adds before a solid has the radiance of endless haze along the lens's axis.
Not modelled: blur of the background by the lens (a block is wider than the point spread function), shadows; else see
the parts.
"""

import math
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.messages import Window
from dockair.rotations import Array
from dockair.sim.camera.blocks import Blocks
from dockair.sim.camera.coarse_grid import CoarseGrid
from dockair.sim.camera.drawn import DrawnSolids
from dockair.sim.camera.sheets import BackgroundParameters
from dockair.sim.camera.solids import Haze, Lighting, Shines
from dockair.sim.camera.traced import TracedSolids
from dockair.sim.opengl import available_backend

__all__ = ["Background", "available_backend"]


class Heaven(Shines, Protocol):
    """What is asked of a sky: `dockair.sim.camera.sky.Sky`."""

    def fill(self, out: NDArray[np.float32], R_WC: Array, x: Array, y: Array, place_m: Array | None = None) -> None:
        """Fill (rows, columns) relative radiance in the directions (1, -x, -y) of the camera's axes from a place."""
        ...

    def work_ahead(self, x: Array, y: Array) -> bool:
        """Make a little of what pictures in these directions will take; say whether anything lacked."""
        ...

    def airlight(self, direction_W: Array) -> float:
        """Relative radiance of endless haze toward a direction (3,)."""
        ...


class Background:
    """Makes the scene behind the LEDs. The OpenGL context, if any, is made at the first picture.

    Args:
        model: the world's; read only.
        camera: as built.
        parameters: sheet `background`.
        sky: what is seen where nothing else is.
        backend: "mujoco", "analytic", or "auto" for the first where this machine can draw.
        sun_radius_rad: of the Sun's disc, over which cloud is taken; 0 is a point.

    Raises:
        DockairError: another backend; a visible geom of the model that cannot be drawn.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        camera: Camera,
        parameters: BackgroundParameters,
        sky: Heaven,
        backend: str = "auto",
        *,
        sun_radius_rad: float,
    ) -> None:
        self._sky, self._blocks = sky, Blocks(camera, parameters.reduction)
        self._memory = np.empty(math.prod(self._blocks.drawn.shape), dtype=np.float32)  # new memory costs more than sky
        light = Lighting.of(model, sky, sun_radius_rad)
        self._solids: DrawnSolids | TracedSolids
        if available_backend(backend) == "mujoco":
            per_tangent = camera.focal_length_px / parameters.reduction
            self._solids = DrawnSolids(model, light, per_tangent, self._blocks.drawn.shape)
        else:
            self._solids = TracedSolids(model, light)

    @property
    def backend(self) -> str:
        """Who draws the solids, "mujoco" or "analytic"."""
        return self._solids.name

    def electrons(
        self,
        data: mujoco.MjData,
        pose: tuple[Array, Array],
        window: Window,
        white_e: float,
        *,
        stray: CoarseGrid | None = None,
        dirt: CoarseGrid | None = None,
        extinction_1_m: float = 0.0,
        place_m: Array | None = None,
        out: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Return (rows, columns) expected electrons of the window.

        Args:
            data: positions and attitudes up to date; not changed.
            pose: R_WC (3, 3) and p_WC (3,) of the camera.
            window: inside the sensor.
            white_e: electrons of a white surface on the axis, in this exposure.
            stray: electrons added to them; holds the window.
            dirt: factor on the picture; holds the window.
            extinction_1_m: of the haze before the solids.
            place_m: (3,) of the camera in axes that stay with the air, for what passes below; None is their origin.
            out: (rows, columns) that takes them; a new array by default.

        Raises:
            MachineError: backend "mujoco", and no off-screen OpenGL here.
        """
        airlight = self._sky.airlight(pose[0][:, 0]) if extinction_1_m > 0.0 else 0.0
        blocks, haze = self._blocks, Haze(extinction_1_m=extinction_1_m, airlight=airlight)
        extent = blocks.around(window)
        drawn = blocks.drawn_for(extent)
        x, y = blocks.tangents(drawn)
        picture = self._memory[: math.prod(drawn.shape)].reshape(drawn.shape)
        self._sky.fill(picture, pose[0], x, y, place_m)
        self._solids.draw(picture, data, pose, x, y, haze)
        picture = blocks.to_sensor(picture, drawn, extent)
        return blocks.to_pixels(picture, extent, window, white_e, stray, dirt, out)

    def work_ahead(self) -> bool:
        """Make a little of what whole pictures will take, in time that none waits for; say whether anything lacked."""
        return self._sky.work_ahead(*self._blocks.tangents(self._blocks.drawn))

    def close(self) -> None:
        """Free the OpenGL context; twice is once."""
        self._solids.close()
