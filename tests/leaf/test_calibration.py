from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError

CAMERA = Camera()
LENS = (-0.12, 0.06, 8e-4, -5e-4, -0.01)  #: a strong but ordinary lens of this field of view
DISTORTED = replace(CAMERA, distortion=LENS)

points = st.tuples(st.floats(0.5, 50.0), st.floats(-0.34, 0.34), st.floats(-0.18, 0.18)).map(
    lambda t: np.array([[t[0], t[0] * t[1], t[0] * t[2]]])
)


def test_boresight_meets_the_principal_point():
    np.testing.assert_allclose(CAMERA.pixels_from_points(np.array([[7.0, 0.0, 0.0]])), [[1023.5, 543.5]])


def test_left_is_to_the_left_and_up_is_up_in_the_image():
    """u = cu - f y/x, v = cv - f z/x, f = 16 mm / 5.5 um."""
    f = 0.016 / 5.5e-6
    u, v = CAMERA.pixels_from_points(np.array([[2.0, 0.1, 0.2]]))[0]
    assert u == pytest.approx(1023.5 - f * 0.05)
    assert v == pytest.approx(543.5 - f * 0.1)


def test_field_of_view_is_that_of_the_sensor():
    corner = CAMERA.rays_from_pixels(np.array([[-0.5, 543.5], [2047.5, 543.5], [1023.5, -0.5], [1023.5, 1087.5]]))
    angle = np.rad2deg(np.arccos([corner[0] @ corner[1], corner[2] @ corner[3]]))
    np.testing.assert_allclose(angle, [38.78, 21.18], atol=0.01)  # 2 atan(11.264/32), 2 atan(5.984/32)


@given(points)
def test_rays_undo_pixels_without_distortion(p_C):
    ray = CAMERA.rays_from_pixels(CAMERA.pixels_from_points(p_C))
    np.testing.assert_allclose(ray, p_C / np.linalg.norm(p_C), atol=1e-12)


@given(points)
def test_rays_undo_pixels_with_distortion(p_C):
    ray = DISTORTED.rays_from_pixels(DISTORTED.pixels_from_points(p_C))
    np.testing.assert_allclose(ray, p_C / np.linalg.norm(p_C), atol=1e-10)


def test_distortion_is_opencvs():
    p_C = np.array([[5.0, 1.6, -0.8], [5.0, -1.5, 0.9], [3.0, 0.2, 0.1], [9.0, 0.0, 1.5]])
    K = np.array([[CAMERA.focal_length_px, 0, 1023.5], [0, CAMERA.focal_length_px, 543.5], [0, 0, 1]])
    theirs, _ = cv2.projectPoints(
        np.column_stack([-p_C[:, 1], -p_C[:, 2], p_C[:, 0]]), np.zeros(3), np.zeros(3), K, np.array(LENS)
    )
    np.testing.assert_allclose(DISTORTED.pixels_from_points(p_C), theirs.reshape(-1, 2), atol=1e-9)


SHEET = """focal_length_m = 0.016
pixel_pitch_m = 5.5e-6
width_px = 2048
height_px = 1088
principal_point_px = [1023.5, 543.5]
"""


