"""The depth calibration: every pixel's own curve from a plate moved through known positions.

calibration.py  the order of it
camera.py       the camera's orientation from the targets of the plate itself
smooth.py       low-pass of the projector coordinates on a flat plate
curves.py       every pixel's curve z(u): polynomials by least squares, or the table
"""
