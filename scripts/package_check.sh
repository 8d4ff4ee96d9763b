# shellcheck shell=bash
# Checks the installed package from a minimal external project. Sourced.

# Dependencies of each component beyond those of the components it needs: CMake packages, and libraries found by file.
declare -A component_packages=([core]="Eigen3 TBB hwy" [implicit]="" [cgal]="" [collision]="" [render]="OpenEXR" [scenes]="yaml-cpp" [fit]="")
declare -A component_libraries=([core]="" [implicit]="openvdb" [cgal]="gmp mpfr" [collision]="" [render]="deflate embree3" [scenes]="" [fit]="openvdb deflate niftiio teem")
declare -A component_needs=([core]="" [implicit]="core" [cgal]="core implicit" [collision]="core implicit" [render]="core"
  [scenes]="core implicit collision render" [fit]="core implicit cgal")

# check_component NAME PREFIX SCRATCH: builds and runs tests/package/component against one component, with all libraries hidden that it does not need.
check_component() {
  local name=$1 prefix=$2 build=$3/component_$1 one hide=() packages="" libraries=""
  for one in ${component_needs[$name]} "$name"; do packages+=" ${component_packages[$one]}" libraries+=" ${component_libraries[$one]}"; done
  for one in Eigen3 TBB hwy OpenEXR Imath yaml-cpp nlohmann_json CLI11 pybind11 GTest; do
    [[ " $packages " == *" $one "* || ($one == Imath && " $packages " == *" OpenEXR "*) ]] || hide+=("-DCMAKE_DISABLE_FIND_PACKAGE_$one=ON")
  done
  for one in openvdb gmp mpfr deflate niftiio teem embree3; do
    [[ " $libraries " == *" $one "* ]] || hide+=("-DSUPPLE_${one^^}_LIBRARY=OFF")
  done
  echo "-- component $name"
  cmake -S "$supple_root/tests/package/component" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$prefix" \
    -DCOMPONENT="$name" "${hide[@]}" && cmake --build "$build" && "$build/component"
}

# check_benchmarks SUPPLE SCRATCH: the benchmarks of an installed tool, called from elsewhere: all groups are there; one runs, and two scenes, of the library and not.
check_benchmarks() {
  local supple=$1 list=$2/benchmarks.txt rows=$2/benchmarks.jsonl
  (cd / && "$supple" bench --list) >"$list" || return 1
  if grep -q 'not built' "$list" || [[ $(grep -c ' built ' "$list") -lt 15 ]]; then
    echo "error: $supple bench --list: expected 15 groups that are built, found:" && cat "$list" && return 1
  fi
  (cd / && "$supple" bench core/spiral && "$supple" bench scenes/spiral_uncoils && "$supple" bench scenes/chain) | tee "$rows" || return 1
  [[ $(grep -c '"hash"' "$rows") -ge 4 && $(grep -c '"largest_error"' "$rows") == 2 ]] || { echo "error: expected rows of core/spiral and of two scenes"; return 1; }
}

# write_box FOLDER: a closed mesh, and a scene of the object that fits it.
write_box() {
  printf 'OFF\n8 12 0\n0 0 0\n2 0 0\n2 1 0\n0 1 0\n0 0 1\n2 0 1\n2 1 1\n0 1 1\n' >"$1/box.off"
  printf '3 %s\n' '0 2 1' '0 3 2' '4 5 6' '4 6 7' '0 1 5' '0 5 4' '1 2 6' '1 6 5' '2 3 7' '2 7 6' '3 0 4' '3 4 7' >>"$1/box.off"
  printf 'schema: 1\nduration: 0.1\nframe_rate: 10\nobjects: [{name: box, include: box.yaml}]\n' >"$1/box_scene.yaml"
}

# check_fit SUPPLE SCRATCH: fits a box by an installed tool, called from elsewhere, and reads the object in a scene.
check_fit() {
  local supple=$1 folder=$2
  write_box "$folder"
  (cd / && "$supple" fit "$folder/box.off" -o "$folder/box.yaml" --error 5% --particles 8 --overwrite && "$supple" check "$folder/box_scene.yaml")
}

