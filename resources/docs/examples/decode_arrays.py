"""
Frames to projector coordinates, from arrays
============================================

A camera looks at a screen that shows Gray code and four steps of a sine along columns and rows. Decoding gives each
pixel the projector line that lit it, with its standard deviation. Nothing is read from a file.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import map_coordinates

from core.api import decode_frames
from core.patterns import SequenceSpec, pattern_image

lines = (128, 96)  # columns and rows of the projector
patterns = SequenceSpec("gray-sine", {"period": 8}).patterns(lines)

# %%
# What the camera sees: the screen a little larger and skew, grey values of noise 1.5.
v, u = np.mgrid[0:120, 0:160].astype(float)
true_u, true_v = 4 + 0.7 * u + 0.02 * v, 5 + 0.65 * v - 0.01 * u
rng = np.random.default_rng(1)


def photograph(pattern):
    """Take one image."""
    light = map_coordinates(pattern_image(pattern, *lines), [true_v, true_u], order=1)
    return np.uint8(np.clip(np.rint(20 + 180 * light + rng.normal(0, 1.5, light.shape)), 0, 255))


images = [photograph(pattern) for pattern in patterns]
phase = decode_frames(patterns, images, projector_size=lines)

# %%
# The error against the truth, beside the standard deviation that was predicted.
error = phase.u - true_u
observed, predicted = float(np.nanstd(error)), float(np.sqrt(np.nanmean(phase.sigma_u**2)))
print(f"{np.isfinite(phase.u).mean():.1%} of the pixels, error {observed:.4f} lines, predicted {predicted:.4f}")

figure, axes = plt.subplots(1, 3, figsize=(11, 2.8), layout="constrained")
for axis, image, title in zip(
    axes, (images[len(images) // 4], phase.u, error), ("one frame", "u [lines]", "error of u [lines]"), strict=True
):
    shown = axis.imshow(image, cmap="gray" if title == "one frame" else "viridis")
    axis.set_title(title)
    figure.colorbar(shown, ax=axis)
plt.show()
