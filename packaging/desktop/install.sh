#!/bin/sh
# Install this bundle: ./install.sh [--remove] [PREFIX]
# PREFIX is ~/.local if unsaid (for this user alone); as root, /usr/local serves all. --remove takes everything away again.
set -eu
id=org.stripe_workbench.StripeWorkbench
remove=
[ "${1-}" = --remove ] && remove=yes && shift
prefix=${1:-$HOME/.local}
case "$prefix" in /*) ;; *) prefix=$PWD/$prefix ;; esac
here=$(cd "$(dirname "$0")" && pwd)
bundle=$prefix/lib/stripe-workbench
programs="stripe-gui stripe-core"
icons="share/icons/hicolor"
data="share/applications/$id.desktop share/metainfo/$id.metainfo.xml $icons/scalable/apps/$id.svg
    $icons/48x48/apps/$id.png $icons/128x128/apps/$id.png $icons/256x256/apps/$id.png"

refresh() { # desktops notice by themselves, some of them only later
    update-desktop-database -q "$prefix/share/applications" 2>/dev/null || true
    gtk-update-icon-cache -q -f -t "$prefix/$icons" 2>/dev/null || true
}

if [ -n "$remove" ]; then
    for program in $programs; do rm -f "$prefix/bin/$program"; done
    for file in $data; do rm -f "$prefix/$file"; done
    rm -rf "$bundle"
    refresh
    echo "removed from $prefix; projects, settings and the compiled kernels in ~/.cache/stripe-workbench stay"
    exit 0
fi
if [ "$here" = "$bundle" ]; then
    echo "install.sh: this bundle is installed already; call the script of the one that is new" >&2
    exit 2
fi

mkdir -p "$prefix/bin" "$prefix/lib"
rm -rf "$bundle.new"
cp -R --preserve=mode,timestamps,links "$here" "$bundle.new"
rm -rf "$bundle"
mv "$bundle.new" "$bundle"
for program in $programs; do ln -sf "$bundle/$program" "$prefix/bin/$program"; done
for file in $data; do
    mkdir -p "$prefix/$(dirname "$file")"
    cp "$here/$file" "$prefix/$file"
done
# a desktop does not always look in PREFIX/bin
sed "s|^Exec=stripe-gui|Exec=\"$bundle/stripe-gui\"|" "$here/share/applications/$id.desktop" \
    >"$prefix/share/applications/$id.desktop"
refresh
echo "installed in $bundle; start stripe-gui from the menu, or $prefix/bin/stripe-core in a terminal"
case ":$PATH:" in *":$prefix/bin:"*) ;; *) echo "to call them by name, put $prefix/bin into PATH" ;; esac
