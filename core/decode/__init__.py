"""Decode: from the frames of a capture to projector coordinates with sigma and validity.

absolute.py   `decode`: the order of things
known.py      what the patterns and a sample of the pixels tell before
options.py    thresholds, and the flags that say why a pixel is invalid
exposures.py  several exposures of a pattern made one image
frames.py     checks and sorts the frames by what they tell
plan.py       how the absolute coordinate of an axis follows from its frames, or why it does not
tables.py     the least-squares and other linear combinations of frames, as tables
kernels       the one compiled pass over the pixels
waves         how projector and camera bend phases, and the way back
surface       coordinates judged by those around them
words         words that only a look-up tells apart
sections.py   light sections: the centroid over a sweep of lines
edges.py      how surely the edges of a Gray code alone tell the place
notes.py      what is wrong with a capture that decodes less than its light promises

What frames are like:

chosen.py     pixels that stand for all: spread over the image, of every kind
pairs.py      ... in pairs, whose common part is no noise
sample.py     noise, full scale and contrast of the bits, from a sample of the pixels
noise.py      the noise of the grey values, from combinations of frames that show nothing else
balance.py    the thresholds of bits that lie off the middle between white and black
overexposed.py  the evenly lit image where frames are at full scale
flicker.py    frames lit by more or less light than the others
late.py       frames that show the pattern before, in some rows or in all
compressed.py frames compressed with losses, and what that does to phases
filtered.py   frames that were smoothed or sharpened, told by how noise differs between neighbours

On demand:

estimate.py   every pixel adjusted to all its frames, the blur found tile by tile (refined.py: its kernels)
codes.py      places within the cells of codes that have no phases
"""

from core.decode.absolute import decode, refuse_patterns
from core.decode.options import DecodeOptions, Flag

__all__ = ["DecodeOptions", "Flag", "decode", "refuse_patterns"]
