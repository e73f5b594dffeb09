"""How the viewer lays an episode out: frames left, scene right, plots below, phases at the bottom."""

from typing import Any

from dockair.calibration import Camera

#: Colours, the same in every view.
TRUTH = [90, 200, 250]
BELIEF = [255, 159, 10]
FOUND = [48, 209, 88]
NEUTRAL = [255, 214, 10]
AXES = [[255, 69, 58], [48, 209, 88], [10, 132, 255]]

CLOSE_UP = "camera/close_up"  #: an entity at the believed ring's centre; the close-up view looks from there
_CLOSE_UP_HALF_PX = 330  # the ring fills it at about 2.4 m, where the camera stands at contact


def blueprint(camera: Camera) -> Any:
    """Return the blueprint that is stored in every episode."""
    import rerun.blueprint as rrb

    width, height = camera.width_px, camera.height_px
    eye = rrb.EyeControls3D(position=(-27.0, 9.5, 1.5), look_target=(-17.0, 0.0, -2.8), eye_up=(0.0, 0.0, 1.0))
    sensor = rrb.Spatial2DView(
        origin="camera",
        name="Camera, whole sensor",
        visual_bounds=rrb.VisualBounds2D(x_range=[0, width], y_range=[0, height]),
    )
    close_up = rrb.Spatial2DView(
        origin=CLOSE_UP,
        contents=["camera/**"],
        name="Camera, around the ring",
        visual_bounds=rrb.VisualBounds2D(
            x_range=[-_CLOSE_UP_HALF_PX, _CLOSE_UP_HALF_PX], y_range=[-_CLOSE_UP_HALF_PX, _CLOSE_UP_HALF_PX]
        ),
    )
    scene = rrb.Spatial3DView(
        origin="world", name="Scene: truth, and belief in orange", eye_controls=eye, background=[38, 44, 54],
        line_grid=False,
    )  # fmt: skip
    views = rrb.Horizontal(rrb.Vertical(sensor, close_up, row_shares=[5, 6]), scene, column_shares=[5, 8])
    return rrb.Blueprint(
        rrb.Vertical(views, _plots(), _states(), row_shares=[10, 5, 2]),
        rrb.TimePanel(timeline="sim_time", state="collapsed"),
        collapse_panels=True,
    )


def _plots() -> Any:
    import rerun.blueprint as rrb

    def plot(entity: str, name: str) -> Any:
        return rrb.TimeSeriesView(origin=f"plots/{entity}", name=name, plot_legend=rrb.PlotLegend(visible=True))

    return rrb.Horizontal(
        plot("range", "Ring ahead of the tip [m]"),
        rrb.Tabs(
            plot("lateral_error", "Belief off the truth, across [mm]"), plot("range_error", "Range error [mm]"),
            active_tab=0,
        ),
        plot("lateral", "Ring off the probe's line [m]"),
        plot("closing", "Closing speed [m/s]"),
        rrb.Tabs(
            plot("gyro", "Gyro [deg/s]"), plot("reel", "Hose taken in [m]"), plot("tension", "Hose tension [N]"),
            rrb.TextDocumentView(origin="summary", name="Result"), active_tab=0,
        ),
    )  # fmt: skip


def _states() -> Any:
    import rerun.blueprint as rrb

    return rrb.StateTimelineView(origin="states", name="Phase and last frame")
