#!/usr/bin/env bash
# Real data for `supple fit`, from Debian packages; nothing of it is part of this source.
#   scripts/data.sh [FOLDER]     installs the package where it is missing and unpacks data into FOLDER (default: out/data)
# Package libcgal-demo: bunny00, armadillo, femur, elephant, dino, hand (closed triangle meshes); kitten, hippo1 (points with normals);
# liver (labels of a CT scan: 255 is the liver), skull (a scalar field: 2.9 is the bone), with headers of NRRD beside their files.
# Package mricron-data: ch2 (an MRI of a head). Package invesalius-examples: ct_skull (labels of a CT scan of a head: 255 is the bone).
set -euo pipefail
# shellcheck source=scripts/dependencies.sh
source "$(dirname "${BASH_SOURCE[0]}")/dependencies.sh"
folder=${1:-out/data}
archive=/usr/share/doc/libcgal-demo/data.tar.gz
head=/usr/share/mricron/templates/ch2.nii.gz
cranium=/usr/share/doc/invesalius-examples/examples/Cranium.inv3
[[ -r $archive && -r $head && -r $cranium ]] || install_packages data
mkdir -p "$folder"
names=()
for name in bunny00 armadillo femur elephant dino hand; do names+=("meshes/$name.off"); done
names+=(points_3/kitten.xyz points_3/hippo1.ply images/liver.inr.gz images/skull_2.9.inr)
tar -xzf "$archive" -C "$folder" --strip-components=2 "${names[@]/#/data/}"
gunzip -f "$folder/liver.inr.gz"
cp "$head" "$folder"
tar -xzOf "$cranium" --wildcards '*/mask_0.dat' >"$folder/ct_skull.raw"

# header NAME TYPE SIZES SPACINGS SKIP FILE: a header of NRRD for a file whose own header takes SKIP bytes.
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
byte skip: $5
data file: $6
HEADER
}
header liver uchar "438 353 165" "0.617188 0.617188 1.33333" 256 liver.inr
header skull float "64 64 64" "3.94305 3.94305 3.65079" 256 skull_2.9.inr
header ct_skull uchar "257 257 109" "0.957031 0.957031 1.5" 0 ct_skull.raw
for name in "${names[@]}" ch2.nii.gz ct_skull.nhdr; do
  name=${name##*/}
  name=${name/liver.inr.gz/liver.nhdr}
  echo "$folder/${name/skull_2.9.inr/skull.nhdr}"
done
