"""The tables of a scenario that say who navigates and how the receiver docks."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from dockair.errors import DockairError
from dockair.scenarios.class_by_name import by_module, file_and_class, require_importable
from dockair.scenarios.refusal import Expected
from dockair.scenarios.tables.table import Table

OUR_NAVIGATOR = "dockair.nav.navigator:Navigator"


class Navigation(Table):
    """Who navigates: a class with `messages.Navigates`' method, or "truth" for perfect navigation."""

    #: a class of a module, from where one stands or installed, or in a file, from the scenario's; "truth" is perfect
    #: navigation
    navigator: Annotated[
        str,
        Field(pattern=r"^(truth|[A-Za-z_][\w.]*:[A-Za-z_]\w*|.*\.py:[A-Za-z_]\w*)$"),
        Expected('"truth", "module:Class" or "file.py:Class"'),
    ] = OUR_NAVIGATOR
    heading: bool = False  #: it keeps the receiver's heading, too, by frames that it asks for (docs/heading.md)
    heading_every_s: float = Field(default=2.0, ge=0.5, le=5.0)  #: between two such frames

    @model_validator(mode="after")
    def _ours_keeps_the_heading(self) -> Self:
        if self.heading and self.navigator != OUR_NAVIGATOR:
            expected = f"false but with {OUR_NAVIGATOR}, which alone keeps a heading"
            raise DockairError("navigation.heading", expected=expected, got=self.heading)
        return self

    @model_validator(mode="after")
    def _may_be_imported(self) -> Self:
        file, _ = file_and_class(self.navigator)
        if file:
            try:
                require_importable(file)
            except DockairError as error:
                raise error.at("navigation.navigator") from None
        return self

    @property
    def name(self) -> str:
        """The navigator's class as it is shown and counted: by its module, wherever the file is."""
        return by_module(self.navigator)

    @property
    def is_truth(self) -> bool:
        """Whether the truth stands in place of `nav`."""
        return self.navigator == "truth"


class Guidance(Table):
    """How the receiver docks."""

    controller: Literal["predictive", "pid"] = "predictive"  #: "pid" is the baseline without foresight
    attempts_max: int = Field(default=3, ge=1, le=20)  #: attempts in one flight; 1: no retry
    capture_radius_m: float = Field(default=0.12, gt=0.0, le=1.0)  #: predicted miss inside which it closes, at first
    closure_speed_m_s: float = Field(default=1.2, ge=0.5, le=1.5)  #: at contact; more is not gained on the way
    hold_s: float = Field(default=5.0, ge=0.0, le=300.0)  #: on the probe in the refuelling range, before disconnecting
    take_in_m: float = Field(default=2.5, ge=0.0, le=6.0)  #: hose pushed in before holding
    stabilise_s: float = Field(default=3.0, ge=0.0, le=60.0)  #: steady in pre-contact before closing; 0: at once
