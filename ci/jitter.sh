#!/usr/bin/env bash
# Does anything pass through anything? Runs every shipped scene with contact ten times, each time a
# little different (see jitter.py), and writes results/tables/jitter.md. Takes an hour or two; with
# --coarse, on meshes of half the resolution, a quarter of one. Exit code 1: something did.
#
#   bash ci/jitter.sh [--coarse] [--runs N] [--threads N] [SCENE ...]
#
# A scene that needs files is left out unless they are given, e.g.
#   --set garment_on_avatar:cloths.0.mesh.file=skirt.obj
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

bash "$root/ci/build.sh" release --target piecework
cd "$root"
exec python3 "$root/ci/jitter.py" --program build/release/bin/piecework "$@"
