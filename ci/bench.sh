#!/usr/bin/env bash
# Runs the benchmark drivers and keeps their raw JSON in results/raw/<machine>/, with the tables
# made from it in results/tables/. Takes some minutes; close everything else first.
#
#   bash ci/bench.sh [NAME ...]     e.g. partition step render; default: all
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

bash "$root/ci/build.sh" release
cd "$root"
names=("$@")
[ ${#names[@]} -gt 0 ] || names=(partition step render)
machine=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1 | tr -cs 'A-Za-z0-9' '-' | sed 's/-*$//')-$(nproc)cores
mkdir -p "results/raw/$machine" results/tables
for name in "${names[@]}"; do
  raw="results/raw/$machine/$name.json"
  say "bench_$name -> $raw"
  "build/release/bin/bench_$name" --benchmark_out="$raw.new" --benchmark_out_format=json \
    --benchmark_format=console
  mv "$raw.new" "$raw"
  "$root/ci/bench_table" "$raw" >"results/tables/$name.md"
done
