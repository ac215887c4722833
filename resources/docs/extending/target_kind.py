"""
A kind of target
================

Single bright pixels, on a board whose file says ``# kind: sparks``. A kind finds its targets in an evenly lit image,
guesses which is which, and measures the position of each with a covariance. Projector coordinates, the edge of the
light and the orientation of the board in all images are handled alike for every kind.
"""

import matplotlib.pyplot as plt
import numpy as np

from core.measure import TARGET_KINDS, Marks, TargetKind, recognise
from core.model import DeviceSpec, PhaseMap, Seed, Testfield


def guess(image, field, camera, known, side):
    """Give what is seen and possible picks: four corners seen from the front, row 0 at the top."""
    v, u = np.nonzero(image > image.max() / 2)
    last = field.row.max(), field.col.max()
    corners = [(0, 0, u.min(), v.min()), (0, last[1], u.max(), v.min())]
    corners += [(last[0], last[1], u.max(), v.max()), (last[0], 0, u.min(), v.max())]
    return np.column_stack([u, v]).astype(float), (tuple(Seed(*map(int, c)) for c in corners),)


def measure(sight, picks):
    """Take the brightest pixel near each target's position, which follows from the picks."""
    field = sight.testfield
    index = field.index()
    A = np.column_stack([field.xyz_mm[[index[p.row, p.col] for p in picks]][:, :2], np.ones(len(picks))])
    linear = np.linalg.lstsq(A, [[p.u, p.v] for p in picks], rcond=None)[0]
    uv = np.column_stack([field.xyz_mm[:, :2], np.ones(len(field.row))]) @ linear
    v, u = np.indices(sight.image.shape)
    for k, at in enumerate(uv):
        near = np.where(np.hypot(u - at[0], v - at[1]) < 4, sight.image, -np.inf)
        uv[k] = np.unravel_index(np.argmax(near), near.shape)[::-1]
    one, patch = np.ones(len(uv)), np.broadcast_to(2.0 * np.eye(2), (len(uv), 2, 2))
    return Marks(np.arange(len(uv)), uv, patch / 24, patch, one, one, 0 * uv, {}, ("to the pixel only",))


TARGET_KINDS["sparks"] = TargetKind("sparks", guess, measure, lambda image, field, uv, reach: uv, coded=True)

# %%
# An image of a board with such targets, and the projector coordinates as decoding would give them.
row, col = (a.ravel() for a in np.mgrid[0:4, 0:5])
field = Testfield(row, col, np.column_stack([30.0 * col, -30.0 * row, 0.0 * row]), np.full(20, 4.0), kind="sparks")
image = np.full((160, 200), 5, np.float32)
image[30 + 30 * row, 40 + 30 * col] = 200
v, u = np.indices(image.shape).astype(np.float32)
phase = PhaseMap(0.9 * u, 0.8 * v, 0 * u + 0.03, 0 * u + 0.04, 0 * u + 50, image, np.zeros(image.shape, np.uint8))
found, _ways = recognise(phase, field, DeviceSpec(200, 160, (0.01, 0.01), 12.0))
assert len(found.row) == 20

plt.imshow(image, cmap="gray")
plt.plot(*found.camera_uv.T, "C1+", label="measured")
plt.legend()
plt.show()
