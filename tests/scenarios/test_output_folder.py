"""Where a flight may be written, and what is never lost."""

import errno
import os
import signal
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import mujoco
import pytest

from dockair.errors import DockairError
from dockair.messages import Window
from dockair.nav.navigator import Navigator
from dockair.scenarios import file_lock
from dockair.scenarios.camera_process import OverlappedExposures
from dockair.scenarios.loop import fly
from dockair.scenarios.output_folder import (
    FLIGHT_FILES,
    FlightFolder,
    check_output_folder,
    made_folder,
    utf8_path_of,
)
from dockair.scenarios.schema import load_scenario


def filled(folder, *names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_text(name)
    return folder


def test_a_new_or_empty_folder_is_made(tmp_path):
    folder = FlightFolder(tmp_path / "a" / "b")
    assert folder.under_way.parent == tmp_path / "a" / "b" and list(folder.under_way.iterdir()) == []
    folder.forget()
    assert list((tmp_path / "a" / "b").iterdir()) == []


def test_an_earlier_flights_files_go_when_the_next_one_is_whole_and_others_stay(tmp_path):
    folder = filled(tmp_path / "out", *FLIGHT_FILES, "notes.txt")
    flight = FlightFolder(folder)
    (flight.under_way / "result.json").write_text("new")
    assert {path.name for path in folder.iterdir()} >= {*FLIGHT_FILES, "notes.txt"}
    flight.keep()
    assert sorted(path.name for path in folder.iterdir()) == ["notes.txt", "result.json"]
    assert (folder / "result.json").read_text() == "new"


def killed(flight) -> int:
    """Do what a flight does in a process that is then killed; return the number that it gave, 0 of none."""
    reader, writer = os.pipe()
    process = os.fork()
    if process == 0:
        try:
            os.write(writer, flight().to_bytes(4, "little"))
        finally:
            os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(process, 0)
    os.close(writer)  # of one that gave none the reader is at the end
    given = int.from_bytes(os.read(reader, 4), "little")
    os.close(reader)
    return given


def test_what_a_killed_flight_has_left_is_no_obstacle_and_no_part_of_the_next(tmp_path):
    def half() -> int:
        return (FlightFolder(tmp_path / "out").under_way / "estimates.parquet").write_text("half")

    assert killed(half) == 4
    assert (tmp_path / "out" / ".flight" / "estimates.parquet").is_file()
    check_output_folder(tmp_path / "out")
    flight = FlightFolder(tmp_path / "out")
    assert list(flight.under_way.iterdir()) == []
    flight.keep()
    assert list((tmp_path / "out").iterdir()) == []


def test_a_flight_that_is_killed_while_it_is_kept_never_looks_whole(tmp_path, monkeypatch):
    """Killed before its first file is moved, before its second, and so on, over an earlier flight of all files."""
    written = [name for name in FLIGHT_FILES if name != "messages.parquet"]
    replace, unlink = Path.replace, Path.unlink
    left: list[bool] = []

    def kept_until(step: int) -> int:
        steps = iter(range(step))

        def counted(act, *arguments, **options):
            if next(steps, None) is None:
                os.kill(os.getpid(), signal.SIGKILL)
            return act(*arguments, **options)

        flight = FlightFolder(tmp_path / str(step))
        for name in written:
            (flight.under_way / name).write_text("new")
        monkeypatch.setattr(Path, "replace", lambda *arguments: counted(replace, *arguments))
        monkeypatch.setattr(Path, "unlink", lambda *arguments, **which: counted(unlink, *arguments, **which))
        flight.keep()
        return 1

    for step in count():
        folder = filled(tmp_path / str(step), *FLIGHT_FILES)
        over = killed(partial(kept_until, step))
        found = {name: (folder / name).read_text() for name in FLIGHT_FILES if (folder / name).exists()}
        is_whole = found in (dict.fromkeys(written, "new"), {name: name for name in FLIGHT_FILES})
        assert is_whole or "result.json" not in found
        left.append(is_whole)
        if over:
            break
    assert left[0] and left[-1] and not all(left) and len(left) > len(FLIGHT_FILES)


def test_a_folder_in_which_none_can_be_made_is_left_to_others(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "mkdir", lambda path, **how: None if how else refuse())
        with pytest.raises(DockairError, match="a folder that can be written, got 'No space left on device'"):
            FlightFolder(tmp_path)
    FlightFolder(tmp_path).forget()
    assert list(tmp_path.iterdir()) == []


def test_a_fork_of_a_killed_flight_does_not_keep_the_folder(tmp_path):
    """Whatever it is that a flight forks once the folder is its own; this one would live for ever."""
    ends, kept_open = os.pipe()
    begun, begins = os.pipe()

    def with_fork() -> int:
        FlightFolder(tmp_path / "out")
        if (child := os.fork()) == 0:
            os.close(kept_open)
            os.write(begins, b"x")
            os.read(ends, 1)  # until the test is over
            os._exit(0)
        os.read(begun, 1)
        return child

    child = killed(with_fork)
    os.kill(child, 0)  # it lives
    FlightFolder(tmp_path / "out").forget()
    for file in (ends, kept_open, begun, begins):
        os.close(file)


def test_a_fork_that_ends_does_not_end_the_lock(tmp_path):
    flight = FlightFolder(tmp_path / "out")
    exposures = OverlappedExposures(
        SimpleNamespace(full_window=Window(0, 4, 0, 4)), mujoco.MjModel.from_xml_string("<mujoco/>")
    )
    exposures.close()
    with pytest.raises(DockairError, match="another flight is being written there"):
        FlightFolder(tmp_path / "out")
    flight.forget()


def test_a_second_flight_into_one_folder_is_refused_and_leaves_the_first(tmp_path):
    folder = filled(tmp_path / "out", "result.json")
    first = FlightFolder(folder)
    (first.under_way / "result.json").write_text("new")
    with pytest.raises(DockairError) as refused:
        fly(load_scenario("truth_navigation", {"flight.duration_s": 0.1}), out=folder)
    expected = "expected a folder for this flight alone, got 'another flight is being written there'"
    assert (str(refused.value), refused.value.exit_code) == (f"--out {folder}: {expected}", 2)
    first.keep()
    assert [(path.name, path.read_text()) for path in folder.iterdir()] == [("result.json", "new")]


def test_a_flight_that_is_over_does_not_forget_the_next_ones_files(tmp_path):
    first = FlightFolder(tmp_path / "out")
    first.keep()
    second = FlightFolder(tmp_path / "out")
    first.forget()
    assert second.under_way.is_dir()
    second.forget()


def test_a_lock_is_held_until_its_file_is_gone(tmp_path, monkeypatch):
    """Were it let go before, another could take it, and would have its own file removed."""
    lock, unlink, free = file_lock.LockFile(tmp_path / "lock"), Path.unlink, []

    def watched(path, **how):
        with path.open() as other:
            free.append(file_lock.has_locked(other.fileno()))
        unlink(path, **how)

    monkeypatch.setattr(Path, "unlink", watched)
    lock.release()
    assert free == [False] and not lock.is_held and list(tmp_path.iterdir()) == []


def test_who_opened_the_lock_before_it_was_removed_takes_the_new_one(tmp_path, monkeypatch):
    """The first flight ends, and removes its lock, between the second's opening of it and its locking."""
    first, has_locked = FlightFolder(tmp_path), file_lock.has_locked

    def late(file):
        first.forget()
        return has_locked(file)

    monkeypatch.setattr(file_lock, "has_locked", late)
    second = FlightFolder(tmp_path)
    monkeypatch.undo()
    with pytest.raises(DockairError, match="another flight is being written there"):
        FlightFolder(tmp_path)
    second.forget()


def test_a_folder_without_room_for_the_messages_can_be_flown_into_again(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError("no room")

    with monkeypatch.context() as full:
        full.setattr("dockair.scenarios.recorder.MessageLog", refuse)
        with pytest.raises(OSError, match="no room"):
            fly(load_scenario("still_air"), out=tmp_path / "out")
    FlightFolder(tmp_path / "out").forget()


def test_a_folder_whose_name_is_no_utf8_takes_a_flight(tmp_path):
    folder = tmp_path / os.fsdecode(b"\xff")
    fly(load_scenario("truth_navigation", {"flight.duration_s": 0.1}), out=folder)
    assert {path.name for path in folder.iterdir()} == {*FLIGHT_FILES} - {
        "messages.parquet", "estimates.parquet", "navigator.json", "scenario_camera.toml", "scenario_ring.toml"
    }  # fmt: skip


def test_a_path_of_utf8_is_given_for_any_folder_and_nothing_of_it_is_left(tmp_path):
    odd = tmp_path / os.fsdecode(b"\xff")
    odd.mkdir()
    for folder in (tmp_path, odd):
        with utf8_path_of(folder) as place:
            str(place).encode()
            (place / "file").write_text("text")
        assert (folder / "file").read_text() == "text"
        assert place == folder or not place.parent.exists()


class _EndsHalfway:
    """A navigator of one's own that answers nothing after some ticks."""

    def __init__(self, sheets):
        self._good, self._ticks = Navigator(sheets), 0

    def step(self, imu, frame):
        self._ticks += 1
        return None if self._ticks > 20 else self._good.step(imu, frame)


@pytest.mark.parametrize("record", ["window", "none"])
def test_a_flight_that_comes_to_nothing_leaves_the_earlier_one(tmp_path, record):
    folder = filled(tmp_path / "out", *FLIGHT_FILES, "notes.txt")
    with pytest.raises(DockairError, match="expected a NavSolution"):
        fly(load_scenario("still_air", {"navigation.navigator": f"{__name__}:_EndsHalfway"}), out=folder, record=record)
    assert sorted(path.name for path in folder.iterdir()) == sorted([*FLIGHT_FILES, "notes.txt"])
    assert all((folder / name).read_text() == name for name in FLIGHT_FILES)


@pytest.mark.parametrize("act", [check_output_folder, FlightFolder])
def test_a_file_or_a_folder_with_other_peoples_files_is_refused_untouched(tmp_path, act):
    thesis = filled(tmp_path / "mine", "thesis.tex") / "thesis.tex"
    for folder in (thesis, thesis.parent):
        with pytest.raises(DockairError, match="expected a new or empty folder, or one with an earlier flight"):
            act(folder)
    assert thesis.read_text() == "thesis.tex"


def test_checking_changes_nothing(tmp_path):
    folder = filled(tmp_path / "out", *FLIGHT_FILES)
    check_output_folder(folder)
    check_output_folder(tmp_path / "new")
    assert sorted(path.name for path in folder.iterdir()) == sorted(FLIGHT_FILES)
    assert not (tmp_path / "new").exists()


def test_a_flight_that_cannot_be_built_leaves_the_earlier_one(tmp_path):
    folder = filled(tmp_path / "out", "result.json", "episode.rrd")
    with pytest.raises(DockairError, match="nobody:Here"):
        fly(load_scenario("still_air", {"navigation.navigator": "nobody:Here"}), out=folder)
    assert sorted(path.name for path in folder.iterdir()) == ["episode.rrd", "result.json"]


def test_a_folder_is_made_and_nothing_is_left_in_it(tmp_path):
    assert made_folder(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    assert made_folder(tmp_path / "a") == tmp_path / "a"
    assert [path.name for path in tmp_path.rglob("*")] == ["a", "b"]
