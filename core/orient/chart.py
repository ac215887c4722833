"""Captures one after the other: what every one should show if nothing has moved since those before it.

An estimate of the movement is ``x = G δ + noise`` of all parameters' errors δ, which are the same in every capture;
only G changes, with the scene. Against the calibration all captures of a rig at rest therefore have nearly the same
significance, whichever δ happens to be. What earlier captures showed tells far more precisely what the next one will:
the expectation of δ is carried from one to the next (Kalman's filter), and the innovations of a rig at rest are
independent, so that their tests give false alarms at the stated rate.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from core.lazy import dataclass
from core.model import Array, DriftPoint, Pair, RigMotion
from core.orient.freedom import DEFAULT, OrientOptions, orientation_freedom, significance_of

WARNING = 0.05


@dataclass(frozen=True)
class Expectation:
    """What is known of the errors of a pair's parameters: mean (k,) and covariance (k, k); captures that it is from."""

    mean: Array
    covariance: Array
    captures: int = 0


def expectation_of(pair: Pair, options: OrientOptions = DEFAULT) -> Expectation:
    """Give what is known before the first capture: the calibration's covariance, and how far rigs may have drifted."""
    free = orientation_freedom(pair, options)
    return Expectation(np.zeros(len(pair.covariance)), pair.covariance + free.covariance)


def judged(motion: RigMotion, before: Expectation, options: OrientOptions = DEFAULT) -> tuple[DriftPoint, Expectation]:
    """Hold one capture against those before it, the first against the calibration; give what is expected after it.

    A capture out of control changes no expectation.
    """
    G, P = motion.by_calibration, before.covariance
    expected, S = G @ before.mean, motion.noise + G @ P @ G.T
    p = significance_of(motion.shown - expected, S, motion.tiles) if before.captures else motion.p
    state = "action" if p < options.significance else "warning" if p < WARNING else "steady"
    point = DriftPoint(
        motion.capture, motion.camera, motion.projector, motion.shown, expected, np.sqrt(np.diagonal(S)), p, state
    )
    if state == "action" and before.captures:
        return point, before
    gain = np.linalg.solve(S, G @ P).T
    left = np.eye(len(P)) - gain @ G
    covariance = left @ P @ left.T + gain @ motion.noise @ gain.T
    return point, Expectation(before.mean + gain @ (motion.shown - expected), covariance, before.captures + 1)


def drift_chart(motions: Iterable[RigMotion], pair: Pair, options: OrientOptions = DEFAULT) -> tuple[DriftPoint, ...]:
    """Make the control chart of captures in the order they were taken, by one pair of devices and one calibration.

    The options' `significance` is the share of captures of a rig at rest that are called out of control ("action").
    """
    expectation, chart = expectation_of(pair, options), []
    for motion in motions:
        point, expectation = judged(motion, expectation, options)
        chart.append(point)
    return tuple(chart)
