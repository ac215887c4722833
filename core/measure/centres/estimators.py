"""How the centre of a dot follows from its pixels, by the name that `# estimator:` gives in a testfield's file."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.measure.centres.centroid import centroids
from core.measure.centres.ellipse import ellipse_centres
from core.measure.centres.profile import Profiles
from core.measure.centres.rays import Rays
from core.model import Array


class Estimator(Protocol):
    """Centres (m, 2) and covariances (m, 2, 2), px, of dots seen bright; the arguments are those of `centroids`."""

    def __call__(
        self, image: NDArray[np.float32], rays: Rays, profile: Profiles, light: Array, noise: tuple[float, float], /
    ) -> tuple[Array, Array]:
        """Estimate."""
        ...


ESTIMATORS: dict[str, Estimator] = {"centroid": centroids, "ellipse": ellipse_centres}
