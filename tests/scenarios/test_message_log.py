"""What is read back from a message log is what was delivered, to the last bit."""

import json
import os
import re
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum, StrEnum

import numpy as np
import pyarrow.parquet as pq
import pytest

from dockair.errors import DockairError, MachineError
from dockair.messages import Light, NavSolution, PodSignal, TankerAnnouncement
from dockair.scenarios import message_log, navigator_recipe
from dockair.scenarios.exact_json import decode, encode
from dockair.scenarios.message_log import (
    MessageLog,
    estimate_row,
    numbers,
    pixels_from_png,
    png_from_pixels,
    read_estimates,
    read_messages,
)
from dockair.scenarios.navigator_recipe import NavigatorRecipe


@dataclass(frozen=True)
class Settings:
    gain: float = 0.1 + 0.2
    limits: tuple[float, float] = (float("-inf"), 1e-308)
    table: dict[str, float] = field(default_factory=lambda: {"a": float("nan")})


def _with_forces(imu):
    """The samples with forces of their own; the last has none, as without accelerometers."""
    forces = [s.time_stamp_s * np.array([1.0, -2.0, 3.0]) + s.angular_rate_rad_s for s in imu[:-1]]
    return tuple(replace(s, specific_force_m_s2=f) for s, f in zip(imu, [*forces, np.full(3, np.nan)], strict=True))


def _bits(message):
    """Each field of a sensor's message, to the last bit; None of none."""
    values = [] if message is None else [getattr(message, f.name) for f in fields(message)]
    return [(v.dtype, v.shape, v.tobytes()) if isinstance(v, np.ndarray) else repr(v) for v in values] or None


def test_messages_are_read_back_as_they_were_delivered(hand_made, tmp_path):
    ticks = [(_with_forces(imu), frame, solution) for _, imu, frame, solution in hand_made.ticks(230)]
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as log:
        for imu, frame, solution in ticks:
            log.append(imu, frame, solution)
    read = list(read_messages(tmp_path))
    assert len(read) == len(list(read_estimates(tmp_path))) == 230  # more than two row groups
    for (imu, frame, _), messages in zip(ticks, read, strict=True):
        assert [_bits(sample) for sample in messages.imu] == [_bits(sample) for sample in imu]
        assert _bits(messages.frame) == _bits(frame)


def test_without_pixels_a_frame_is_what_came_with_it_and_its_png(hand_made, tmp_path):
    _, imu, frame, solution = hand_made.tick(2)
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as log:
        log.append(imu, frame, solution)
    (read,) = read_messages(tmp_path, pixels=False)
    assert read.frame.pixels.size == 0
    assert _bits(replace(read.frame, pixels=frame.pixels)) == _bits(frame)
    np.testing.assert_array_equal(pixels_from_png(read.png), frame.pixels)


def test_a_recording_of_before_there_were_announcements_and_lights_is_read(hand_made, tmp_path):
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as log:
        for _, imu, frame, solution in hand_made.ticks(3):
            log.append(imu, frame, solution)
    path = tmp_path / message_log.MESSAGES
    pq.write_table(pq.read_table(path).drop_columns(["announcement", "pod_signal"]), path)
    assert [(tick.announcement, tick.signal) for tick in read_messages(tmp_path)] == 3 * [(None, None)]


