"""Where exactly targets are in the camera's image, how surely, and which must not be measured.

estimators.py  how a dot's centre follows from its pixels, by name
rays.py        rays from the dots' centres, along which the image is sampled
profile.py     contour, blur, background and plateau of every dot
centroid.py    weighted centroid, its covariance, the image's noise
ellipse.py     centres by the fit of a blurred ellipse
steps.py       the light of a curved, blurred edge in square pixels, and how surely it is placed
corners.py     corners where straight edges cross or end; crossings.py finds those of a chessboard
course.py      how a projector's coordinate runs over the image of a board, by all its targets
light.py       where the projector's light ends, in the camera's image
lighting.py    how much the light changes across dots
plateau.py     how much of it the middles of blurred dots still show
overlap.py     dots so blurred that their light reaches their neighbours
faults.py      dots that must not be measured, and why
grain.py       raw images of colour cameras; noise that neighbours share
defocus.py     blur that changes across a dot, and what it draws
circles.py     the middle of an ellipse is not the image of the circle's centre
kernels.py     the loops over pixels
"""
