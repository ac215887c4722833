"""What can be chosen about an adjustment."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AdjustOptions:
    """Options of `core.calibrate.adjust`.

    Attributes
    ----------
    max_iterations : int
        Iterations of one solution before it counts as not converging.
    tolerance : float
        What the last step leaves is shorter than this, all unknowns together, in units of their sigma, or lost in the
        rounding of vᵀPv.
    variance_components : bool
        Estimate one variance factor per device. Off, sigma0 is that of the given weights.
    reject_beyond : float or None
        Leave out observations whose normalised residual exceeds this, and say how many; None keeps them all and only
        reports the gross ones.
    """

    max_iterations: int = 60
    tolerance: float = 1e-5
    variance_components: bool = False
    reject_beyond: float | None = None


DEFAULT = AdjustOptions()
