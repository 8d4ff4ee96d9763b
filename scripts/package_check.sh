# shellcheck shell=bash
# The installed package as a stranger meets it. Sourced.

# check_package BUILD_FOLDER: installs it into a scratch prefix, checks that no path of the source or build tree went
# along, builds tests/package against it and runs that on a scene.
check_package() {
  local build=$1 scratch=$supple_root/build/package
  rm -rf "$scratch"
  cmake --install "$build" --prefix "$scratch/prefix" || return 1
  if grep -rn --include='*.cmake' -F "$supple_root" "$scratch/prefix"; then
    echo "error: the installed package names the tree it was built in (lines above)"
    return 1
  fi
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
