"""What is wrong with a network, what it does not determine, and what more captures would bring.

snooping.py   gross errors, by the residuals they leave
groups.py     whole images and captures that do not fit the others
parted.py     captures that fit each other up to one of them, and again from there on
held.py       parameters that are held and should not be
rigid.py      whether the rig was rigid
weakness.py   what the network does not determine, in words
left_out.py   what the other captures foresee of one
next_pose.py  what one more capture would bring
"""
