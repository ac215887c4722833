"""The commands, a file for each group; every file has `add`, which declares what it holds."""
