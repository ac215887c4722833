"""Which target is which: from picks, from the lattice that dots form, or from the image alone.

picks.py      the operator's picks, checked and moved onto their dots
blobs.py      everything in the image that could be a dot
view.py       the approximate view of the board: pose and one radial parameter
identify.py   from the picks to a lattice that all picks agree on
grow.py       the lattice grows outwards, one confirmed target after the other
foretold.py   where targets should be by those around them, and which spots are there
single.py     what an operator sees while picking: the dot at hand, the predicted grid
propose.py    a guess of the picks: the dots in order, laid onto the testfield
places.py     what an image shows where dots could be: faint ones, bare ground
recognise.py  an image that nobody picked
turns.py      which way round the board was held, told for all images together
"""
