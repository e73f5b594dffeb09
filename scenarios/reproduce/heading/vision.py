"""A walker's visual heading: the line's calibration, and the turns seen on one lap of the oval.

The line is fitted on landscapes that no estimate sees later: near, middle and far ones, each from the same place in
many directions. On the lap pictures are taken at 151 points; parallax of what stands near the track is the error.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from dockair.nav.heading.visual import HeadingLine, TurnStatus, VisualHeading, fit_heading_line, measure_turn
from dockair.rotations import Array
from dockair.scenarios.reproduce.heading.scene import Landscape, random_landscape
from dockair.scenarios.reproduce.heading.tracks import lap_places

_CALIBRATION_RANGES_M = {"near": (8.0, 25.0), "middle": (25.0, 100.0), "far": (100.0, 600.0)}
_CALIBRATION_PANELS, _CALIBRATION_SEED = 90, 400
_DIRECTIONS_DEG = (0.0, 90.0, 180.0, 270.0)
_TURNS_DEG = (-6.0, -4.5, -3.0, -1.5, 1.5, 3.0, 4.5, 6.0)
_LAP_PANELS, _LAP_SEED, _LAP_RANGES_M = 420, 8, (15.0, 600.0)
POINTS = 151


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Shifts of known turns, and the lines through them."""

    shifts_px: Array
    turns_rad: Array
    line: HeadingLine  #: through zero: what is used
    printed: HeadingLine  #: with an offset, as the source fits it


@cache
def calibration() -> Calibration:
    """Measure turns of 1.5 to 6 degrees, near, middle and far, and fit the line."""
    shifts, turns = [], []
    any_line = HeadingLine(slope_rad_px=1.0)
    for seed, distances in enumerate(_CALIBRATION_RANGES_M.values(), _CALIBRATION_SEED):
        scene = random_landscape(seed, panels=_CALIBRATION_PANELS, distances_m=distances)
        for direction in np.radians(_DIRECTIONS_DEG):
            first = scene.image(0.0, 0.0, float(direction))
            for turn in np.radians(_TURNS_DEG):
                measured = measure_turn(first, scene.image(0.0, 0.0, float(direction + turn)), any_line)
                if measured.status is TurnStatus.MEASURED:
                    shifts.append(measured.shift_px)
                    turns.append(float(turn))
    x, d = np.array(shifts), np.array(turns)
    return Calibration(x, d, fit_heading_line(x, d), fit_heading_line(x, d, with_offset=True))


@cache
def lap_landscape() -> Landscape:
    """What stands around the oval; another one than the calibration's."""
    places = lap_places(64)[:, :2]
    return random_landscape(_LAP_SEED, panels=_LAP_PANELS, distances_m=_LAP_RANGES_M, around=places)


@dataclass(frozen=True, slots=True, eq=False)
class SeenLap:
    """Headings at the points of one lap."""

    true_rad: Array  #: (n + 1,) from the start on
    seen_rad: Array  #: (n + 1,)
    refused: int
    key_frames: int


@cache
def seen_lap(points: int = POINTS, *, mirrored: bool = False, walked: int = POINTS) -> SeenLap:
    """Walk one lap to the left, or mirrored to the right, or the first points of one, with a picture at each point."""
    scene, visual, refused = lap_landscape(), VisualHeading(calibration().line), 0
    places, seen = lap_places(points)[: walked + 1], []
    for x, y, heading in places:
        picture = scene.image(float(x), float(y), float(heading))
        turn = visual.step(np.ascontiguousarray(picture[:, ::-1]) if mirrored else picture)
        refused += turn.status in (TurnStatus.TOO_FEW, TurnStatus.DISAGREE)
        seen.append(visual.heading_rad)
    side = -1.0 if mirrored else 1.0
    return SeenLap(side * places[:, 2], np.array(seen), refused, visual.key_frames)
