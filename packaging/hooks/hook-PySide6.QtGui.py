"""Qt's plugins without those this program has no use for: they would bring GTK and other large libraries along."""

from pathlib import Path

from PyInstaller.utils.hooks.qt import add_qt6_dependencies

KINDS = ("iconengines", "platforminputcontexts", "xcbglintegrations")  # beside all that has to do with Wayland
PLUGINS = ("offscreen", "xcb", "wayland", "xdgdesktopportal", "svg", "jpeg")  # of the other kinds


def wanted(plugin: Path) -> bool:
    """Whether a library is no plugin, or one that the window uses."""
    if "plugins" not in plugin.parts:
        return True
    kind = plugin.parent.name
    return kind.startswith("wayland") or kind in KINDS or plugin.stem.removeprefix("libq") in PLUGINS


hiddenimports, binaries, datas = add_qt6_dependencies(__file__)
binaries = [entry for entry in binaries if wanted(Path(entry[0]))]
