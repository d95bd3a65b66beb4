#!/usr/bin/env bash
# Builds `piecework` and simulates the hanging tablecloth: pictures, timings and a report in
# out/demo/. Installs missing Debian packages first; with --no-install it lists them and exits 2.
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

out=out/demo
case ${1:-} in
  '' | --no-install) ;;
  *) die "unknown option '$1'; the only one is --no-install" ;;
esac

bash "$root/ci/build.sh" release --target piecework "$@"
cd "$root"
say "Simulating hanging_tablecloth, 60 frames"
build/release/bin/piecework run hanging_tablecloth -o "$out" --frames 60 --overwrite

for file in frame_0000.png contact_sheet.png run.json timings.csv summary.md; do
  [ -s "$out/$file" ] || die "$out/$file is missing: the run ended without writing it"
done
cat "$out/summary.md"
printf '\nFrames          %s\n' "$root/$out/frame_0000.png ... ($(find "$out" -name 'frame_*.png' | wc -l) pictures)"
printf '%-15s %s\n' 'Contact sheet' "$root/$out/contact_sheet.png" \
  'Per-phase times' "$root/$out/timings.csv" 'Report' "$root/$out/summary.md" 'Raw record' "$root/$out/run.json"
