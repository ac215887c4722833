"""The GUI-free core of the stripe workbench."""
