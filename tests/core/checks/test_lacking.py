"""Terms without points and poses are what neither of these explains of them."""

import numpy as np
import pytest

from core.checks.lacking import _of_others


@pytest.mark.parametrize("poses", [12, 18], ids=["fewer than points", "more"])
def test_points_and_poses_are_eliminated(poses):
    rng, n, w = np.random.default_rng(8), 5, 4
    each = rng.normal(size=(80, 3))  # of one point in every row
    of = np.resize(np.arange(n), len(each))
    X = np.zeros((len(each), n, 3))
    X[np.arange(len(each)), of] = each
    X = X.reshape(len(each), -1)
    Q = np.linalg.qr(rng.normal(size=(len(each), poses)))[0]
    Z = rng.normal(size=(len(each), w)) * [1.0, 10.0, 0.1, 1.0]
    blocks = np.array([each[of == i].T @ each[of == i] for i in range(n)])
    left, unit = _of_others(blocks, (X.T @ Z).reshape(n, 3, w), Z.T @ Z, Q.T @ np.concatenate([X, Z], axis=1))
    both = np.concatenate([Q, X], axis=1)
    rest = Z - both @ np.linalg.lstsq(both, Z, rcond=None)[0]
    assert left == pytest.approx(rest.T @ rest, rel=1e-8)
    assert unit == pytest.approx(np.linalg.norm(Z - Q @ (Q.T @ Z), axis=0))
