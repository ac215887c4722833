"""The plane-table: choose planes and calibrations, judge them; maps, profiles, histograms, Table 3.

page.py    the page
parts.py   the bodies of its parts
"""
