"""The least-squares solution of a network, and all that is known of it.

problem.py      the network as index arrays and unknowns, in the order the kernels want them
state.py        the unknowns: where they stand, and moved by a step
equations.py    the observation equations with their derivatives
normals.py      the normal equations by blocks
elimination.py  ... solved without the poses or, where there are very many points, without these
datum.py        inner constraints on the points
iterate.py      the way to the solution; robust.py where observations far off shall rule nothing
covariance.py   redundancy numbers and covariances
shared.py       ... with what the targets of an image have in common
solve.py        all of it, with variance components
"""
