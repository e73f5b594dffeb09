"""What a report reads and writes: campaigns of one code; a page that is whole, or one line that says why not."""

import errno
import os
import stat
import sys

import pytest

from dockair.errors import DockairError, MachineError
from dockair.scenarios import cli
from dockair.scenarios.campaign import manifest, table
from dockair.scenarios.campaign.row import COLUMNS
from dockair.scenarios.report.folders import read_campaigns
from dockair.scenarios.report.page import write_text


@pytest.fixture
def campaign(tmp_path):
    """Make a folder with a campaign of one flight; its scenario's digest is the folder's name."""

    def make(name: str, **manifested):
        folder = tmp_path / name
        folder.mkdir()
        manifest.write_json({"plan": {"name": "made"}} | manifested, folder / manifest.FILE_NAME)
        values = {"scenario": "still_air", "seed": 0, "sensing": "camera", "attempts": 0, "scenario_hash": name}
        texts = {
            "attempt_log": "[]",
            "timeline": "[]",
            "nav_by_range": "[]",
            "error": "ValueError: made",
            "command": "",
        }
        texts["command"] = "dockair fly still_air --seed 0"
        table.write_table([dict.fromkeys(COLUMNS) | values | texts], folder)
        return folder

    return make


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ({"code": "c0de"}, {"code": "f00"}, "code c0de in {}/a, f00 in {}/b"),
        (
            {"code": "c0de", "plug_ins": {"mine": "1"}},
            {"code": "c0de", "plug_ins": {"mine": "2"}},
            "navigator mine 1 in {}/a, 2 in {}/b",
        ),
        (
            {"code": "c0de", "background": "analytic"},
            {"code": "c0de", "background": "mujoco"},
            "background analytic in {}/a, mujoco in {}/b",
        ),
    ],
)
def test_campaigns_of_two_codes_are_not_pooled(campaign, tmp_path, first, second, said):
    folders = [campaign("a", **first), campaign("b", **second)]
    with pytest.raises(DockairError) as refused:
        read_campaigns(folders)
    assert str(refused.value).startswith("FOLDER...: expected campaigns of the same code")
    assert said.format(tmp_path, tmp_path) in str(refused.value)
    assert all(len(read_campaigns([folder])) == 1 for folder in folders)


def test_campaigns_of_one_code_are_pooled_whoever_navigates(campaign):
    """A background is only named where a scenario left it to the machine; older manifests name no navigators."""
    same = {"code": "c0de"}
    folders = [
        campaign("a", background="analytic", **same),
        campaign("b", background="", plug_ins={"mine": "1"}, **same),
        campaign("c", background="", plug_ins={"another": "2"}, **same),
    ]
    assert len(read_campaigns(folders)) == 3


@pytest.mark.parametrize("option", ["--out", "--evidence"])
@pytest.mark.parametrize("place", ["/proc/x.html", "{}", "{}/a/manifest.json/x.html", "/proc/none/x.html"])
def test_a_page_that_cannot_be_written_is_one_line_and_status_two(
    campaign, tmp_path, monkeypatch, capsys, option, place
):
    folder = campaign("a")
    path = place.format(tmp_path)
    monkeypatch.setattr(sys, "argv", ["dockair", "report", str(folder), option, path])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert said.startswith(f"dockair: {path}: expected a file that can be written, got ")
    assert said.count("\n") == 1


def test_without_room_the_page_before_stays(tmp_path, monkeypatch):
    path = write_text("before", tmp_path / "pages" / "report.html")

    def no_room(file):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", no_room)
    with pytest.raises(MachineError, match=r"report.html: expected room to write; make some"):
        write_text("after", path)
    assert path.read_text() == "before"
    assert [found.name for found in path.parent.iterdir()] == ["report.html"]


def test_a_link_stays_a_link_and_a_pipe_a_pipe(tmp_path):
    (tmp_path / "link.html").symlink_to(tmp_path / "page.html")
    write_text("text", tmp_path / "link.html")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "page.html").read_text() == "text"
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_text("text", tmp_path / "pipe")
    assert os.read(reader, 10) == b"text"
    os.close(reader)
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_a_page_and_its_evidence_are_two_files(campaign, tmp_path, monkeypatch, capsys):
    folder = campaign("a")
    monkeypatch.setattr(sys, "argv", ["dockair", "report", str(folder), "--evidence", f"{tmp_path}/a/../a/report.html"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2
    assert "expected a file of its own, got" in capsys.readouterr().err
    assert not (folder / "report.html").exists()


@pytest.mark.parametrize("text", ["{}", "[]", '{"plan": {}}', '{"plan": null}', '{"plan": "levels"}'])
def test_a_manifest_without_a_plan_is_refused(campaign, text):
    folder = campaign("a")
    (folder / manifest.FILE_NAME).write_text(text)
    with pytest.raises(DockairError, match=r"manifest.json: expected the manifest of a campaign, got 'no plan"):
        read_campaigns([folder])
