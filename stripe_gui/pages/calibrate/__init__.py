"""Calibrating: choose, run, look at what came out, exclude, run again, compare.

page.py       the page and its parts
captures.py   which captures take part
run.py        the run with its convergence
runs.py       kept runs side by side
"""
