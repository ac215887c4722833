"""The sigmas told against the errors made, over 200 networks with noise of known size."""

import numpy as np
import pytest

from core.calibrate import adjust
from core.geometry import rotation_vector_from_matrix

SETUPS = (
    {},
    {"rigid": False},
    {"scale": False},
    {"use": ("camera",), "scale": False},
)
NETWORKS_EACH = 50


def similarity(source, target, with_scale):
    """Truth laid onto the approximate points: the datum in which the free network is expressed."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    U, S, Vt = np.linalg.svd(b.T @ a)
    signs = np.array([1, 1, np.sign(np.linalg.det(U @ Vt))])
    scale = (S * signs).sum() / (a * a).sum() if with_scale else 1.0
    return scale * a @ ((U * signs) @ Vt).T + target.mean(axis=0), scale


def normalised_errors(simulated, adjustment):
    network = adjustment.network
    kept = [simulated.network.point_names.index(name) for name in network.point_names]
    truth, scale = similarity(simulated.points_mm[kept], network.point_xyz_mm, network.scale is None)
    sigma = np.sqrt(np.diagonal(adjustment.point_cov_mm2, axis1=1, axis2=2))
    points = (adjustment.points_mm - truth) / sigma
    errors = [d.interior.vector - simulated.interior[name].vector for name, d in adjustment.devices.items()]
    if "projector" in adjustment.relative:
        found, true = adjustment.relative["projector"], simulated.projector_from_camera
        errors.append(rotation_vector_from_matrix(found.rotation @ true.rotation.T))
        errors.append(found.translation_mm - scale * true.translation_mm)
    parameters = np.concatenate(errors) / np.sqrt(np.diagonal(adjustment.parameter_cov))
    return points.ravel(), parameters


@pytest.fixture(scope="module")
def errors(simulate):
    points, parameters, sigma0 = [], [], []
    for k in range(NETWORKS_EACH):
        for setup in SETUPS:
            simulated = simulate(seed=1000 + k, poses=7, rows=5, cols=6, extent_mm=190.0, **setup)
            adjustment = adjust(simulated.network)
            p, q = normalised_errors(simulated, adjustment)
            points.append(p)
            parameters.append(q)
            sigma0.append(adjustment.sigma0)
    return np.concatenate(points), np.concatenate(parameters), np.array(sigma0)


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def test_errors_of_parameters_agree_with_their_sigmas(errors):
    # some 4000 values in 200 independent networks: the r.m.s. itself is good to 2 %
    assert 0.95 < rms(errors[1]) < 1.05


def test_errors_of_points_agree_with_their_sigmas(errors):
    assert 0.95 < rms(errors[0]) < 1.05


def test_sigma0_is_one_where_the_weights_are_true(errors):
    # each has a redundancy above 250 and so a standard deviation below 0.045; the mean of 200 is good to 0.003
    assert errors[2].mean() == pytest.approx(1.0, abs=0.01)
