"""The folder on disk: what the interchange format prescribes, read with every check, written whole or not at all.

images.py    frames: single-channel PNG and TIFF of 8 or 16 bit; a truncated file is refused
captures.py  project.json, testfield.csv, capture.json and picks.json, read and written
boards.py    regular testfields, and a new project without captures; typed.py the same from what is typed in a line
rigs.py      the rig in project.json
unfinished.py a capture that was interrupted
networks.py  a network folder, read and written; schema.py the published schema of all these
archive.py   the program's own results (targets, calibrations, evaluations), one file each; shapes.py their checks
contents.py  hashes of files, remembered; lock.py one writer at a time; made.py what may be replaced
"""

from core.atomic import atomic_write, write_json
from core.project.archive import load_archive, save_archive
from core.project.boards import create_project, nominal_testfield, refuse_used_folder
from core.project.captures import (
    ENOUGH,
    add_capture,
    choose_sequence,
    find_project,
    keep_picks,
    kept_picks,
    read_capture,
    read_picks,
    read_project,
    read_testfield,
    write_picks,
    write_project,
    write_testfield,
)
from core.project.images import iterate_images, read_image, write_image
from core.project.networks import read_network, write_network

__all__ = [
    "ENOUGH", "add_capture", "atomic_write", "choose_sequence", "create_project", "find_project", "iterate_images",
    "keep_picks", "kept_picks", "load_archive", "nominal_testfield", "read_capture", "read_image",
    "read_network", "read_picks", "read_project", "read_testfield", "refuse_used_folder", "save_archive",
    "write_image", "write_json", "write_network", "write_picks", "write_project", "write_testfield",
]  # fmt: skip
