#!/usr/bin/env bash
# Runs the benchmark drivers and keeps their raw JSON in results/raw/<machine>/, with the tables
# made from it in results/tables/ and the figures in results/figures/. Takes some minutes, and
# `convergence` an hour; close everything else first.
#
#   bash ci/bench.sh [NAME ...]     e.g. partition step render convergence; default: all
#
# `front` is no driver but the sweeps of scenes/plans/front_*.json.
#
# FILTER: a regular expression of rows, e.g. FILTER='/n:(2500|19881)/'; default: all rows.
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

bash "$root/ci/build.sh" release
cd "$root"
names=("$@")
[ ${#names[@]} -gt 0 ] || names=(partition local step render global ccd broad_phase contact contact_steps
  extremes iterations convergence front)
machine=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1 | tr -cs 'A-Za-z0-9' '-' | sed 's/-*$//')-$(nproc)cores
mkdir -p "results/raw/$machine" results/tables results/figures

# tables NAME RAW: what is made from a driver's raw JSON; some drivers have tables of their own.
tables() {
  case "$1" in
    global) "$root/ci/global_tables" "$2" --out results/tables --figures results/figures ;;
    contact | contact_steps | convergence)
      local traces="${2%.json}_traces.json" options=()
      [ ! -f "$traces" ] || options=(--traces "$traces")
      "$root/ci/$1_tables" "$2" --out results/tables --figures results/figures \
        "${options[@]}"
      ;;
    iterations)
      "$root/ci/iterations_tables" "$2" --out results/tables --figures results/figures \
        --traces "${2%.json}_traces.json"
      ;;
    *) "$root/ci/bench_table" "$2" >"results/tables/$1.md" ;;
  esac
}

# Time against accumulated error, from whole runs; begun sweeps are continued in out/front/.
front() {
  local sweeps=() cloth
  for cloth in soft cotton cotton_fine stiff; do
    build/release/bin/piecework sweep "scenes/plans/front_$cloth.json" -o "out/front/$cloth"
    cp "out/front/$cloth/sweep.json" "results/raw/$machine/front_$cloth.json"
    sweeps+=("results/raw/$machine/front_$cloth.json")
  done
  "$root/ci/front_tables" "${sweeps[@]}" --out results/tables --figures results/figures
}

invalid_results=5  # kCheckFailed in benchmarks/bench_main.cpp
exit_code=0
for name in "${names[@]}"; do
  if [ "$name" = front ]; then
    front
    continue
  fi
  raw="results/raw/$machine/$name.json"
  say "bench_$name -> $raw"
  status=0
  options=(--benchmark_out="$raw.new" --benchmark_out_format=json --benchmark_format=console)
  [ -z "${FILTER:-}" ] || options+=(--benchmark_filter="$FILTER")
  traces="${raw%.json}_traces.json"
  rm -f "$traces.new"
  [[ ! "$name" =~ ^(contact|contact_steps|convergence|iterations)$ ]] || options+=(--traces="$traces.new")
  [ "$name" != iterations ] || options+=(--maps=results/figures/fig7.png)
  "build/release/bin/bench_$name" "${options[@]}" || status=$?
  if [ "$status" != 0 ]; then
    # The tables of these say which rows are invalid; the others' have no place for that.
    [[ "$name $status" =~ ^(global|contact|contact_steps|iterations|convergence)\ $invalid_results$ ]] || exit "$status"
    exit_code=$status
  fi
  mv "$raw.new" "$raw"
  rm -f "$traces" # older than the rows
  [ ! -f "$traces.new" ] || mv "$traces.new" "$traces"
  tables "$name" "$raw"
done
exit "$exit_code"
