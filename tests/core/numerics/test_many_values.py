"""Quantiles of many values, which some of them bracket, are those of all."""

import numpy as np
import pytest

from core.numerics import quantile_of, robust


@pytest.mark.parametrize("n", [robust.MANY - 1, robust.MANY, 12_345, 107_136])
@pytest.mark.parametrize("share", [0.0, 1e-4, 0.25, 0.5, 0.97, 1.0])
def test_a_quantile_of_many_values_is_that_of_all(n, share):
    rng = np.random.default_rng(n)
    for values in (
        rng.normal(size=n),
        np.rint(rng.normal(0, 3, n)).astype(np.float32),  # ties
        np.zeros(n),
        np.where(np.arange(n) % (n // robust.SOME), 1.0, 0.0)
        + np.arange(n) / n,  # in step with those that are looked at
        np.arange(n) % 256,
        np.append(rng.normal(size=n - 2), [np.nan, np.inf]),
    ):
        known = values[np.isfinite(values)]
        assert quantile_of(values, share) == pytest.approx(np.quantile(known, share), rel=1e-6, abs=1e-9)


def test_many_values_are_not_ranked_as_a_whole(monkeypatch):
    ranked: list[int] = []
    partition = np.partition
    monkeypatch.setattr(np, "partition", lambda values, rank: ranked.append(len(values)) or partition(values, rank))
    values = np.random.default_rng(1).normal(size=100_000)
    assert quantile_of(values, 0.5) == np.median(values)
    assert max(ranked) < 20_000
