# shellcheck shell=bash
# The installed package as a stranger meets it. Sourced.

# What each component stands on beside those before it: CMake packages, and libraries that are found by file.
declare -A component_packages=([core]="Eigen3 TBB hwy" [implicit]="" [cgal]="" [collision]="" [render]="OpenEXR" [scenes]="yaml-cpp")
declare -A component_libraries=([core]="" [implicit]="openvdb" [cgal]="gmp mpfr" [collision]="" [render]="deflate embree3" [scenes]="")
declare -A component_needs=([core]="" [implicit]="core" [cgal]="core implicit" [collision]="core implicit" [render]="core"
  [scenes]="core implicit collision render")

# check_component NAME PREFIX SCRATCH: builds tests/package/component against it and runs that, all that it does not stand on hidden.
check_component() {
  local name=$1 prefix=$2 build=$3/component_$1 one hide=() packages="" libraries=""
  for one in ${component_needs[$name]} "$name"; do packages+=" ${component_packages[$one]}" libraries+=" ${component_libraries[$one]}"; done
  for one in Eigen3 TBB hwy OpenEXR Imath yaml-cpp nlohmann_json CLI11 pybind11 GTest; do
    [[ " $packages " == *" $one "* || ($one == Imath && " $packages " == *" OpenEXR "*) ]] || hide+=("-DCMAKE_DISABLE_FIND_PACKAGE_$one=ON")
  done
  for one in openvdb gmp mpfr deflate embree3; do
    [[ " $libraries " == *" $one "* ]] || hide+=("-DSUPPLE_${one^^}_LIBRARY=OFF")
  done
  echo "-- component $name"
  cmake -S "$supple_root/tests/package/component" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$prefix" \
    -DCOMPONENT="$name" "${hide[@]}" && cmake --build "$build" && "$build/component"
}

# check_package BUILD_FOLDER: installs it into a scratch prefix and moves that, checks that no path of the source, of the build or of a
# library went along and that scenes, documents and licence did, tries each component alone, builds tests/package against all of it and
# runs that on a scene.
check_package() {
  local build=$1 scratch=$supple_root/build/package name
  rm -rf "$scratch"
  cmake --install "$build" --prefix "$scratch/first" && mv "$scratch/first" "$scratch/prefix" || return 1
  if grep -rnE --include='*.cmake' "$supple_root|[\"; ]/[A-Za-z0-9_./+-]*\.(so|a)" "$scratch/prefix"; then
    echo "error: the installed package names a place of the machine it was built on (lines above)"
    return 1
  fi
  for name in LICENSE architecture.md ball_hits_spiral.yaml; do
    [[ -n $(find "$scratch/prefix" -name "$name") ]] || { echo "error: $name is not installed"; return 1; }
  done
  for name in core implicit cgal collision render scenes; do
    [[ -f $(find "$scratch/prefix" -name "supple_${name}Targets.cmake") ]] || continue
    check_component "$name" "$scratch/prefix" "$scratch" || { echo "error: component $name fails alone"; return 1; }
  done
  cmake -S "$supple_root/tests/package" -B "$scratch/build" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_PREFIX_PATH="$scratch/prefix" || return 1
  cmake --build "$scratch/build" || return 1
  "$scratch/build/stranger" "$supple_root/tests/package/two_balls.yaml" || return 1
  [[ -d $build/python ]] || return 0
  local package
  package=$(find "$scratch/prefix" -path '*/supple/__init__.py')
  (cd / && PYTHONPATH=$(dirname "$(dirname "$package")") /usr/bin/python3 -B "$supple_root/tests/package/stranger.py" \
    "$supple_root/tests/package/two_balls.yaml")
}
