"""Numbers without a subject: what several rooms need, told once, and light to import.

distributions.py   limits of the distributions that tests of hypotheses ask for; the error function
systems.py         a symmetric system: factor, solution, inverse; nonlinear least squares of few unknowns
small.py           small ones within kernels; not imported here, as it compiles
blocks.py          images that were compressed with losses
greys.py           the step of grey values, and where a camera's end
robust.py          spreads, medians and lines that gross errors do not move; small fits to many places at once
spread.py          some of many numbers, evenly or as if by lot
places.py          the nearest of some; between the pixels of an image, and beyond a few known places
"""

from core.numerics.blocks import compressed_in_blocks
from core.numerics.distributions import chi_square_limit, erf, fisher_above, fisher_limit, normal_limit
from core.numerics.greys import cut_off, quantum
from core.numerics.places import four_pixels, from_neighbours, nearest
from core.numerics.robust import (
    MEDIAN_OF_NORMAL,
    distinct,
    exponents,
    inverse_2x2,
    median_of,
    normal_equations,
    polynomial,
    polynomial_slopes,
    quantile_of,
    quantiles,
    quantiles_in,
    ranked,
    row_median,
    sigma_about_median,
    sigma_by_median,
    straight_line,
)
from core.numerics.spread import by_lot, scattered, spaced
from core.numerics.systems import factor_of, inverse_by, least_squares, solution_by

__all__ = [
    "MEDIAN_OF_NORMAL", "by_lot", "chi_square_limit", "compressed_in_blocks", "cut_off", "distinct", "erf", "exponents",
    "factor_of", "fisher_above", "fisher_limit", "four_pixels", "from_neighbours", "inverse_2x2", "inverse_by",
    "least_squares", "median_of", "nearest", "normal_equations", "normal_limit", "polynomial", "polynomial_slopes",
    "quantile_of", "quantiles", "quantiles_in", "quantum", "ranked", "row_median", "scattered", "sigma_about_median",
    "sigma_by_median", "solution_by", "spaced", "straight_line",
]  # fmt: skip
