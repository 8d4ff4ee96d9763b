#!/usr/bin/env bash
# From a scene file to a film: installs missing packages, builds, simulates, renders.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/dependencies.sh"
source "$here/parts.sh"

if (($# == 0)) || [[ $1 == -h || $1 == --help ]]; then
  cat <<'USAGE'
usage: scripts/run.sh SCENE [options of `supple run`]
  e.g. scripts/run.sh scenes/library/figures/ball_hits_spiral.yaml
Leaves out/NAME/ with frames/, the film and result.json (or in the folder that --out names). NAME is the file's name.
USAGE
  (($# > 0)) && exit 0
  exit 2
fi

scene=$1
shift
# A path is relative to the current folder, or else to the project's folder.
if [[ ! -e $scene && -e $supple_root/$scene ]]; then scene=$supple_root/$scene; fi
if [[ ! -f $scene ]]; then
  echo "error: $scene: expected a scene file, found none; see scenes/library" >&2
  exit 4
fi
name=$(basename "$scene")
name=${name%.*}

# Without --out the output goes to out/NAME, where an earlier result is replaced, or continued with --resume.
own_folder=1 replace=1
for argument in "$@"; do
  case $argument in
    --out | --out=*) own_folder=0 ;;
    --overwrite | --resume) replace=0 ;;
  esac
done
if ((own_folder == 1)); then
  set -- "$@" --out "$supple_root/out/$name"
  if ((replace == 1)); then set -- "$@" --overwrite; fi
fi

install_packages build run
options=()
# The first build is without tests and CGAL, whose templates take two minutes; later builds keep the configuration of the folder.
[[ -f $supple_root/build/release/CMakeCache.txt ]] || options=(-DSUPPLE_BUILD_TESTS=OFF -DSUPPLE_CGAL=OFF)
part "build (release)" "$supple_root/build/logs/run_build.log" configure_and_build release supple_tool "${options[@]}" || exit 1

printf '%-34s %s\n' "simulate and render" "$scene"
# The tool ends by naming the frames, the film and the result.
exec "$supple_root/build/release/bin/supple" run "$scene" "$@"
