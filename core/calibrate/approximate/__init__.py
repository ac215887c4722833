"""Approximate values of the unknowns, from nominal focal lengths and approximate points.

initial.py      the order of it
resection.py    where a device stood, from points it saw
stations.py     every station by itself: all solutions that a flat field allows, improved with its device
refinement.py   poses improved one by one with all else held, wrong points softened
columns.py      devices of which one image coordinate was never observed
from_images.py  points from the images alone, where the approximate ones explain no image
"""
