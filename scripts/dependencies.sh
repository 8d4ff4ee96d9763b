# shellcheck shell=bash
# Debian packages by purpose, and how they are installed. Sourced by the other scripts:
#   install_packages build run      installs the missing packages of these sets

declare -A supple_packages=(
  [build]="cmake ninja-build g++ ccache
           libeigen3-dev libtbb-dev libxxhash-dev libhwy-dev
           libopenvdb-dev libboost-iostreams-dev
           libdeflate-dev libopenexr-dev libosmesa6-dev libgl-dev libegl-dev libembree-dev
           libyaml-cpp-dev nlohmann-json3-dev libcli11-dev"
  [run]="libosmesa6 libegl1 libgl1-mesa-dri ffmpeg"
  [test]="libgtest-dev libcgal-dev libnifti-dev libteem-dev libopenvdb-tools"
  [python]="pybind11-dev python3-dev python3-numpy python3-venv"
  [fuzz]="clang libclang-rt-14-dev"
  [check]="clang clang-tidy libclang-rt-14-dev"
  [docs]="doxygen python3-venv"
  [deb]="dpkg-dev mmdebstrap"
  [data]="libcgal-demo mricron-data invesalius-examples"
)
declare -A supple_purpose=(
  [build]="to build" [run]="to draw and to encode films" [test]="to build the tests, Delaunay meshes and fits of meshes and volumes" [python]="for the Python package" [fuzz]="for the fuzz targets" [check]="for the second compiler and static analysis" [docs]="for the documentation site" [deb]="to try the Debian package" [data]="data to fit"
)

# missing_packages NAME...: prints those that dpkg does not list as installed.
missing_packages() {
  local package status
  for package in "$@"; do
    status=$(dpkg-query -W -f='${db:Status-Abbrev}' "$package" 2>/dev/null) || status=""
    [[ $status == ii* ]] || printf '%s\n' "$package"
  done
}

# dependency_failure MESSAGE PACKAGE...: says what to do by hand and ends the script with exit code 4.
dependency_failure() {
  local message=$1
  shift
  printf 'error: %s\n' "$message" >&2
  (($# == 0)) || printf '       install by hand, then run this again: apt-get install %s\n' "$*" >&2
  exit 4
}

# install_packages SET...
install_packages() {
  local set_name absent
  local -a missing=() as_root=() unknown=()
  if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    if [[ ${SUPPLE_SKIP_PACKAGES:-} == 1 ]]; then return 0; fi
    dependency_failure "this script installs Debian packages and found no apt-get here. Install the libraries that
       scripts/dependencies.sh lists by other means and set SUPPLE_SKIP_PACKAGES=1."
  fi
  for set_name in "$@"; do
    # The lists are words separated by blanks on purpose.
    # shellcheck disable=SC2086
    mapfile -t -O "${#missing[@]}" missing < <(missing_packages ${supple_packages[$set_name]})
  done
  ((${#missing[@]} > 0)) || return 0

  echo "Packages to install (apt-get):"
  for set_name in "$@"; do
    # shellcheck disable=SC2086
    absent=$(missing_packages ${supple_packages[$set_name]} | tr '\n' ' ')
    [[ -z $absent ]] || printf '  %s: %s\n' "${supple_purpose[$set_name]}" "$absent"
  done

  if ((EUID != 0)); then
    command -v sudo >/dev/null ||
      dependency_failure "packages are missing, and installing needs root: no sudo here." "${missing[@]}"
    # Without a terminal no password can be typed: fail at once instead of waiting.
    if [[ -t 0 ]]; then as_root=(sudo); else as_root=(sudo -n); fi
  fi
  as_root+=(env DEBIAN_FRONTEND=noninteractive)
  "${as_root[@]}" apt-get -q -o DPkg::Lock::Timeout=120 update >/dev/null ||
    echo "warning: apt-get update failed; trying with the package lists that are here" >&2
  for absent in "${missing[@]}"; do
    apt-cache show "$absent" >/dev/null 2>&1 || unknown+=("$absent")
  done
  ((${#unknown[@]} == 0)) ||
    dependency_failure "apt has no package named: ${unknown[*]} (the names are those of Debian 12)." "${missing[@]}"
  "${as_root[@]}" apt-get -q -y -o DPkg::Lock::Timeout=120 install --no-install-recommends "${missing[@]}" >/dev/null ||
    dependency_failure "apt-get could not install the packages; its messages are above." "${missing[@]}"
  mapfile -t unknown < <(missing_packages "${missing[@]}")
  ((${#unknown[@]} == 0)) || dependency_failure "still not installed: ${unknown[*]}." "${unknown[@]}"
}
