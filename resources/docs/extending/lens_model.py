"""
A lens model
============

The division model with one parameter, ``x / (1 + q r²)``. A record gives the distortion of the collinearity image and
its derivatives by all parameters; the inverse follows by Newton's method. Calibration, reconstruction and exchange use
it like any other model. A device selects it in ``project.json`` by ``"interior": {"model": "division"}``.
"""

import matplotlib.pyplot as plt
import numpy as np

from core.api import project_points
from core.geometry import LENSES, Lens, distort, undistort
from core.geometry.lens import Parameter
from core.model import DeviceSpec, Interior


def bend(interior, xy):
    """Give the measured image (..., 2) of the collinearity image, mm."""
    r2 = np.sum(xy**2, axis=-1, keepdims=True)
    return xy / (1 + interior.a[0] * r2) + [interior.x0_mm, interior.y0_mm]


def derivatives(interior, xy):
    """Give derivatives by the collinearity image (..., 2, 2) and by c, x0, y0 and q (..., 2, 4)."""
    q, r2 = interior.a[0], np.sum(xy**2, axis=-1)[..., None, None]
    by_xy = np.eye(2) / (1 + q * r2) - 2 * q * xy[..., :, None] * xy[..., None, :] / (1 + q * r2) ** 2
    by_c = by_xy @ xy[..., None] / interior.c_mm
    by_q = -xy[..., None] * r2 / (1 + q * r2) ** 2
    return by_xy, np.concatenate([by_c, np.broadcast_to(np.eye(2), by_xy.shape), by_q], axis=-1)


LENSES["division"] = Lens(
    "division", (Parameter("q", "mm⁻²", "radial"),), bend, derivatives, lambda spec: np.array([0.1, 0.1, 0.1, 1e-3])
)

# %%
# A grid of points in front of a device with such a lens.
spec, interior = DeviceSpec(640, 480, (0.01, 0.01), 5.0), Interior(5.0, a=(0.02,), model="division")
grid = np.stack(np.meshgrid(np.linspace(-300, 300, 13), np.linspace(-220, 220, 10), [-500.0]), axis=-1).reshape(-1, 3)
bent = project_points((spec, interior), grid).uv
straight = project_points((spec, Interior(5.0, a=(0.0,), model="division")), grid).uv
xy = np.array([[1.0, -0.5], [2.5, 2.0]])
assert np.abs(undistort(interior, distort(interior, xy)) - xy).max() < 1e-9

plt.plot(*straight.T, "k.", ms=2, label="without distortion")
plt.plot(*bent.T, "C1+", label="division, q = 0.02")
plt.gca().invert_yaxis()
plt.legend()
plt.show()
