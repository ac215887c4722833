"""Words that only a look-up tells apart.

coded.py       lists that are the bits of a code, which decode as that
likelihood.py  coordinates by the likelihood of all frames
shown.py       how words are shown: blur, noise, flicker and whatever bends their light
book.py        the words of an axis under every blur, and the kernels that find a pixel among them
"""
