"""What the program brings along: help, fonts, templates, reference values, command profiles, icons, translations."""
