"""Recording a capture, step by step: devices, what is to be recorded, a look, checks of the rig, the sequence.

wizard.py    the steps in their order, and what they hand on
devices.py   projector and camera, and whether they answer
subject.py   role, name, and what belongs to them
picture.py   the live picture, over-exposed pixels marked
checks.py    the checks before the first calibration
taking.py    the sequence run: progress, cancel, findings, one frame again
"""
