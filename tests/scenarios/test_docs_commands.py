"""Every command that a page shows is one that `dockair` takes: options, scenarios, keys, plans and reproductions."""

import re
import shlex
from itertools import takewhile
from pathlib import Path

import pytest
import typer

from dockair.errors import DockairError
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.cli import app
from dockair.scenarios.commands.options import overrides
from dockair.scenarios.reproduce import registry
from dockair.scenarios.schema import load_scenario

ROOT = Path(__file__).parents[2]
PROGRAM = typer.main.get_command(app)
SHOWN = re.compile(r"^(?: {4}| +- run: )?(?:\$ )?dockair ([a-z][^`\n]*)$|`dockair ([a-z][^`]*)`", re.MULTILINE)
REFUSED = "fly evening.toml --set turbulence.sigma=0.8"  # shown with the error it makes
SPOKEN_OF = {"replay", "report", "report --evidence"}  # without what they are given
OF_THE_READER = re.compile(r"hardware\.ring=\"coded\.toml\"|navigation\.navigator=\w+\.py:\w+")  # files
STANDS_FOR = {"SCENARIO": "default", "NAME": "default", "N": "1", "n": "1"}  # in the text


def shown_commands():
    """The commands of all pages, each once."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]
    found = [pair for page in pages for pair in SHOWN.findall(page.read_text(encoding="utf-8"))]
    words = [shlex.split(block or text, comments=True) for block, text in found]
    return sorted({shlex.join(takewhile(lambda word: word != "|", command)) for command in words} - SPOKEN_OF)


def parsed(words):
    """The subcommand's name and its parameters, converted and checked by the program itself; nothing is run."""
    with PROGRAM.make_context("dockair", [words[0], "--help"], resilient_parsing=True) as outer:
        command = PROGRAM.get_command(outer, words[0])
        assert command is not None, words[0]
        with command.make_context(words[0], list(words[1:]), parent=outer) as inner:
            return words[0], inner.params


def check(command):
    """Look up what the command names, as the program would; files of the reader's own are the default scenario."""
    name, given = parsed([STANDS_FOR.get(word, word) for word in shlex.split(command)])
    own = {key for key in ("scenario", "name", "plan") if str(given.get(key)).endswith(".toml")}
    own -= {"plan"} if (ROOT / str(given.get("plan"))).exists() else set()
    if name in ("fly", "bench"):
        settings = [setting for setting in given["settings"] or [] if not OF_THE_READER.fullmatch(setting)]
        load_scenario("default" if own else given["scenario"], overrides(settings))
    elif name == "scenarios" and given["name"] and not given["keys"] and not own:
        load_scenario(given["name"])
    elif name == "campaign" and given["plan"] and not own:
        plan = given["plan"]
        PlanFile(str(ROOT / plan) if plan.endswith(".toml") else plan, {}, overrides(given["settings"]))
    elif name == "reproduce" and given["wanted"]:
        assert given["wanted"] in registry.ids()


@pytest.mark.parametrize("command", [command for command in shown_commands() if command != REFUSED])
def test_what_a_page_shows_is_a_command(command):
    check(command)


def test_the_steps_of_a_workflow_are_among_the_commands():
    assert {"campaign ci", "report out/campaigns/ci", "fly still_air --json"} <= set(shown_commands())


def test_the_command_that_a_page_shows_with_its_error_is_refused():
    assert REFUSED in shown_commands()
    with pytest.raises(DockairError) as refused:
        check(REFUSED)
    assert f"\n    dockair: {refused.value}\n" in (ROOT / "docs/tutorials/own_scenario.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "command", ["fly --sed 7", "fly nigth", "campaign levles", "reproduce world/wip", "bench --of loops", "fli"]
)
def test_a_command_that_is_none_would_be_found(command):
    with pytest.raises((DockairError, AssertionError, typer.TyperException)):
        check(command)
