"""The serial ports of this machine: whose they are, what stays the same about them, and why one does not open."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

Identity = tuple[int, int, str]  # vendor, product and serial number of a USB device

_BY_ID = Path("/dev/serial/by-id")


def identity_of(place: str) -> Identity | None:
    """Give what tells a port's device from all others; None for a port that has no such thing."""
    real = os.path.realpath(place)
    return next((_identity(port) for port in _ports() if os.path.realpath(port.device) == real), None)


def find_again(identity: Identity) -> str | None:
    """Give the name that a device has now; None while it is away."""
    return next((str(port.device) for port in _ports() if _identity(port) == identity), None)


def opening_remedy(place: str) -> str:
    """Say what to do about a port that does not open."""
    if os.path.exists(place) and not os.access(place, os.R_OK | os.W_OK):
        if (group := _group(place)) is None:
            return "ask the owner of this computer for the right to use it"
        return f"it belongs to the group {group}: `sudo usermod -aG {group} $USER`, then log in again"
    if not os.path.exists(place) and (there := proposals()):
        return f"use one that is there: {', '.join(there)}"
    return "check cable and port name, and that no other program uses the port"


def proposals() -> list[str]:
    """Name the ports that are there, by names that stay the same where the system gives such."""
    stable = sorted(str(path) for path in _BY_ID.iterdir()) if _BY_ID.is_dir() else []
    return stable or sorted(str(port.device) for port in _ports() if _identity(port) is not None)


def _group(place: str) -> str | None:
    try:
        import grp
    except ImportError:  # Windows knows no groups of files
        return None
    try:
        return grp.getgrgid(os.stat(place).st_gid).gr_name
    except (KeyError, OSError):
        return None


def _ports() -> list[Any]:
    from serial.tools import list_ports

    return list(list_ports.comports())


def _identity(port: Any) -> Identity | None:
    return (port.vid, port.pid, port.serial_number) if port.vid is not None and port.serial_number else None
