#!/usr/bin/env bash
# Makes docs/gallery.md and its pictures from scenes of the library: one frame of each.
#   scripts/gallery.sh [SUPPLE] [NAME...]   the tool (default: build/release/bin/supple); only the named scenes are drawn again
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
tool=$root/build/release/bin/supple
if (($# > 0)) && [[ -x $1 && ! -d $1 ]]; then tool=$(realpath "$1") && shift; fi
work=$root/build/gallery
pictures=$root/docs/images/gallery
mkdir -p "$work" "$pictures"

# Scene, frame, what to see. Further words are overrides of keys.
scenes=$(cat <<'LIST'
ball_hits_spiral|29|A ball hits a spiral that remembers its shape
spiral_uncoils|60|The spiral is pulled open and coils up again
two_balls|11|Two balls meet off centre; their surfaces touch without a gap
ball_on_plate|20|A ball comes to rest on a plate
ball_on_mesh|24|Balls roll off a block from a mesh file
bounces|14|A ball bounces lower and lower
newtons_cradle|20|The last ball leaves with the speed of the first
press_and_belt|30|A press squeezes a ball on a belt
spiral_three_balls|24|Three balls hit a spiral at once
worm_curls_up|40|A worm curls up and touches itself
slide_on_incline|14|Friction holds one table and lets another slide
looks|8|Looks of surfaces: textures, metal, a wireframe, pressure in colours
blending|1|Ways to blend
kernels|1|Field functions
primitives|1|Skeleton shapes
joined_segments|1|Segments with and without bulges where they join
hand_and_mitten|1|Which parts blend is a graph
still_life|1|Light between surfaces, by the path tracer
glass_and_wax|1|Glass, wax and jelly, by the path tracer
rain_of_balls|46|Balls appear one after the other and fall into a box
strand_parts|34|A strand parts: at once, and fading
bar_with_hinge|14|A bar of two kinds of particles folds at its hinge
LIST
)

draw() {
  local name=$1 frame=$2
  shift 2
  "$tool" run "$name" --out "$work/$name" --frames "$frame" --overwrite --quiet --progress none --set 'output.images.size=[640,360]' --set output.contacts='[]' "$@" 2>"$work/$name.log" ||
    { cat "$work/$name.log" >&2; return 1; }
  local picture
  picture=$(find "$work/$name/frames" -name '*.png' | sort | head -n 1)
  cp "$picture" "$pictures/$name.png"
}

{
  echo "# Gallery"
  echo
  echo "One frame of each scene. \`scripts/gallery.sh\` makes this page; \`supple run NAME\` makes the film."
  echo
  echo "| | |"
  echo "|---|---|"
} >"$work/gallery.md"
row=""
while IFS='|' read -r name frame words; do
  if [[ ! -s $pictures/$name.png ]] || { (($# > 0)) && [[ " $* " == *" $name "* ]]; }; then draw "$name" "$frame" || exit 1; fi
  cell="![$words](images/gallery/$name.png)<br>\`$name\`: $words"
  if [[ -z $row ]]; then row=$cell; else echo "| $row | $cell |" >>"$work/gallery.md" && row=""; fi
done <<<"$scenes"
[[ -z $row ]] || echo "| $row | |" >>"$work/gallery.md"
mv "$work/gallery.md" "$root/docs/gallery.md"
du -sh "$pictures"
