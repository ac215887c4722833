"""What the pages show, computed from the project folder each time; no widgets, no state of their own.

folder.py     the project on disk: captures and results, read once per version of their files
status.py     the seven stages: done, out of date, to do, failed with the reason
failures.py   what a stage failed with, kept in the project until it succeeds
work.py       what the stages' buttons run: pipeline functions that take a project and a progress
contributions.py   what every capture adds to a calibration
stages.py     names and states of the stages, without the core
runs.py       kept runs in tables, two side by side
studies.py    what captures say of each other and one more would bring, in tables
volumes.py    calibrations over the working volume, in maps and by depth
maps.py       levels, round numbers, and light on a surface
told.py       what the core says, in the operator's language
rig_view.py   how camera and projector stand and what they cover; rig_space.py in space, space.py what is drawn of it
drift.py      the control chart of the rig, and whether it still stands, by one capture
sequences.py  presets with their options, and what a sequence is to a projector
capturing.py, importing.py, looking.py, new_project.py   what the wizards know
start.py, capture.py, decode.py, calibrate.py, reconstruct.py, evaluate.py, report.py   one per page
"""
