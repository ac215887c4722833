"""Do frames show the patterns that they claim? Told from grey values alone, as frames arrive or of those stored.

identity.py  which pattern a frame shows, told from the images of its capture
quality.py   saturation, modulation, movement, the lamp

stored.py    a capture that was recorded before, by whatever program, judged as a whole
pixels.py    ... how its frames were stored: bytes, compression, mosaics, size
unchanging.py     ... pixels that no frame changes: dead lines, text drawn into frames
contradictions.py ... the share of pixels that no projector line explains
mistakes.py       ... and how people describe patterns wrongly, which may explain them
steps.py          ... phase steps that stand for others: exchanged, twice the same, of another moment
bits.py           ... bits of a code that are inverted, or of another image, by the edges of the others
exchanged.py      ... frames that were exchanged, by the coordinates decoded of them
surface.py        ... whether these are of a surface, and of the right hand
between.py        ... what changed between the frames of columns and of rows: the light, the place
overlapping.py    ... frames that hold light of the pattern after, or before
misfit.py         ... and what else one step of a period shows that its wave does not
beside.py         ... phases that stand beside the code or run away from it, or from each other, by a little
edges.py          ... and edges of the code, which tell that
turns.py          ... the period that phases have from edge to edge
lookup.py    what patterns look like on every projector line, and which line fits what a pixel saw

recognise.py which frame shows which pattern, whatever their order
proof.py     whether that order is the only one
"""
