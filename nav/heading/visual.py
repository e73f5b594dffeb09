"""Visual heading: how far a camera has turned since its first image, from key frame to key frame.

An image is compared with the last key frame, not with the last image, and takes its place only when it has turned so
far or shares so little with it that the next would be refused. So errors grow with the number of key frames and not
with that of images. What stands near may mislead one pair alone; an image is therefore compared with the one before,
too, and both headings count by how many of n matches share their turn, m, and by how many do not:

    heading = sum w_j heading_j / sum w_j,     w = m (m/n)^2                               (15)

Where one pair is refused the other stands for it; where both are, the caller's own prediction. Pairs: see `turn`.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.nav.heading.features import Features, features_of
from dockair.nav.heading.levelling import without_yaw
from dockair.nav.heading.turn import (
    HeadingLine,
    Turn,
    TurnStatus,
    VisualSettings,
    fit_heading_line,
    measure_turn,
    turn_between,
)
from dockair.rotations import Array, exp

__all__ = ["HeadingLine", "Turn", "TurnStatus", "VisualHeading", "VisualSettings", "fit_heading_line", "measure_turn"]


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    features: Features
    heading_rad: float


@dataclass(slots=True, eq=False)
class VisualHeading:
    """Heading since the first image.

    Args:
        calibration: the line, or the camera.
        settings: constants.

    Attributes:
        heading_rad: to the left, not wrapped.
        key_frames: how many there were.
    """

    calibration: HeadingLine | Camera
    settings: VisualSettings = field(default_factory=VisualSettings)
    heading_rad: float = field(default=0.0, init=False)
    key_frames: int = field(default=0, init=False)
    _key: _Seen | None = field(default=None, init=False, repr=False)
    _last: _Seen | None = field(default=None, init=False, repr=False)

    def step(
        self,
        image: NDArray[Any],
        *,
        mask: NDArray[np.bool_] | None = None,
        R_HC: Array | None = None,
        predicted_turn_rad: float = 0.0,
    ) -> Turn:
        """Take an image; return its turn from the key frame, and bring `heading_rad` up to date.

        Args:
            image: (h, w) uint8 or uint16.
            mask: (h, w) bool: where features may lie.
            R_HC: (3, 3) camera axes in level axes along its heading.
            predicted_turn_rad: since the last image, by the gyro: taken where the image is refused.
        """
        features = features_of(image, self.settings, mask, R_HC)
        if self._key is None or self._last is None:
            self._take_key(features)
            return Turn.none(TurnStatus.FIRST)
        key = self._key
        pairs = [(key, turn_between(key.features, features, self.calibration, self.settings))]
        if self._last is not key:
            turn = turn_between(self._last.features, features, self.calibration, self.settings)
            pairs.append((self._last, turn))
        first = pairs[0][1]
        believed = [(seen, turn) for seen, turn in pairs if turn.status is TurnStatus.MEASURED]
        if not believed:
            self.heading_rad += predicted_turn_rad
            self._take_key(features)
            return first
        weights = [len(turn.pixels[0]) ** 3 / turn.matches**2 for _, turn in believed]  # Eq. (15)
        headings = [seen.heading_rad + turn.turn_rad for seen, turn in believed]
        self.heading_rad = float(np.average(headings, weights=weights))
        self._last = _Seen(features, self.heading_rad)
        turned = self.heading_rad - key.heading_rad
        if abs(turned) > self.settings.key_turn_rad or len(first.pixels[0]) < self.settings.key_matches:
            self._take_key(features)
        return replace(believed[0][1], turn_rad=turned)

    def tilt(self, theta: Array, R_BC: Array) -> None:
        """Correct the attitudes of the images that the next one is compared with: they were believed to be otherwise.

        Two attitudes that are wrong alike do no harm; the step between them, when a filter has learnt, is a false turn.

        Args:
            theta: (3,) rotation vector, small and level, in axes of heading zero.
            R_BC: (3, 3) of the camera in the body whose heading this is.
        """
        key, last = self._key, self._last
        if key is None or last is None:
            return
        self._key = _tilted(key, theta, R_BC)
        self._last = self._key if last is key else _tilted(last, theta, R_BC)

    def _take_key(self, features: Features) -> None:
        self._key = self._last = _Seen(features, self.heading_rad)
        self.key_frames += 1


def _tilted(seen: _Seen, theta: Array, R_BC: Array) -> _Seen:
    R_HC = seen.features.R_HC
    if R_HC is None:
        return seen
    to_heading = exp(np.array([0.0, 0.0, -seen.heading_rad]))
    R_LB = without_yaw(exp(to_heading @ theta) @ R_HC @ R_BC.T)
    return replace(seen, features=replace(seen.features, R_HC=R_LB @ R_BC))
