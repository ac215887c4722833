"""What of a project is current: every result carries the record of what it was made from, set beside what is there now.

inputs.py    what every stage reads, by content: the record that its result carries
holdings.py  what a project holds: its captures, and the records of its results, each read once
graph.py     the state of everything, and why; nothing else decides it
states.py    the words for it, and how the states of captures are put together
failures.py  what a stage failed with, until it succeeds or what it reads has changed
"""
