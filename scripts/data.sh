#!/usr/bin/env bash
# Real data for `supple fit`, from Debian packages; nothing of it is part of this source.
#   scripts/data.sh [FOLDER]     installs the package where it is missing and unpacks meshes into FOLDER (default: out/data)
# Package libcgal-demo: bunny00, armadillo, femur, elephant, dino, hand (closed triangle meshes).
set -euo pipefail
# shellcheck source=scripts/dependencies.sh
source "$(dirname "${BASH_SOURCE[0]}")/dependencies.sh"
folder=${1:-out/data}
archive=/usr/share/doc/libcgal-demo/data.tar.gz
[[ -r $archive ]] || install_packages data
mkdir -p "$folder"
for name in bunny00 armadillo femur elephant dino hand; do
  tar -xzf "$archive" -C "$folder" --strip-components=2 "data/meshes/$name.off"
  echo "$folder/$name.off"
done
