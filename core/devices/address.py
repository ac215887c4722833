"""Device URLs: ``kind:place?option=value&option=value``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from urllib.parse import quote, unquote

from core.errors import InputError


@dataclass
class Address:
    """A device URL, taken apart.

    Examples
    --------
    >>> address = parse_address("virtual:quick?pose=3&settle_ms=2.5")
    >>> address.kind, address.place, address.integer("pose", 0), address.real("settle_ms", 14.0)
    ('virtual', 'quick', 3, 2.5)
    """

    url: str
    kind: str
    place: str
    options: dict[str, str]
    asked: set[str] = field(default_factory=set)

    def text(self, key: str, default: str, among: Sequence[str] | None = None) -> str:
        """Read an option's text, of a closed set if `among` is given."""
        self.asked.add(key)
        value = self.options.get(key, default)
        if among and value not in among:
            raise InputError(self.url, f"{key} is {value!r}", f"use {', '.join(among)}")
        return value

    def real(self, key: str, default: float, least: float = 0.0, most: float = math.inf) -> float:
        """Read an option's number."""
        self.asked.add(key)
        if key not in self.options:
            return default
        try:
            value = float(self.options[key])
        except ValueError:
            value = math.nan
        if not least <= value <= most or math.isinf(value):
            raise InputError(self.url, f"{key} is {self.options[key]!r}", f"give a number from {least:g} to {most:g}")
        return value

    def optional(self, key: str, least: float = 0.0) -> float | None:
        """Read an option's number; None without it."""
        self.asked.add(key)
        return self.real(key, 0.0, least) if key in self.options else None

    def integer(self, key: str, default: int, least: int = 0, most: int = 2**31) -> int:
        """Read an option's whole number."""
        value = self.real(key, default, least, most)
        if value != int(value):
            raise InputError(self.url, f"{key} is {self.options[key]!r}", "give a whole number")
        return int(value)

    def place_number(self, what: str) -> int:
        """Read the place as the number of a device: 0, 1, ..."""
        if not self.place.isdigit():
            raise InputError(self.url, f"{what} {self.place!r}", f"give its number, as in {self.kind}:0")
        return int(self.place)

    def finish(self) -> None:
        """Refuse options that nobody asked for."""
        unknown = [key for key in self.options if key not in self.asked]
        if unknown:
            allowed = ", ".join(sorted(self.asked)) or "none"
            raise InputError(self.url, f"option {unknown[0]!r}", f"{self.kind} devices take: {allowed}")


def with_option(url: str, key: str, value: str | float | None) -> str:
    """Give a device URL with an option set to a value, or taken out where the value is None.

    Examples
    --------
    >>> with_option("virtual:quick?shot=depth-01&gain=2", "shot", "plane+15")
    'virtual:quick?shot=plane%2B15&gain=2'
    >>> with_option("uvc:0?exposure=150", "exposure", None)
    'uvc:0'
    """
    head, _, tail = url.partition("?")
    options = {name: text for name, _, text in (item.partition("=") for item in tail.split("&") if item)}
    options[key] = "" if value is None else quote(value if isinstance(value, str) else f"{value:g}", safe="-_:/.,@")
    if value is None:
        del options[key]
    return head + "?" * bool(options) + "&".join(f"{name}={text}" for name, text in options.items())


def parse_address(url: str) -> Address:
    """Take a device URL apart."""
    head, _, tail = url.partition("?")
    kind, colon, place = head.partition(":")
    if not kind.isalnum() or not colon:
        raise InputError("device URL", f"{url!r}", "write KIND:PLACE, as in virtual:quick or serial:/dev/ttyUSB0")
    options = {}
    for item in filter(None, tail.split("&")):
        key, equals, value = item.partition("=")
        if not key or not equals:
            raise InputError(url, f"option {item!r}", "write NAME=VALUE")
        options[key] = unquote(value)
    return Address(url, kind.lower(), place, options)
