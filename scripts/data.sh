#!/usr/bin/env bash
# Real data for `supple fit`, from Debian packages; nothing of it is part of this source.
#   scripts/data.sh [FOLDER]     installs the package where it is missing and unpacks data into FOLDER (default: out/data)
# Package libcgal-demo: bunny00, armadillo, femur, elephant, dino, hand (closed triangle meshes); kitten, hippo1 (points with normals);
# liver (labels of a CT scan: 1 is the liver), skull (a scalar field: 2.9 is the bone), with headers of NRRD beside their files.
set -euo pipefail
# shellcheck source=scripts/dependencies.sh
source "$(dirname "${BASH_SOURCE[0]}")/dependencies.sh"
folder=${1:-out/data}
archive=/usr/share/doc/libcgal-demo/data.tar.gz
[[ -r $archive ]] || install_packages data
mkdir -p "$folder"
names=()
for name in bunny00 armadillo femur elephant dino hand; do names+=("meshes/$name.off"); done
names+=(points_3/kitten.xyz points_3/hippo1.ply images/liver.inr.gz images/skull_2.9.inr)
tar -xzf "$archive" -C "$folder" --strip-components=2 "${names[@]/#/data/}"
gunzip -f "$folder/liver.inr.gz"

# header NAME TYPE SIZES SPACINGS FILE: a header of NRRD for an INR file, whose own header takes 256 bytes.
header() {
  cat >"$folder/$1.nhdr" <<HEADER
NRRD0004
type: $2
dimension: 3
sizes: $3
spacings: $4
units: "mm" "mm" "mm"
endian: little
encoding: raw
byte skip: 256
data file: $5
HEADER
}
header liver uchar "438 353 165" "0.617188 0.617188 1.33333" liver.inr
header skull float "64 64 64" "3.94305 3.94305 3.65079" skull_2.9.inr
for name in "${names[@]}"; do
  name=${name##*/}
  name=${name/liver.inr.gz/liver.nhdr}
  echo "$folder/${name/skull_2.9.inr/skull.nhdr}"
done
