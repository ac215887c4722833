"""What can be chosen about an adjustment."""

from __future__ import annotations

from core.lazy import dataclass


@dataclass(frozen=True)
class AdjustOptions:
    """Options of `core.calibrate.adjust`."""

    max_iterations: int = 60  #: iterations of one solution before it counts as not converging
    #: what the last step leaves is shorter than this, all unknowns together, in units of their sigma, or lost in the
    #: rounding of vᵀPv
    tolerance: float = 1e-5
    #: estimate one variance factor per device. Off, sigma0 is that of the given weights.
    variance_components: bool = False
    #: leave out observations whose normalised residual exceeds this, and say how many; None keeps them all and only
    #: reports the gross ones
    reject_beyond: float | None = None


DEFAULT = AdjustOptions()
