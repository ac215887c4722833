"""The targets of boards, image by image: picked, measured, missing and why; measuring goes on behind the picking.

page.py        the page: what keys and clicks do
model.py       what was picked and excluded, undo and redo, all saved at once; without Qt
view.py        what the page shows of an image, and what Enter does next; without widgets
image.py       the image with its marks, cross hairs and keys
side.py        the map of the field, the loupe, the lists
background.py  measuring what was accepted, making the next images ready
"""