def test_a_folder_whose_name_is_no_utf8_takes_messages_and_gives_them_back(hand_made, tmp_path):
    folder = tmp_path / os.fsdecode(b"\xff")
    folder.mkdir()
    with MessageLog(folder, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as log:
        for _, imu, frame, solution in hand_made.ticks(3):
            log.append(imu, frame, solution)
    assert (len(list(read_messages(folder))), len(list(read_estimates(folder)))) == (3, 3)


def test_announcement_is_read_back_in_the_tick_it_was_made_in_and_in_no_other(hand_made, tmp_path):
    said = TankerAnnouncement(
        time_stamp_s=0.1 + 0.2, starts_s=12.25, entry_s=10.0, turn_rate_rad_s=0.0254, climb_rad=-0.0
    )
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as log:
        for k, (_, imu, frame, solution) in enumerate(hand_made.ticks(5)):
            log.append(imu, frame, solution, said if k == 3 else None)
    assert [messages.announcement for messages in read_messages(tmp_path)] == [None, None, None, said, None]


@pytest.mark.parametrize("light", Light)
def test_what_the_light_shows_is_read_back_in_its_tick(hand_made, tmp_path, light):
    shown = PodSignal(time_stamp_s=0.1 + 0.2, light=light)
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as log:
        for k, (_, imu, frame, solution) in enumerate(hand_made.ticks(3)):
            log.append(imu, frame, solution, signal=shown if k == 1 else None)
    assert [messages.signal for messages in read_messages(tmp_path)] == [None, shown, None]


def test_recordings_of_before_hold_whether_the_light_was_red():
    """As 1 and 0, of a light that had no other colours."""
    assert (Light(True), Light(False)) == (Light.RED, Light.AMBER)
    np.testing.assert_array_equal(numbers(PodSignal(time_stamp_s=1.5, light=Light.RED)), [1.5, 1.0])


def test_estimates_are_read_back_to_the_last_bit(hand_made, tmp_path):
    ticks = hand_made.ticks(12)
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as log:
        for _, imu, frame, solution in ticks:
            log.append(imu, frame, solution)
    for (_, _, _, solution), row in zip(ticks, read_estimates(tmp_path), strict=True):
        assert set(row) == {f.name for f in fields(NavSolution)}
        for name, value in estimate_row(solution).items():
            np.testing.assert_array_equal(row[name], value)
            if not isinstance(value, str):
                assert row[name].tobytes() == value.tobytes()


def test_every_number_of_a_solution_reaches_its_row(hand_made):
    """Were a field left out of the row, changing it would not show: each single change must change the row."""
    solution = hand_made.tick(2)[3]
    changes = {
        "time_stamp_s": 9.0,
        "valid": False,
        "phase": "hold",
        "status": "lost",
        "p_PD_B": solution.p_PD_B + 1e-16 * np.array([0, 1, 0]) + np.array([0, 0, 1e-12]),
        "v_PD_B": solution.v_PD_B + 1e-12,
        "R_BD": solution.R_BD.T,
        "covariance": solution.covariance * 2,
        "command": replace(solution.command, acceleration_m_s2=np.array([0.0, 0.0, 1e-9])),
        "window": None,
        "frame_time_stamp_s": 8.0,
        "candidates_px": solution.candidates_px[:-1],
        "led_pixels_px": np.full((8, 2), np.nan),
        "contact_usable": False,
        "phase_reason": "steady",
        "exposure_s": 5e-4,
        "heading_rad": 0.1,
        "heading_sigma_rad": 0.2,
    }
    assert set(changes) == {f.name for f in fields(NavSolution)}
    before = estimate_row(solution)
    for name, value in changes.items():
        after = estimate_row(replace(solution, **{name: value}))
        assert not np.array_equal(before[name], after[name], equal_nan=not isinstance(value, str)), name


def test_the_log_holds_no_field_of_the_truth(hand_made, tmp_path):
    """Two flights with the same messages and other truths write the same files."""
    for name, shift in (("a", 0.0), ("b", 1.0)):
        folder = tmp_path / name
        folder.mkdir()
        with MessageLog(folder, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as log:
            for truth, imu, frame, solution in hand_made.ticks(6):
                truth.p_WD[:] += shift
                log.append(imu, frame, solution)
    for file in (message_log.MESSAGES, message_log.ESTIMATES, navigator_recipe.NAVIGATOR):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_sheets_and_settings_come_back_bit_for_bit(hand_made):
    sheets = decode(encode(hand_made.sheets))
    for part in ("R_BC", "p_BC", "p_BP", "R_BI"):
        assert getattr(sheets.mounting, part).tobytes() == getattr(hand_made.sheets.mounting, part).tobytes()
    assert (sheets.camera, sheets.ring) == (hand_made.sheets.camera, hand_made.sheets.ring)
    settings = decode(encode(Settings()))
    assert (settings.gain, settings.limits) == (Settings().gain, Settings().limits)
    assert np.isnan(settings.table["a"])


class Grade(IntEnum):
    FINE = 2


class Kind(StrEnum):
    RING = "ring"


@dataclass(frozen=True)
class Derived:
    given: float
    made: float = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "made", 2.0 * self.given)


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6.0).reshape(2, 3),
        np.array([[np.nan, -np.inf, 5e-324]]),
        np.empty((0, 2)),
        np.array(3.5),
        np.array([1, -2], dtype=np.int32),
        np.array([True, False]),
        np.float32([0.1, 0.2]),
    ],
)
def test_an_array_comes_back_with_shape_and_kind_and_cannot_be_written(array):
    back = decode(json.loads(json.dumps(encode(array), allow_nan=False)))
    assert (back.shape, back.dtype, back.tobytes()) == (array.shape, array.dtype, array.tobytes())
    assert not back.flags.writeable


@pytest.mark.parametrize(
    "value",
    [
        (1, (2.0, "x"), [None, True]),
        {"a": (1,), 3: [0.1 + 0.2]},
        -0.0,
        [Light.GREEN, Light.RED],
        {Grade.FINE: Kind.RING},
        Derived(given=0.3),
        PodSignal(time_stamp_s=1.5, light=Light.RED),
    ],
)
def test_a_value_comes_back_of_the_kind_that_it_was(value):
    """A tuple is no list, a light no number; what a class makes itself it makes again."""
    assert repr(decode(json.loads(json.dumps(encode(value), allow_nan=False)))) == repr(value)


def test_what_has_no_exact_form_is_refused():
    with pytest.raises(DockairError, match="got 'object'"):
        encode(object())


