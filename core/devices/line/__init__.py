"""Projectors that are spoken to on a line, by a command profile.

profile.py   how a projector is spoken to
profiles.py  ... read from a data file, one of resources/profiles or one's own
entries.py   ... whose tables know the lines of their keys
wrapping.py  ... and how it wraps what is sent and what comes back
template.py  commands and answers, filled in and recognised
packing.py   the light of lines in them
framing.py   lines of text and binary frames, and their check values
link.py      a serial line or HID reports that always come back in time; which ports there are
dialogue.py  questions and answers on that line
rs232.py     a projector on that line
emulator.py  the other end of the line: a projector made of bytes
server.py    ... on a pseudo-terminal or a socket
"""
