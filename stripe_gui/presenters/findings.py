"""What the checks of a capture or of a rig found, in the operator's language."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import QCoreApplication

from core.capture import Finding

translate = QCoreApplication.translate


def check_name(check: str) -> str:
    """Name a check in the operator's language."""
    return {
        "identity": translate("Capturing", "Patterns"),
        "modulation": translate("Capturing", "Stripes"),
        "saturation": translate("Capturing", "Saturation"),
        "lamp": translate("Capturing", "Lamp"),
        "movement": translate("Capturing", "Movement"),
        "exposure": translate("Capturing", "Exposure"),
        "settle": translate("Capturing", "Settle time"),
        "linearity": translate("Capturing", "Linearity"),
        "focus": translate("Capturing", "Focus"),
        "order": translate("Capturing", "Order"),
        "orientation": translate("Capturing", "Orientation"),
        "visibility": translate("Capturing", "Working depth"),
    }.get(check, check)


def check_picture(check: str) -> str:
    """Say what a check's picture shows."""
    return {
        "exposure": translate("Capturing", "white, as a share of the range"),
        "linearity": translate("Capturing", "what half the light is seen as"),
        "focus": translate("Capturing", "modulation of the finest stripes, 1 is sharp"),
        "order": translate("Capturing", "contradiction between frames, 0 is none"),
        "orientation": translate("Capturing", "the projector's column"),
    }.get(check, "")


def check_axes(check: str) -> tuple[str, str]:
    """Name the axes of a check's curve."""
    return {
        "settle": (
            translate("Capturing", "delay after the acknowledgement [ms]"),
            translate("Capturing", "light, white is 1"),
        ),
        "linearity": (translate("Capturing", "light meant"), translate("Capturing", "light seen")),
        "visibility": (
            translate("Capturing", "position of the plate [mm]"),
            translate("Capturing", "modulation [grey values]"),
        ),
    }.get(check, ("", ""))


def level_name(level: str) -> str:
    """Say in a word how good a finding is."""
    return {
        "good": translate("Capturing", "good"),
        "warning": translate("Capturing", "could be better"),
        "bad": translate("Capturing", "wrong"),
    }[level]


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Order findings: what is wrong, what could be better, what is good."""
    return sorted(findings, key=lambda f: ("bad", "warning", "good").index(f.level))
