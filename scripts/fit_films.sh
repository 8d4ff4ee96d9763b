#!/usr/bin/env bash
# Films of objects from data: fits the data of scripts/data.sh and runs the scenes of scenes/from_data.
#   scripts/fit_films.sh [SUPPLE] [FOLDER] [SCENE...]     the tool (default: build/release/bin/supple); folder of data, objects and films (default: out/films);
#                                                         scenes by name (default: all)
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
tool=$(realpath "${1:-$root/build/release/bin/supple}")
folder=${2:-out/films}
shift $(($# < 2 ? $# : 2))
"$root/scripts/data.sh" "$folder" >/dev/null
cd "$folder"
scenes=("$@")
[[ $# -gt 0 ]] || for scene in "$root"/scenes/from_data/*.yaml; do scenes+=("$(basename "$scene" .yaml)"); done
for scene in "${scenes[@]}"; do
  cp "$root/scenes/from_data/$scene.yaml" .
  # The first line of a scene says how its object is fitted.
  read -r -a words < <(sed -n '1s|^# supple fit out/data/||p' "$scene.yaml")
  "$tool" fit "${words[@]}" --overwrite --quiet
  "$tool" run "$scene.yaml" --out "$scene" --overwrite
done
