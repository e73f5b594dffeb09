"""Ten thousand frames of every size, type and content: each gives sound blobs or a clear error, never a crash."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import Window
from dockair.nav.image.detect import Blobs, DetectSettings, detect

SETTINGS = [
    DetectSettings(),
    DetectSettings(method="frame"),
    DetectSettings(threshold_dn=90, centroid="weighted"),
    DetectSettings(min_area_px=1, max_area_px=10**6, max_elongation=1e9, element_size_px=1),
    DetectSettings(method="frame", connectivity=4, element_shape="cross", element_size_px=5, spare_below_px=1),
    DetectSettings(threshold_dn=1, min_area_px=1, max_area_px=10**6, max_elongation=1e9, local_background=False),
    DetectSettings(threshold_dn=0, min_area_px=1, max_area_px=10**6, centroid="weighted", max_elongation=1e9),
    DetectSettings(threshold_dn=-5, min_area_px=1, max_area_px=10**6, local_background=False, spare_below_px=1),
]


def _frame(rng: np.random.Generator) -> np.ndarray:
    shape = tuple(int(n) for n in rng.integers(0, rng.choice([3, 12, 40, 150]), 2))
    dtype = rng.choice([np.uint8, np.uint16])
    top = float(np.iinfo(dtype).max)
    kind = rng.integers(0, 6)
    if kind == 0:
        image = np.full(shape, rng.uniform(0.0, 1.0))
    elif kind == 1:
        image = rng.random(shape) ** rng.uniform(0.2, 12.0)
    elif kind == 2:  # black and white
        image = (rng.random(shape) < rng.uniform(0.0, 1.0)).astype(float)
    elif kind == 3:  # a few pixels
        image = np.zeros(shape)
        if image.size:
            image.ravel()[rng.integers(0, image.size, rng.integers(1, 9))] = rng.uniform(0.0, 1.0)
    else:  # discs, clipped or not, on noise or on a slope
        rows, columns = np.indices(shape)
        image = 0.1 * rng.random(shape) if kind == 4 else rows / max(shape[0], 1)
        for _ in range(rng.integers(1, 6)):
            i, j = rng.uniform(-3.0, 1.05 * np.array(shape) + 1.0)
            image = np.maximum(
                image, rng.uniform(0.1, 3.0) * np.exp(-np.hypot(rows - i, columns - j) / rng.uniform(0.3, 9.0))
            )
    frame = np.rint(np.clip(image, 0.0, 1.0) * top).astype(dtype)
    return [frame, frame[::-1], frame[:, ::-1], frame.T, frame[::2, ::3], np.asfortranarray(frame)][rng.integers(0, 6)]


def _check(blobs: Blobs, image: np.ndarray, settings: DetectSettings) -> None:
    n = len(blobs)
    assert blobs.centroids_px.shape == (n, 2)
    for values in (blobs.sigma_px, blobs.flux, blobs.peak, blobs.clipped, blobs.area_px, blobs.thresholds_dn):
        assert values.shape == (n,)
        assert np.isfinite(values).all()
    assert np.isfinite(blobs.centroids_px).all()
    assert (blobs.centroids_px >= -0.5).all()
    assert (blobs.centroids_px <= np.array(image.shape[::-1]) - 0.5).all()
    assert (blobs.sigma_px > 0.0).all()
    assert (blobs.flux > 0.0).all()
    assert ((blobs.area_px >= settings.min_area_px) & (blobs.area_px <= settings.max_area_px)).all()
    assert (blobs.peak > blobs.thresholds_dn).all()
    if n:
        assert blobs.peak.max() <= image.max()


@pytest.mark.parametrize("part", range(4))
def test_ten_thousand_frames_give_sound_blobs_that_do_not_depend_on_memory_layout(part):
    rng = np.random.default_rng(part)
    found = 0
    for k in range(2500):
        image, settings = _frame(rng), SETTINGS[k % len(SETTINGS)]
        blobs = detect(image, settings, gain_dn_per_electron=rng.choice([None, 0.0, 0.0187, 4.0]))
        _check(blobs, image, settings)
        found += len(blobs)
        if k % 10 == 0:
            np.testing.assert_array_equal(
                detect(image.copy(), settings).centroids_px, detect(image, settings).centroids_px
            )
    assert found > 1000


NO_FRAMES = {
    "float": np.zeros((8, 8)),
    "NaN": np.full((8, 8), np.nan),
    "signed": np.zeros((8, 8), np.int16),
    "32 bit": np.zeros((8, 8), np.uint32),
    "bool": np.zeros((8, 8), bool),
    "objects": np.full((8, 8), None),
    "colour": np.zeros((8, 8, 3), np.uint8),
    "a row": np.zeros(8, np.uint8),
    "a number": np.uint8(3),
    "big-endian": np.zeros((8, 8), ">u2"),
    "a list": [[1, 2], [3, 4]],
    "nothing": None,
}


@pytest.mark.parametrize("settings", [DetectSettings(), DetectSettings(method="frame")])
@pytest.mark.parametrize("name", NO_FRAMES)
def test_what_is_no_frame_is_refused_by_name(name, settings):
    with pytest.raises(DockairError, match="image"):
        detect(NO_FRAMES[name], settings)


@pytest.mark.parametrize("shape", [(8, 9), (9, 8), (72, 1)])
def test_a_frame_that_is_not_its_window_s_is_refused(shape):
    with pytest.raises(DockairError, match="window"):
        detect(np.zeros(shape, np.uint8), None, Window(0, 8, 0, 8))


def test_a_read_only_frame_is_left_as_it_is():
    image = np.random.default_rng(1).integers(0, 255, (60, 80)).astype(np.uint8)
    before = image.copy()
    image.setflags(write=False)
    for settings in SETTINGS:
        detect(image, settings)
    np.testing.assert_array_equal(image, before)