# check_package BUILD_FOLDER: installs a build with its benchmarks into a scratch prefix and moves it; checks that no path of the source, the build or a
# library is exported and that scenes, documents, licence, benchmarks and, where it is built, the program of fits are installed; tests each component alone;
# builds tests/package against the whole package and runs it on a scene.
check_package() {
  local build=$1 scratch=$supple_root/build/package name
  rm -rf "$scratch"
  cmake --build "$build" --target benchmarks || return 1
  cmake --install "$build" --prefix "$scratch/first" && mv "$scratch/first" "$scratch/prefix" || return 1
  if grep -rnE --include='*.cmake' "$supple_root|[\"; ]/[A-Za-z0-9_./+-]*\.(so|a)" "$scratch/prefix"; then
    echo "error: the installed package contains absolute paths of the build machine (lines above)"
    return 1
  fi
  for name in LICENSE architecture.md ball_hits_spiral.yaml; do
    [[ -n $(find "$scratch/prefix" -name "$name") ]] || { echo "error: $name is not installed"; return 1; }
  done
  check_benchmarks "$scratch/prefix/bin/supple" "$scratch" || return 1
  if [[ -n $(find "$scratch/prefix" -name supple_fitTargets.cmake) ]]; then check_fit "$scratch/prefix/bin/supple" "$scratch" || return 1; fi
  for name in core implicit cgal collision render scenes fit; do
    [[ -f $(find "$scratch/prefix" -name "supple_${name}Targets.cmake") ]] || continue
    check_component "$name" "$scratch/prefix" "$scratch" || { echo "error: component $name fails alone"; return 1; }
  done
  cmake -S "$supple_root/tests/package" -B "$scratch/build" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_PREFIX_PATH="$scratch/prefix" || return 1
  cmake --build "$scratch/build" || return 1
  "$scratch/build/minimal_project" "$supple_root/tests/package/two_balls.yaml" || return 1
  [[ -d $build/python ]] || return 0
  local package
  package=$(find "$scratch/prefix" -path '*/supple/__init__.py')
  (cd / && PYTHONPATH=$(dirname "$(dirname "$package")") /usr/bin/python3 -B "$supple_root/tests/package/minimal_script.py" \
    "$supple_root/tests/package/two_balls.yaml")
}

# check_deb BUILD_FOLDER: makes the Debian package and installs it in a new root with nothing but Debian's base, where the tool runs a
# library scene by name and Python imports the package. As root; needs Debian's archive.
check_deb() {
  local build=$1 scratch=$supple_root/build/deb package sources=/etc/apt/sources.list.d/debian.sources
  install_packages deb
  rm -rf "$scratch" && mkdir -p "$scratch"
  cmake --build "$build" --target benchmarks || return 1
  (cd "$scratch" && cpack --config "$build/CPackConfig.cmake" -G DEB -B "$scratch/made") || return 1
  package=$(find "$scratch/made" -maxdepth 1 -name 'supple_*.deb')
  dpkg-deb --info "$package"
  [[ -f $sources ]] || sources=/etc/apt/sources.list
  mmdebstrap --quiet --variant=minbase --include=ca-certificates "$(. /etc/os-release && echo "$VERSION_CODENAME")" "$scratch/root" "$sources" || return 1
  cp "$package" "$scratch/root/supple.deb"
  write_box "$scratch/root/root"
  mount -t proc proc "$scratch/root/proc" || return 1  # by which the tool finds its library
  chroot "$scratch/root" sh -eu -c '
    apt-get -q update && DEBIAN_FRONTEND=noninteractive apt-get -q -y install --no-install-recommends /supple.deb
    cd /root
    supple run two_balls --simulate-only --frames 1-4 --progress none
    supple view out/two_balls --progress none && test -s out/two_balls/two_balls_view.html
    supple check ball_hits_spiral
    supple bench scenes/spiral_uncoils
    test ! -x /usr/libexec/supple/supple_fit || { supple fit box.off -o box.yaml --error 5% --particles 8 && supple check box_scene.yaml; }
    python3 -c "import supple; print(supple.library(\"two_balls\"))"
    test -s /usr/share/supple/blender/supple_import.py && test -s /usr/share/man/man1/supple.1'
  local result=$?
  umount "$scratch/root/proc" && rm -rf "$scratch/root"
  return $result
}

# check_wheel BUILD_FOLDER: makes the wheel of a build and uses it in a new virtual environment; importing takes less than 0.3 s.
check_wheel() {
  local build=$1 scratch=$supple_root/build/wheel_check python
  python=$(sed -n 's/^_\?Python_EXECUTABLE:[A-Z]*=//p' "$build/CMakeCache.txt" | head -n 1)
  rm -rf "$scratch"
  PYTHON=$python "$supple_root/scripts/wheel.sh" --build "$build" --out "$scratch" || return 1
  "$python" -m venv "$scratch/new" && "$scratch/new/bin/pip" install --quiet --disable-pip-version-check "$scratch"/supple-*.whl || return 1
  check_benchmarks "$scratch/new/bin/supple" "$scratch" || return 1
  if [[ -x $build/bin/supple_fit ]]; then check_fit "$scratch/new/bin/supple" "$scratch" || return 1; fi
  (cd "$scratch" && env -i PATH="$scratch/new/bin:/usr/bin:/bin" sh -eu -c '
    supple run two_balls --simulate-only --frames 1-4 --progress none
    supple view out/two_balls --progress none && test -s out/two_balls/two_balls_view.html
    python -c "
import time
begin = time.process_time()
import supple
took = time.process_time() - begin
print(f\"import takes {took:.2f} s\")
assert took < 0.3
assert supple.Simulation(supple.library(\"two_balls\")).state_hash"')
}
