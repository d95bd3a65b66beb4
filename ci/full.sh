#!/usr/bin/env bash
# Everything in ci/test.sh, then clang-tidy, the unit tests under TSan, the dearer scenes, and the benchmarks
# in their quick form (they check what they compute; the times of a quick run mean nothing).
#
#   bash ci/full.sh [--no-install] [--changed-since REF]   REF limits clang-tidy to changed files
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
source "$root/ci/suites.sh"

install=yes
tidy=()
while [ $# -gt 0 ]; do
  case $1 in
    --no-install) install=no ;;
    --changed-since)
      [ $# -ge 2 ] || die "--changed-since needs a revision"
      tidy=(--changed-since "$2")
      shift
      ;;
    *) die "unknown option '$1'; there are: --no-install, --changed-since REF" ;;
  esac
  shift
done

benchmarks_quick() {
  local program name
  mkdir -p out/benchmarks-quick
  for program in build/release/bin/bench_*; do
    name=$(basename "$program")
    with_progress "out/benchmarks-quick/$name.log" "$program" --quick \
      --benchmark_out="out/benchmarks-quick/$name.json" ||
      { tail -n 15 "out/benchmarks-quick/$name.log" >&2; die "$name failed"; }
    say "  $name"
  done
}

# Scenes that take too long for ci/test.sh: they keep their expectations, and nothing interpenetrates.
scenes_in_full() {
  local name
  for name in folding funnel knot pot_drape stack_of_20; do
    with_progress "out/scenes/$name.log" build/release/bin/piecework run "$name" --no-images \
      --no-state --expect --strict --overwrite -o "out/scenes/$name" ||
      { tail -n 15 "out/scenes/$name.log" >&2; die "scene $name failed"; }
    say "  $name"
  done
}

ensure_packages "$install" build check full
cd "$root"
gate_suites
run_suite tidy "$root/ci/tidy.sh" "${tidy[@]}"
run_suite tsan tests_of tsan tsan.xml unit
run_suite scenes scenes_in_full
run_suite benchmarks benchmarks_quick
close_suites
