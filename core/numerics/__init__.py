"""Numbers without a subject: what several rooms need, told once, and light to import.

distributions.py   limits of the distributions that tests of hypotheses ask for; the error function
neighbours.py      the nearest of a few thousand places
cholesky.py        a symmetric system: factor, solution, inverse
"""

from core.numerics.cholesky import factor_of, inverse_by, solution_by
from core.numerics.distributions import chi_square_limit, erf, fisher_limit, normal_limit
from core.numerics.neighbours import nearest

__all__ = [
    "chi_square_limit",
    "erf",
    "factor_of",
    "fisher_limit",
    "inverse_by",
    "nearest",
    "normal_limit",
    "solution_by",
]
