"""The parts that pages and wizards are made of.

layout.py           cards, headings, buttons: the same spacing everywhere
notice.py           what happened, what to do, the details folded away
stage_strip.py      the seven stages and their states
job_bar.py          progress of the running job, time left, cancel
help_panel.py       help beside the work
command_palette.py  every action, searchable
image_view.py       an image or a map with fixed levels, kept zoom and a read-out
colour_bar.py       its colours (colours.py) and what they mean
residual_view.py    residual vectors of all devices by capture, and what to do about one
correlation_view.py correlations as a matrix, and the strongest pairs
point_map.py        sigmas of the object points over the testfield
calibrate_form.py   what can be chosen about a calibration
calibration_results.py  everything a calibration found, and where in the images there are points
studies.py          captures left out in turn, and the next pose: asked by a button
plot.py             curves over two axes, and histograms of deviations
deviation_maps.py   maps of planes on one scale, with a cursor in all of them
volume_maps.py      a calibration over its working volume, a map for each depth
space_view.py       points and lines in space
result_table.py     a table of results, sortable and copyable
field_map.py        the testfield in small, to choose a target
loupe.py            a part of an image, eight times as large
capture_list.py     the project's captures
health_strip.py     whether the rig still stands as it was calibrated
verdict.py          what is to be thought of a result; finding_list.py what checks found
sequence_form.py    the choice of a sequence; pattern_strip.py its patterns
sign_off.py         who signs, against which tolerance
"""