def test_a_class_that_is_no_dataclass_is_refused():
    with pytest.raises(DockairError, match="dataclass or an enumeration"):
        decode({"class": "subprocess:Popen", "fields": {"args": "true"}})


def _log_that_fails(error, hand_made, tmp_path, monkeypatch):
    """A log of one tick whose encoder raises an error, and that tick's messages."""

    def fail(*_):
        raise error

    monkeypatch.setattr(message_log, "_message_row", fail)
    log = MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets))
    _, *messages = hand_made.tick(1)
    log.append(*messages)
    return log, messages


def test_a_full_disk_reaches_the_flight(hand_made, tmp_path, monkeypatch):
    log, _ = _log_that_fails(OSError("no space left on device"), hand_made, tmp_path, monkeypatch)
    with pytest.raises(MachineError, match="a disk that takes the recording; no space left on device"):
        log.close()


def test_a_disk_that_refuses_only_the_last_ticks_reaches_the_flight_too(hand_made, tmp_path, monkeypatch):
    """Fewer ticks than a row group has are written when the log is closed."""

    def refuse(*_):
        raise OSError("No space left on device")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", refuse)
    log = MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets))
    for _, imu, frame, solution in hand_made.ticks(3):
        log.append(imu, frame, solution)
    with pytest.raises(MachineError, match="No space left"):
        log.close()


def test_a_disk_that_refuses_to_close_the_files_reaches_the_flight_unless_it_refused_before(
    hand_made, tmp_path, monkeypatch
):
    def refuse_to(what):
        def refuse(*_):
            raise OSError(f"no space left to {what}")

        return refuse

    for earlier, said in ((False, "to close"), (True, "to write")):
        log = MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets))
        log._files.callback(refuse_to("close"))
        with monkeypatch.context() as patch:
            if earlier:
                patch.setattr(message_log, "_message_row", refuse_to("write"))
            _, imu, frame, solution = hand_made.tick(1)
            log.append(imu, frame, solution)
            with pytest.raises(MachineError, match=f"no space left {said}"):
                log.close()


def test_a_mistake_of_ours_in_the_encoders_thread_keeps_its_kind(hand_made, tmp_path, monkeypatch):
    log, messages = _log_that_fails(ValueError("a mistake"), hand_made, tmp_path, monkeypatch)
    with pytest.raises(ValueError, match="a mistake"):
        log.close()
    with pytest.raises(ValueError, match="a mistake"):  # nor are more ticks taken as if nothing had been
        log.append(*messages)


def test_a_flight_that_waits_for_the_encoder_goes_on_when_the_disk_refuses(hand_made, tmp_path, monkeypatch):
    """The first tick is refused while the flight waits with its third: it is told, and not left waiting."""
    waits = threading.Event()

    def refuse(*_):
        waits.wait(60.0)
        raise OSError("no space left on device")

    def fly():
        with suppress(MachineError):
            for _ in range(3):
                log.append(imu, frame, solution)

    monkeypatch.setattr(message_log, "_message_row", refuse)
    monkeypatch.setattr(message_log, "QUEUE_TICKS", 1)
    log = MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets))
    _, imu, frame, solution = hand_made.tick(1)
    flight, puts, put = threading.Thread(target=fly, daemon=True), [], log._queue.put
    monkeypatch.setattr(log._queue, "put", lambda entry: (puts.append(entry), put(entry)))
    flight.start()
    while len(puts) < 3:
        time.sleep(0.01)
    waits.set()
    flight.join(30.0)
    assert not flight.is_alive()
    with pytest.raises(MachineError, match="no space left on device"):
        log.close()


def test_a_folder_without_recording_says_what_is_missing(tmp_path):
    with pytest.raises(DockairError, match=r"messages\.parquet: expected a flight by camera, recorded with --record"):
        next(read_messages(tmp_path))


@pytest.mark.parametrize("damage", [lambda png: b"", lambda png: b"no picture", lambda png: png[:20]])
def test_a_frame_that_is_damaged_is_said_to_be(damage):
    png = png_from_pixels(np.arange(12, dtype=np.uint8).reshape(3, 4))
    np.testing.assert_array_equal(pixels_from_png(png), np.arange(12).reshape(3, 4))
    with pytest.raises(DockairError, match=r"messages\.parquet: expected frames .* cannot be decoded"):
        pixels_from_png(damage(png))


def test_a_damaged_frame_of_a_recording_is_told_with_its_file(hand_made, tmp_path, monkeypatch):
    _, imu, frame, solution = hand_made.tick(2)
    monkeypatch.setattr(message_log, "png_from_pixels", lambda pixels: b"no picture")
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as log:
        log.append(imu, frame, solution)
    path = re.escape(str(tmp_path / message_log.MESSAGES))
    with pytest.raises(DockairError, match=rf"^{path}: expected frames .* cannot be decoded"):
        list(read_messages(tmp_path))
