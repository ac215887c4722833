"""The rim of images that were interpolated from a colour filter's mosaic: beyond it is nothing to interpolate from.

OpenCV, like others, repeats the pixels beside it: their coordinates are a pixel's way wrong.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image
from core.decode.options import Flag, invalidate
from core.decode.tables import Singles


def drop_repeated(
    images: Sequence[Image], place: Singles, sigma: Singles, flags: NDArray[np.uint8], missing: Flag
) -> None:
    """Invalidate, in place, outermost rows and columns (H, W) that in every frame repeat those beside them.

    They are sound where the scene itself repeats: where those beside are the same as the next ones, too.
    """
    every = slice(None)
    for axis, size in enumerate(place.shape):
        for lines in ((0, 1, 2), (-1, -2, -3)) if size > 4 else ():
            rim, beside, within = ((every, n) if axis else (n, every) for n in lines)
            if all(np.array_equal(image[rim], image[beside]) for image in images) and any(
                np.ptp(image[rim]) and not np.array_equal(image[beside], image[within]) for image in images
            ):
                invalidate(place, sigma, flags, rim, int(Flag.BESIDE | missing))