def test_points_beside_or_behind_the_camera_have_no_pixel():
    pixels = CAMERA.pixels_from_points(np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    assert np.isnan(pixels[:2]).all()
    assert np.isfinite(pixels[2]).all()


def test_led_k_stands_at_k_eighths_from_left_to_up_in_the_plane_across_x():
    q = LedRing(diameter_m=0.5).positions_D
    np.testing.assert_allclose(q[[0, 2, 4, 6], 1:], [[0.25, 0], [0, 0.25], [-0.25, 0], [0, -0.25]], atol=1e-16)
    np.testing.assert_allclose(q[1], [0.0, 0.25 * np.sqrt(0.5), 0.25 * np.sqrt(0.5)])
    assert q.shape == (8, 3)
    assert (q[:, 0] == 0.0).all()


@pytest.mark.parametrize(
    ("make", "where"),
    [
        (lambda: Camera(focal_length_m=0.0), "camera.focal_length_m"),
        (lambda: Camera(width_px=-1), "camera.width_px"),
        (lambda: Camera(pixel_pitch_m=float("nan")), "camera.pixel_pitch_m"),
        (lambda: Camera(distortion=(0.1, 0.2)), "camera.distortion"),  # type: ignore[arg-type]
        (lambda: Camera(distortion=(float("nan"), 0.0, 0.0, 0.0, 0.0)), "camera.distortion"),
        (lambda: Camera(distortion=(-2.5, 0.0, 0.0, 0.0, 0.0)), "camera.distortion"),  # folds over within the sensor
        (lambda: Camera(distortion=(5.0, 0.0, 0.0, 0.0, 0.0)), "camera.distortion"),  # the steps run away
        (lambda: Camera(principal_point_px=(1023.5, 1e6)), "camera.principal_point_px"),
        (lambda: Camera(focal_length_m=16.0), "camera.focal_length_m"),
        (lambda: Camera(width_px=2048.0), "camera.width_px"),  # type: ignore[arg-type]
        (lambda: LedRing(diameter_m=-0.5), "ring.diameter_m"),
        (lambda: LedRing(count=2), "ring.count"),
    ],
)
def test_impossible_hardware_is_refused_by_name(make, where):
    with pytest.raises(DockairError) as error:
        make()
    assert error.value.where == where


def test_sheet_is_read_from_toml(tmp_path):
    file = tmp_path / "camera.toml"
    file.write_text(SHEET.replace("0.016", "0.025") + "distortion = [-0.1, 0.0, 0.0, 0.0, 0.0]\n", encoding="utf-8")
    assert Camera.from_toml(file) == Camera(focal_length_m=0.025, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
    file.write_text(SHEET, encoding="utf-8")
    assert Camera.from_toml(file) == Camera()
    file.write_text("\ufeff" + SHEET.replace("\n", "\r\n"), encoding="utf-8")  # as editors on Windows write it
    assert Camera.from_toml(file) == Camera()


@pytest.mark.parametrize(
    ("line", "key", "words"),
    [
        ("focal_length_m = 16.0", "focal_length_m", "from 0.001 to 1 m, got 16.0"),  # millimetres
        ("pixel_pitch_m = 5.5", "pixel_pitch_m", "from 1e-06 to 5e-05 m, got 5.5"),  # micrometres
        ("focal_length_mm = 16.0", "focal_length_mm", "a known key"),
        ('width_px = "2048"', "width_px", "from 16 to 16384 px, got '2048'"),
        ("width_px = true", "width_px", "from 16 to 16384 px, got True"),
        ("width_px = 1440.5", "width_px", "expected a whole number from 16 to 16384 px, got 1440.5"),
        ("principal_point_px = [5.629, 2.989]", "principal_point_px", "middle, got [5.629, 2.989]"),  # millimetres
        ("principal_point_px = [1023.5, 1023.5]", "principal_point_px", "u from 511.5 to 1535.5 px, v from 271.5"),
        ("principal_point_px = [1023.5]", "principal_point_px", "2 numbers [px], none beyond 4096, got [1023.5]"),
        ('principal_point_px = ["a", "b"]', "principal_point_px", "2 numbers [px]"),
    ],
)
def test_a_wrong_unit_or_type_is_refused_with_file_key_and_limits(tmp_path, line, key, words):
    file = tmp_path / "camera.toml"
    kept = [old for old in SHEET.splitlines() if not old.startswith(line.split(" ")[0] + " ")]
    file.write_text("\n".join([*kept, line]), encoding="utf-8")
    with pytest.raises(DockairError) as error:
        Camera.from_toml(file)
    assert str(error.value).startswith(f"{file}: {key}: expected ")
    assert words in str(error.value)


def test_a_ring_in_millimetres_is_refused_with_file_key_and_limits(tmp_path):
    file = tmp_path / "ring.toml"
    file.write_text("diameter_m = 500\ncount = 8\n", encoding="utf-8")
    with pytest.raises(DockairError) as error:
        LedRing.from_toml(file)
    assert str(error.value) == f"{file}: diameter_m: expected a number from 0.05 to 5 m, got 500"


@pytest.mark.parametrize("off", [-0.25, 0.25])
def test_a_sheets_principal_point_is_within_a_quarter_of_the_sensor_of_its_middle(tmp_path, off):
    file, (u, v) = tmp_path / "camera.toml", (1023.5 + off * 2048, 543.5 + off * 1088)
    file.write_text(SHEET.replace("[1023.5, 543.5]", f"[{u}, {v}]"), encoding="utf-8")
    assert Camera.from_toml(file).principal_point_px == (u, v)
    for beyond in ((u + 0.1 * off, v), (u, v + 0.1 * off)):
        file.write_text(SHEET.replace("[1023.5, 543.5]", str(list(beyond))), encoding="utf-8")
        with pytest.raises(DockairError, match="around the sensor's middle"):
            Camera.from_toml(file)


@pytest.mark.parametrize("key", ["focal_length_m", "pixel_pitch_m", "width_px", "height_px", "principal_point_px"])
def test_a_missing_key_is_refused_by_name(tmp_path, key):
    file = tmp_path / "camera.toml"
    file.write_text("\n".join(line for line in SHEET.splitlines() if not line.startswith(key)), encoding="utf-8")
    with pytest.raises(DockairError, match="no such key") as error:
        Camera.from_toml(file)
    assert error.value.where == f"{file}: {key}"


@pytest.mark.parametrize(
    ("text", "got"), [("diamter_m = 0.5", "diamter_m"), ("diameter_m = = 1", None)], ids=["unknown key", "not TOML"]
)
def test_wrong_sheet_is_refused_with_its_path(tmp_path, text, got):
    file = tmp_path / "ring.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DockairError) as error:
        LedRing.from_toml(file)
    assert str(file) in error.value.where
    assert got is None or (error.value.got == got and "diameter_m" in error.value.exists)


def test_a_sheet_that_is_no_text_is_refused_with_its_path(tmp_path):
    file = tmp_path / "camera.toml"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DockairError, match=r"camera.toml: expected TOML, got .*utf-8"):
        Camera.from_toml(file)


def test_missing_sheet_is_refused_with_its_path(tmp_path):
    with pytest.raises(DockairError, match="no such file"):
        Camera.from_toml(tmp_path / "nothing.toml")
