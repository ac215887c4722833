"""The one compiled pass over the pixels.

kernel.py    the order of its steps, tile by tile
fringes.py   phases of every period, and the way to the finest
joint.py     all periods of an axis together, where waves are bent
words.py     the bits of a code, and the place they tell together with a phase
doubt.py     pixels whose bits and phase do not fit at once
compiled.py  the bricks: grey values by address, sums over frames, the angle
"""
