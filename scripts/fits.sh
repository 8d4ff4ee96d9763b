#!/usr/bin/env bash
# Fits the data of scripts/data.sh, prints the table of docs/fitting.md and makes its picture, FOLDER/fits.png.
#   scripts/fits.sh [SUPPLE] [FOLDER]     the tool (default: build/release/bin/supple); folder of data, objects and pictures (default: out/data)
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
tool=${1:-$root/build/release/bin/supple}
folder=${2:-out/data}
"$root/scripts/data.sh" "$folder" >/dev/null

# fit NAME FILE OPTION...: fits one and prints its row.
fit() {
  local name=$1 file=$2
  shift 2
  "$tool" fit "$folder/$file" -o "$folder/$name.yaml" --picture "$folder/$name.png" "$@" --overwrite --quiet 2>"$folder/$name.log" || {
    cat "$folder/$name.log" >&2
    return 1
  }
  python3 - "$folder/$name.json" "$name" "$*" <<'PYTHON'
import json
import sys

r = json.load(open(sys.argv[1]))
share = lambda key: " %, ".join(f"{100 * r[way][key]:.2f}" for way in ("from_data", "to_data")) + " %"
print(f"| {sys.argv[2]} | `{sys.argv[3]}` | {r['repair']['triangles']} | {r['primitives']} | {share('rms')} | {share('largest')} | "
      f"{100 * r['volume_error']:+.2f} % | {r['genus']['fit']} of {r['genus']['data']} | {r['seconds']:.0f} |", flush=True)
PYTHON
}

echo "| data | options | triangles | primitives | RMS from, to | largest from, to | volume | handles | seconds |"
echo "|---|---|---|---|---|---|---|---|---|"
for name in bunny00 femur armadillo elephant dino; do fit "$name" "$name.off" --error 2%; done
fit kitten kitten.xyz --error 2%
fit hippo hippo1.ply --error 2%
fit liver liver.nhdr --error 2% --particles 60 --label 255 --pieces largest
fit skull skull.nhdr --error 2% --iso 2.9 --pieces largest
fit ct_skull ct_skull.nhdr --error 2% --label 255 --pieces largest
fit head ch2.nii.gz --error 4% --iso 30 --pieces largest

# Data on the left, fit on the right.
inputs=()
for name in bunny00 armadillo elephant kitten liver skull; do inputs+=(-i "$folder/$name.png"); done
ffmpeg -hide_banner -loglevel error -y "${inputs[@]}" -filter_complex \
  "$(for k in 0 1 2 3 4 5; do printf '[%d]scale=480:-1:flags=area[s%d];' $k $k; done)[s0][s1][s2][s3][s4][s5]xstack=inputs=6:layout=0_0|w0_0|0_h0|w0_h0|0_h0+h2|w0_h0+h2" \
  -frames:v 1 "$folder/fits.png"
