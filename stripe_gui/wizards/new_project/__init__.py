"""Beginning a project and printing its testfield.

wizard.py    the steps in their order; the last writes the project
steps.py     name and rig
boards.py    testfield, depth plate as they will be printed, scale, summary
"""
