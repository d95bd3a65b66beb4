#!/usr/bin/env bash
# Uses the solver as a program outside of this tree does: builds the library alone, installs it,
# builds and runs examples/solve against the installed package, then with the sources as part of its
# own build. Works in build/consumer-*, which are made anew.
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

work="$root/build/consumer" # and a suffix: as deep as build/release, so that ccache finds its objects
prefix="$work-prefix"

# Packages that the library must not look for: a required one that is disabled is an error.
others=()
for package in CHOLMOD assimp nlohmann_json CLI11 ZLIB stb hwloc GTest benchmark; do
  others+=("-DCMAKE_DISABLE_FIND_PACKAGE_$package=ON")
done

# quietly NAME COMMAND...: shows the command's output only if it fails.
quietly() {
  local log="$work-$1.log"
  shift
  with_progress "$log" "$@" || { tail -n 30 "$log" >&2; die "failed: $*; the whole log is $log"; }
}

# make_project NAME SOURCE OPTION...: configures and builds SOURCE in build/consumer-NAME.
make_project() {
  local name=$1 source=$2 launcher=()
  shift 2
  ! command -v ccache >/dev/null || launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
  say "consumer: $name"
  quietly "$name" cmake -S "$source" -B "$work-$name" -G Ninja --no-warn-unused-cli \
    -DCMAKE_BUILD_TYPE=Release "${launcher[@]}" "${others[@]}" "$@"
  quietly "$name" cmake --build "$work-$name" -j "$jobs"
}

# Only the three libraries, their public headers and the package; no path of this machine.
check_prefix() {
  local files name allowed='include/piecework/(core|graph|global)/[a-z_]+\.hpp'
  allowed+='|lib.*/libpiecework_(core|graph|global)\.a|lib.*/cmake/Piecework/[A-Za-z-]+\.cmake'
  files=$(cd "$prefix" && find . -type f | sed 's|^\./||')
  ! grep -vxE "$allowed" <<<"$files" || die "these files should not be installed"
  for name in kernels dense aligned_array tree_plan tree_factor tree_sweep cholmod_solver; do
    ! grep "/$name\.hpp" <<<"$files" || die "a private header is installed"
  done
  ! grep -rF "$root" "$prefix" --include='*.cmake' || die "the installed package names build folders"
}

# The example needs neither Eigen to be compiled nor CHOLMOD to run.
check_example() {
  local headers libraries
  headers=$("${CXX:-c++}" -std=c++20 -I "$prefix/include" -M "$root/examples/solve/main.cpp") ||
    die "the solver's header cannot be compiled by itself"
  ! grep -E '/(Eigen|tbb|fmt)/' <<<"$headers" || die "the solver's header shows another library"
  libraries=$(ldd "$1")
  ! grep cholmod <<<"$libraries" || die "the example is linked with CHOLMOD"
}

rm -rf "$work"-*
make_project library "$root" -DPIECEWORK_LIBRARY_ONLY=ON -DCMAKE_INSTALL_PREFIX="$work-elsewhere"
quietly install cmake --install "$work-library"
mv "$work-elsewhere" "$prefix" # an installed package can be moved
check_prefix
make_project package "$root/examples/solve" -DCMAKE_PREFIX_PATH="$prefix"
"$work-package/solve_example" || die "the example fails with the installed package"
check_example "$work-package/solve_example"
make_project subdirectory "$root/examples/solve" -DPIECEWORK_SOURCE="$root"
"$work-subdirectory/solve_example" || die "the example fails with the sources as part of its build"
