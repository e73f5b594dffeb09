from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest

from dockair.messages import CameraFrame, ImuSample, Window


def test_a_camera_frame_carries_what_a_camera_could_send_and_no_more() -> None:
    assert [f.name for f in fields(CameraFrame)] == ["time_stamp_s", "pixels", "window", "exposure_s", "gain"]


def test_an_imu_sample_carries_its_stamp_and_what_gyros_and_accelerometers_measured_and_no_more() -> None:
    assert [f.name for f in fields(ImuSample)] == ["time_stamp_s", "angular_rate_rad_s", "specific_force_m_s2"]


def test_an_instrument_without_accelerometers_says_so() -> None:
    assert np.isnan(ImuSample(time_stamp_s=0.0, angular_rate_rad_s=np.zeros(3)).specific_force_m_s2).all()


@pytest.mark.parametrize(
    "message",
    [
        CameraFrame(
            time_stamp_s=0.0,
            pixels=np.zeros((1, 1), dtype=np.uint8),
            window=Window(0, 1, 0, 1),
            exposure_s=1e-5,
            gain=1.0,
        ),
        ImuSample(time_stamp_s=0.0, angular_rate_rad_s=np.zeros(3)),
    ],
)
def test_a_sensor_message_can_neither_be_changed_nor_carry_an_extra_field(message: CameraFrame | ImuSample) -> None:
    with pytest.raises(FrozenInstanceError):
        message.time_stamp_s = 1.0  # type: ignore[misc]
    with pytest.raises((AttributeError, TypeError)):  # a frozen slotted dataclass raises the one or the other
        message.led_index = 3  # type: ignore[union-attr]
