"""How the viewer lays an episode out: phases above, frames left, scene and drogue right, plots below."""

from typing import Any

from dockair.calibration import Camera

#: Colours, the same in every view.
TRUTH = [90, 200, 250]
BELIEF = [255, 159, 10]
FOUND = [48, 209, 88]
NEUTRAL = [255, 214, 10]
PHASES = {
    "join up": [85, 95, 125],
    "pre contact": [110, 130, 150],
    "approach": [10, 132, 255],
    "contact": [48, 209, 88],
    "hold": [36, 138, 61],
    "disconnect": [150, 110, 200],
    "clear": [90, 90, 100],
    "back off": [255, 159, 10],
    "breakaway": [255, 69, 58],
}
STATUSES = {
    "pose used": [36, 138, 61],
    "LEDs used": [48, 209, 88],
    "no frame yet": [90, 90, 100],
    "truth": [90, 200, 250],
}
OTHER = [200, 80, 60]  #: of a state that is none of these: something was not as it should be
AXES = [[255, 69, 58], [48, 209, 88], [10, 132, 255]]

ERROR_SHOWN_MM = 50.0  #: beyond it a drogue that was lost would make a flat line of all that came before
OFFSET_SHOWN_M = 0.5  #: three times what a docking may be off the centre

PIXEL_CENTRE = 0.5  #: the viewer puts the top left corner of the top left pixel at (0, 0), the project its centre
CLOSE_UP = "camera/close_up"  #: an entity at the believed ring's centre; the close-up view looks from there
_CLOSE_UP_HALF_PX = 330  # the ring fills it at about 2.4 m, where the camera stands at contact


def blueprint(camera: Camera) -> Any:
    """Return the blueprint that is stored in every episode."""
    import rerun.blueprint as rrb

    width, height = camera.width_px, camera.height_px
    sensor = rrb.Spatial2DView(
        origin="camera",
        name="Camera, whole sensor",
        visual_bounds=rrb.VisualBounds2D(x_range=[0, width], y_range=[0, height]),
    )
    half = _CLOSE_UP_HALF_PX
    close_up = rrb.Spatial2DView(
        origin=CLOSE_UP,
        contents=["camera/**"],
        name="Camera, around the ring",
        visual_bounds=rrb.VisualBounds2D(x_range=[-half, half], y_range=[-half, half]),
    )
    cameras = rrb.Vertical(sensor, close_up, row_shares=[4, 6])
    scene = _scene("world", "Scene", eye=(-33.0, 10.5, 2.0), target=(-14.0, 0.5, -1.2))
    drogue = _scene("world/drogue", "At the drogue: belief in orange", eye=(-2.2, 1.5, 0.7), target=(-0.3, 0.0, 0.0))
    views = rrb.Horizontal(cameras, scene, drogue, column_shares=[5, 6, 5])
    return rrb.Blueprint(
        rrb.Vertical(_states(), views, _plots(), row_shares=[4, 11, 6]),
        rrb.TimePanel(timeline="sim_time", state="collapsed"),
        collapse_panels=True,
    )


def _scene(origin: str, name: str, *, eye: tuple[float, ...], target: tuple[float, ...]) -> Any:
    import rerun.blueprint as rrb

    controls = rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0))
    background = [38, 44, 54]
    return rrb.Spatial3DView(
        origin=origin, contents=["world/**"], name=name, eye_controls=controls, background=background, line_grid=False
    )


def _plots() -> Any:
    import rerun.blueprint as rrb

    top_left, top_right = rrb.Corner2D.LeftTop, rrb.Corner2D.RightTop
    bottom_left, bottom_right = rrb.Corner2D.LeftBottom, rrb.Corner2D.RightBottom
    errors = (-ERROR_SHOWN_MM, ERROR_SHOWN_MM)

    return rrb.Horizontal(
        _plot("range", "Ring ahead of the tip [m]", top_right),
        _plot("lateral", "Ring beside the tip [m]", top_right, (-OFFSET_SHOWN_M, OFFSET_SHOWN_M)),
        _plot("closing", "Closing speed [m/s]", bottom_left),
        rrb.Tabs(
            _plot("lateral_error", "Error across [mm]", top_left, errors),
            _plot("range_error", "Error along [mm]", top_left, errors),
            active_tab=0,
        ),
        rrb.Tabs(
            _plot("gyro", "Gyro [deg/s]", bottom_right), _plot("accelerometer", "Specific force [m/s^2]"),
            _plot("exposure", "Exposure [us]"), _plot("reel", "Hose taken in [m]"),
            _plot("tension", "Hose tension [N]"),
            _plot("heading_error", "Heading error [deg]"),
            rrb.TextDocumentView(origin="summary", name="Result"), active_tab=0,
        ),
    )  # fmt: skip


def _plot(entity: str, name: str, legend: Any = None, shown: tuple[float, float] | None = None) -> Any:
    """A plot with its legend in a corner that is empty in most flights, and a vertical axis that ends where told."""
    import rerun.blueprint as rrb

    axis = None if shown is None else rrb.ScalarAxis(range=shown)
    return rrb.TimeSeriesView(
        origin=f"plots/{entity}", name=name, plot_legend=rrb.PlotLegend(legend, visible=True), axis_y=axis
    )


def _states() -> Any:
    import rerun.blueprint as rrb

    return rrb.StateTimelineView(origin="states", name="Phase, and what became of the newest frame")
