"""Decode: from the frames of a capture to projector coordinates with sigma and validity.

absolute.py   `decode`: the order of things
known.py      what the patterns and a sample of the pixels tell before
options.py    thresholds, and the flags that say why a pixel is invalid
exposures.py  several exposures of a pattern made one image
frames.py     checks and sorts the frames by what they tell
plan.py       how the absolute coordinate of an axis follows from its frames, or why it does not
tables.py     the least-squares and other linear combinations of frames, as tables
noise.py      the noise of the grey values, from combinations of frames that show nothing else
curves.py     response curves, and what they make of sine fringes
response.py   the projector's response, found in the frames (fitting.py); sine fringes made straight
camera.py     the camera's own curve, found beside it; grey values made even steps of the light
crowding.py   how evenly the phases lie over their period, which tells a bent one
flicker.py    frames lit by more or less light than the others
late.py       frames that show the pattern before, in some rows or in all
harmonics.py  how harmonics bend the phase, and the way back; those of square waves, from the blur
notes.py      what is wrong with a capture that decodes less than its light promises
chosen.py     pixels that stand for all: spread over the image, of every kind
sample.py     noise, full scale and contrast of the bits, from a sample of the pixels
balance.py    the thresholds of bits that lie off the middle between white and black
overexposed.py  the evenly lit image where frames are at full scale
kernel.py     the one compiled pass over the pixels; its steps:
  fringes.py    phases of every period, and the way to the finest
  joint.py      all periods of an axis together, where waves are bent
  words.py      the bits of a code, and the place they tell together with a phase
  doubt.py      pixels whose bits and phase do not fit at once
  compiled.py   the bricks: grey values by address, sums over frames, the angle
estimate.py   on demand: every pixel adjusted to all its frames, the blur found tile by tile
  refined.py    its kernels
codes.py      on demand: places within the cells of codes that have no phases
compressed.py frames compressed with losses, and what that does to phases
filtered.py   frames that were smoothed or sharpened, told by how noise differs between neighbours
evenness.py   the even image without what a response leaves of fringes in the mean of few steps
footprint.py  coordinates that edges have drawn to the brighter side, and light from beside
islands.py    coordinates that nothing around vouches for
neighbours.py orders of fringes that a pixel leaves open and its neighbours tell
repeated.py   outermost rows and columns that repeat those beside them
mixed.py      pixels that see two surfaces at once, or the rim of the projected field
detours.py    light that reaches a surface by a second way
moved.py      edges of a code beside the phases' place of them, by light from near
agreement.py  how far several periods contradict each other, and what that adds to sigma
beats.py      light by a second way, where neighbouring periods hardly contradict each other
pairs.py      pixels in pairs, whose common part is no noise
sections.py   light sections: the centroid over a sweep of lines
likelihood.py words that only a look-up tells apart, by the likelihood of all frames
shown.py      how words are shown: blur, noise, flicker and whatever bends their light
book.py       the words of an axis under every blur, and the kernels that find a pixel among them
edges.py      how surely the edges of a Gray code alone tell the place
ripple.py     whole lines' ripple on sine fringes
folded.py     what phases err alike in every period, seen on smooth surfaces
mosaic.py     what they err otherwise in every kind of pixel of a colour camera
"""

from core.decode.absolute import decode
from core.decode.options import DecodeOptions, Flag

__all__ = ["DecodeOptions", "Flag", "decode"]
