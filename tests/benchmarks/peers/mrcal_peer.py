"""mrcal: its optimisation with LENSMODEL_OPENCV4, then the covariances of interiors and points from its factorisation.

The first station stands at the reference; the scale is left to its solver, as in any reconstruction from images.
"""

from __future__ import annotations

import mrcal
import numpy as np
from serving import Arrays, serve


def prepare(data: Arrays):
    """Give the work: adjust from starting values, solve for the covariances."""
    return lambda: adjusted(data)


def adjusted(data: Arrays) -> Arrays:
    """Adjust once, from the starting values."""
    reference = mrcal.invert_Rt(np.vstack([data["rotation"][0], data["shift"][0]]))
    poses = np.array(
        [
            mrcal.rt_from_Rt(mrcal.compose_Rt(np.vstack([R, t]), reference))
            for R, t in zip(data["rotation"][1:], data["shift"][1:], strict=True)
        ]
    )
    station = data["station"]
    indices = np.column_stack([data["point"], data["device"][station], station - 1]).astype(np.int32)
    problem = {
        "lensmodel": "LENSMODEL_OPENCV4",
        "intrinsics": data["interior"].copy(),
        "rt_cam_ref": poses,
        "rt_ref_frame": np.zeros((0, 6)),
        "points": mrcal.transform_point_Rt(mrcal.invert_Rt(reference), data["points"]),
        "observations_board": None,
        "indices_frame_camintrinsics_camextrinsics": None,
        "observations_point": np.column_stack([data["uv"], np.ones(len(station))]),
        "indices_point_camintrinsics_camextrinsics": indices,
        "imagersizes": data["sizes"].astype(np.int32),
        "point_min_range": 1.0,
        "point_max_range": 1e5,
        "do_apply_outlier_rejection": False,
        "do_apply_regularization": False,
        "do_optimize_intrinsics_core": True,
        "do_optimize_intrinsics_distortions": True,
        "do_optimize_extrinsics": True,
        "do_optimize_frames": True,
    }
    mrcal.optimize(**problem)
    factors = mrcal.optimizer_callback(**problem)[3]
    if factors is None:
        raise RuntimeError("mrcal could not factorise the normal equations")
    states = mrcal.num_states(**problem)
    wanted = np.r_[0 : data["interior"].size, states - 3 * len(data["points"]) : states]  # the points are last
    unit = np.zeros((wanted.size, states))
    unit[np.arange(wanted.size), wanted] = 1.0
    covariance = factors.solve_xt_JtJ_bt(unit)[:, wanted]
    return {"points": problem["points"], "interior": problem["intrinsics"], "cofactors": covariance}


if __name__ == "__main__":
    serve(prepare, lambda result: result)
