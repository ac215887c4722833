"""How projector and camera bend the waves of phase steps, and the way back.

curves.py     response curves, and what they make of sine fringes
response.py   a projector's response; sine fringes made straight
fitting.py    the search for it in the frames of a capture
camera.py     the camera's own curve, found beside it; grey values made even steps of the light
crowding.py   how evenly the phases lie over their period, which tells a bent one
harmonics.py  how harmonics bend the phase, and the way back; those of square waves, from the blur
evenness.py   the even image without what a response leaves of fringes in the mean of few steps
ripple.py     whole lines' ripple on sine fringes
folded.py     what phases err alike in every period, seen on smooth surfaces
mosaic.py     what they err otherwise in every kind of pixel of a colour camera
"""
