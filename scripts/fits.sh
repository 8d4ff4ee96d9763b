#!/usr/bin/env bash
# Fits the meshes of scripts/data.sh and prints the table of docs/fitting.md.
#   scripts/fits.sh [SUPPLE] [FOLDER]     the tool (default: build/release/bin/supple); folder of data and objects (default: out/data)
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
tool=${1:-$root/build/release/bin/supple}
folder=${2:-out/data}
"$root/scripts/data.sh" "$folder" >/dev/null
echo "| data | triangles | primitives | RMS from, to | largest from, to | volume | handles | seconds |"
echo "|---|---|---|---|---|---|---|---|"
for name in bunny00 femur armadillo elephant dino; do
  "$tool" fit "$folder/$name.off" -o "$folder/$name.yaml" --error 2% --overwrite --quiet 2>/dev/null
  python3 - "$folder/$name.json" "$name" <<'PYTHON'
import json
import sys

r = json.load(open(sys.argv[1]))
share = lambda key: " %, ".join(f"{100 * r[way][key]:.2f}" for way in ("from_data", "to_data")) + " %"
print(f"| {sys.argv[2]} | {r['repair']['triangles']} | {r['primitives']} | {share('rms')} | {share('largest')} | "
      f"{100 * r['volume_error']:+.2f} % | {r['genus']['fit']} of {r['genus']['data']} | {r['seconds']:.0f} |")
PYTHON
done
