#!/bin/sh
# Gather the window's texts into stripe_de.ts (edit it with pyside6-linguist) and compile it to stripe_de.qm.
set -e
cd "$(dirname "$0")/../.."
bin=${VENV:-.venv}/bin
"$bin/pyside6-lupdate" $(find stripe_gui -name '*.py') -no-obsolete -locations none -ts resources/translations/stripe_de.ts
"$bin/pyside6-lrelease" resources/translations/stripe_de.ts -qm resources/translations/stripe_de.qm
