#!/usr/bin/env bash
# Runs the benchmark drivers and keeps their raw JSON in results/raw/<machine>/, with the tables
# made from it in results/tables/ and the figures in results/figures/. Takes some minutes; close everything else first.
#
#   bash ci/bench.sh [NAME ...]     e.g. partition step render; default: all
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

bash "$root/ci/build.sh" release
cd "$root"
names=("$@")
[ ${#names[@]} -gt 0 ] || names=(partition step render global extremes)
machine=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1 | tr -cs 'A-Za-z0-9' '-' | sed 's/-*$//')-$(nproc)cores
mkdir -p "results/raw/$machine" results/tables results/figures

# tables NAME RAW: what is made from a driver's raw JSON; bench_global has tables of its own.
tables() {
  if [ "$1" = global ]; then
    "$root/ci/global_tables" "$2" --out results/tables --figures results/figures
  else
    "$root/ci/bench_table" "$2" >"results/tables/$1.md"
  fi
}

invalid_results=5  # kCheckFailed in benchmarks/bench_main.cpp
exit_code=0
for name in "${names[@]}"; do
  raw="results/raw/$machine/$name.json"
  say "bench_$name -> $raw"
  status=0
  "build/release/bin/bench_$name" --benchmark_out="$raw.new" --benchmark_out_format=json \
    --benchmark_format=console || status=$?
  if [ "$status" != 0 ]; then
    # The tables of `global` say which rows are invalid; the others' have no place for that.
    [ "$name $status" = "global $invalid_results" ] || exit "$status"
    exit_code=$status
  fi
  mv "$raw.new" "$raw"
  tables "$name" "$raw"
done
exit "$exit_code"
