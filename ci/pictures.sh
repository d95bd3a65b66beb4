#!/usr/bin/env bash
# Makes the pictures of README.md anew from the demo: run it when scenes, solver or renderer change
# what they show, and commit docs/images/.
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

bash "$root/ci/demo.sh" "$@"
mkdir -p "$root/docs/images"
cp "$root/out/demo/frame_0042.png" "$root/docs/images/hanging_tablecloth.png"
cp "$root/out/demo/contact_sheet.png" "$root/docs/images/contact_sheet.png"
say "docs/images/ is up to date"
