"""The measurement model beside the camera in two lights, for half a second each."""

import json

import cv2
import pytest

from dockair.scenarios.reproduce.measurement_model import light as measurement_light
from dockair.scenarios.reproduce.reference import picture_name

pytestmark = pytest.mark.slow


def test_the_models_texture_goes_at_night_as_the_cameras_does(tmp_path):
    """A texture that stayed would state eight times the camera's sigma."""
    result = measurement_light.reproduce(tmp_path, ranges_m=(20,), lights=("day", "night"), standing_s=0.6)
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert cv2.imread(str(tmp_path / picture_name(result["id"]))).std() > 10.0
    day, night = result["rows"]
    for key in ("stated_sigma_median_px", "stated_sigma_rms_px", "error_rms_px"):
        assert night["ours"][key] == pytest.approx(night["reference"][key], rel=0.5), key
        assert night["ours"][key] < 0.3 * day["ours"][key]
    assert night["ours"]["named_share"] > 0.99
