"""Who a station or a point of a network is, where it comes from a project."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TargetId:
    """A target of a testfield."""

    row: int
    col: int

    def __str__(self) -> str:
        """Give the name of its point."""
        return f"{self.row}/{self.col}"


@dataclass(frozen=True)
class StationId:
    """A device before the board of one capture; `by` is the device it was matched with, where there are several."""

    capture: str
    device: str
    by: str = ""

    def __str__(self) -> str:
        """Give the name of the station."""
        return f"{self.capture}/{self.device}" + (f" by {self.by}" if self.by else "")
