"""Files that outlive a power cut: what they hold is on the disk, and so is the folder's entry that names them."""

import errno
import os
from pathlib import Path

import pytest

from dockair.errors import DockairError, MachineError
from dockair.scenarios.campaign import folder as campaign_folder
from dockair.scenarios.campaign.journal import Journal
from dockair.scenarios.whole_file import write_text, write_whole


@pytest.fixture
def waited_for(monkeypatch):
    """Return the paths, relative to the working folder, that the disk was waited for, and the names put in place."""
    events: list[str] = []
    sync, replace = os.fsync, os.replace

    def synced(file):
        events.append(os.path.relpath(os.readlink(f"/proc/self/fd/{file}")))
        sync(file)

    def replaced(part, path):
        events.append(f"-> {Path(path).name}")
        replace(part, path)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    return events


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_file_is_on_the_disk_before_its_name_and_its_name_afterwards(waited_for):
    write_whole(Path("file"), b"new")
    assert waited_for == ["file.part", "-> file", "."]


def test_folders_that_are_made_for_a_file_are_on_the_disk_too(waited_for):
    write_text("text", Path("a/b/page.html"))
    assert waited_for[-3:] == ["a/b/page.html.part", "-> page.html", "a/b"]
    assert sorted(waited_for[:-3]) == [".", "a"]
    waited_for.clear()
    write_text("text", Path("a/b/page.html"))
    assert waited_for == ["a/b/page.html.part", "-> page.html", "a/b"]


def test_a_journal_and_its_folder_are_on_the_disk_before_its_first_row_and_rows_wait_for_no_folder(waited_for):
    campaign_folder.make(Path("a/out"))
    with Journal(Path("a/out")) as journal:
        assert sorted(waited_for) == [".", "a", "a/out"]
        waited_for.clear()
        for key in ("one", "two"):
            journal.append({"key": key})
        assert waited_for == ["a/out/journal.jsonl"] * 2


def test_rows_that_are_forgotten_are_off_the_disk_before_a_manifest_says_so(waited_for):
    campaign_folder.make(Path("out"))
    with Journal(Path("out")) as journal:
        journal.append({"key": "one"})
        waited_for.clear()
        journal.clear()
        assert waited_for == ["out/journal.jsonl"]


def test_a_folder_that_cannot_be_opened_for_another_reason_is_said(monkeypatch):
    really = os.open

    def opened(path, *arguments, **options):
        if os.path.isdir(path):
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE), str(path))
        return really(path, *arguments, **options)

    monkeypatch.setattr(os, "open", opened)
    with pytest.raises(OSError, match="open files"):
        write_whole(Path("file"), b"one")


def test_a_folder_that_no_one_can_open_or_wait_for_is_no_obstacle(monkeypatch):
    really, sync = os.open, os.fsync

    def opened(path, *arguments, **options):
        if os.path.isdir(path):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return really(path, *arguments, **options)

    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(os, "open", opened)
        write_whole(Path("file"), b"one")
    assert Path("file").read_bytes() == b"one"

    def failing(number):
        def synced(file):
            if os.path.isdir(f"/proc/self/fd/{file}"):
                raise OSError(number, os.strerror(number))
            sync(file)

        return synced

    monkeypatch.setattr(os, "fsync", failing(errno.EINVAL))
    write_whole(Path("file"), b"two")
    assert Path("file").read_bytes() == b"two"
    monkeypatch.setattr(os, "fsync", failing(errno.EIO))
    with pytest.raises(OSError, match="Input/output"):
        write_whole(Path("file"), b"three")


def test_what_is_no_file_takes_the_text_as_it_is_and_a_link_stays_one():
    os.mkfifo("pipe")
    reader = os.open("pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_text("text", Path("pipe"))
    assert os.read(reader, 99) == b"text" and Path("pipe").is_fifo()
    os.close(reader)
    Path("page").write_text("old")
    for target in ("page", "none yet"):
        Path("link").symlink_to(target)
        write_text("new", Path("link"))
        assert Path("link").is_symlink() and Path(target).read_text() == "new"
        Path("link").unlink()
    assert sorted(os.listdir()) == ["none yet", "page", "pipe"]


@pytest.mark.parametrize(
    ("number", "kind"), [(errno.ENOSPC, MachineError), (errno.EDQUOT, MachineError), (errno.EIO, OSError)]
)
def test_a_file_that_cannot_be_written_whole_is_as_it_was_and_nothing_lies_beside_it(monkeypatch, number, kind):
    write_whole(Path("file"), b"old")

    def refuse(file):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(kind):
        write_whole(Path("file"), b"new")
    assert os.listdir() == ["file"] and Path("file").read_bytes() == b"old"


def test_a_text_that_a_person_asked_for_is_refused_in_one_line(monkeypatch):
    Path("folder").mkdir()
    Path("file").write_text("")
    for path, got in (("folder", "a folder"), ("file/page", "(Not a directory|File exists)")):
        with pytest.raises(DockairError, match=f"^{path}: expected a file that can be written, got '{got}'"):
            write_text("text", Path(path))
    monkeypatch.setattr(os, "fsync", lambda file: (_ for _ in ()).throw(OSError(errno.ENOSPC, "full")))
    with pytest.raises(MachineError):
        write_text("text", Path("page"))
