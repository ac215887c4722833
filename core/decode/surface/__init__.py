"""Coordinates judged by those around them: what no pixel can tell of itself.

footprint.py   coordinates that edges have drawn to the brighter side, and light from beside
mixed.py       pixels that see two surfaces at once, or the rim of the projected field
islands.py     coordinates that nothing around vouches for
neighbours.py  orders of fringes that a pixel leaves open and its neighbours tell
agreement.py   how far several periods contradict each other, and what that adds to sigma
beats.py       light by a second way, where neighbouring periods hardly contradict each other
detours.py     ... where a code tells it: from a facing wall, or mirrored
moved.py       ... from near: edges of a code beside the phases' place of them
repeated.py    outermost rows and columns that repeat those beside them
"""
