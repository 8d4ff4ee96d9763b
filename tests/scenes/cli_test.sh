#!/usr/bin/env bash
# The command line as users meet it: exit codes, the first words of messages, and nothing half-written.
#   cli_test.sh SUPPLE SCRATCH BROKEN_CALLS FEW_THREADS
# The last two are libraries to load first: with one signals break calls of the system off, with the other it starts few threads.
set -u
supple=$1
scratch=$2
hostile=$(cd "$(dirname "$0")" && pwd)/hostile
broken_calls=$3
few_threads=$4
# The address sanitizer reserves terabytes of addresses.
limit_memory() { nm -D "$supple" 2> /dev/null | grep -q __asan_init || ulimit -v 1000000; }
rm -rf "$scratch"
mkdir -p "$scratch"
cd "$scratch" || exit 1
failures=0

head_text='schema: 1
duration: 0.2 s
frame_rate: 10'
ball='  - name: ball
    particles: {arrange: single, mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]'
printf '%s\nobjects:\n%s\n' "$head_text" "$ball" > good.yaml
printf '%s\nobjects:\n%s\n    colur: [1, 0, 0]\n' "$head_text" "$ball" > unknown_key.yaml
sed 's/radius: 0.5/radius: -0.5/' good.yaml > negative_radius.yaml
sed 's/mass: 1/mass: .nan/' good.yaml > nan.yaml
printf '%s\npairs: [{objects: [ball, cube], collide: false}]\n' "$(cat good.yaml)" > missing_object.yaml
printf '%s\ntime_step: {substeps: 1}\nobjects:\n  - name: chain\n' "$head_text" > diverges.yaml
printf '    particles: {arrange: line, count: 3, spacing: 0.2, spin: [0, 0, 3], mass: 0.01}\n' >> diverges.yaml
printf '    interactions: [{law: bond_frame, stretch: 1e6, rotation: 10}]\n' >> diverges.yaml
sed -i 's/duration: 0.2 s/duration: 20 s/' diverges.yaml
sed 's/time_step: {substeps: 1}/time_step: {max_substeps: 2}/' diverges.yaml > too_fine.yaml
echo 'a plain file' > plain_file

fault() {
  echo "$*"
  failures=$((failures + 1))
}

# expect CODE WORDS COMMAND...: exit code and words that standard error must hold.
expect() {
  local code=$1 words=$2
  shift 2
  "$supple" "$@" > out.txt 2> err.txt < /dev/null
  local found=$?
  if [[ $found != "$code" ]] || { [[ -n $words ]] && ! grep -qF -- "$words" err.txt; }; then
    echo "supple $*: expected exit $code and '$words', found exit $found and:"
    cat err.txt
    failures=$((failures + 1))
  fi
}

expect 0 '' check good.yaml
expect 0 '' run good.yaml --out good --progress none
expect 3 "did you mean 'colour'" check unknown_key.yaml
expect 3 'negative_radius.yaml:7:62: objects[0].skeleton[0].kernel.radius: expected a length > 0 [m], found -0.5' check negative_radius.yaml
expect 3 'numbers must be finite' check nan.yaml
expect 3 "found 'cube'" check missing_object.yaml
expect 4 'absent.yaml' check absent.yaml
expect 4 'plain_file' run good.yaml --out plain_file/out --progress none
expect 4 '--overwrite' run good.yaml --out good --progress none
expect 0 '' --version
expect 2 '' run
expect 2 "supple: expected a command, found 'rn'; did you mean 'run'? (known: run, render" rn good.yaml
expect 2 "found 'simulate'; known: run, render, export, view, sweep, fit, job, info, compare, check, explain, query, bench, reference" simulate good.yaml
expect 2 "supple: expected an option, found '--verson'; did you mean '--version'?" --verson
expect 2 "supple run: expected an option, found '--thread'; did you mean '--threads'?" run good.yaml --thread 2
expect 2 "supple run: expected an option, found '-out'; did you mean '--out'?" run -out elsewhere good.yaml
expect 2 "supple check: expected an option, found '--camera'; known: --help, --set, --allow-path, --quiet" check good.yaml --camera=left
expect 2 '--frames' run good.yaml --out frames --frames 5-1 --progress none
expect 0 '' view good --progress none --cells 12
# Of a run with other values, and of a preview.
expect 0 '' run good.yaml --out set --set objects.ball.particles.mass=2 --set gravity=[0,0,-1] --simulate-only --progress none
expect 0 '' view set --progress none --cells 12
expect 7 'objects.ball.particles.mass=2 (here 1)' view good.yaml --out set --progress none --cells 12
expect 0 '' view good.yaml --out set --set objects.ball.particles.mass=2 --set gravity=[0,0,-1] --progress none --cells 12
expect 0 '' run good.yaml --preview --out previewed --simulate-only --progress none
expect 0 '' view previewed --progress none --cells 12
expect 4 "name the scene instead: supple view SCENE --out ." view .
expect 4 "expected saved states of 'good'" view good.yaml --out nowhere --progress none
expect 0 '' export good.yaml --out good --gltf --progress none
expect 0 '' check two_balls
expect 4 'two_bals' check two_bals
expect 2 '--size' view good --size none
expect 2 '1 to 3' run good.yaml --out frames --frames 9 --progress none
expect 2 '--memory' run good.yaml --out frames --memory nan --progress none
expect 2 '--memory' check good.yaml --memory 4X
expect 6 'in 1 kB of memory' run good.yaml --out small --memory 1k --progress none
expect 6 'expected at most' check good.yaml --memory 1k
expect 2 '--time-limit' run good.yaml --out limited --time-limit 0 --progress none
expect 6 'time limit' run good.yaml --out limited --time-limit 1e-9 --simulate-only --progress none
expect 0 '' run good.yaml --out limited --resume --simulate-only --progress none
expect 2 '' query nonsense good.yaml
expect 2 '--format' job good.yaml
expect 2 'openjd,slurm,ray' job good.yaml --format lsf
expect 2 '--chunk' job good.yaml --format ray --chunk 0
expect 4 'absent.yaml' job absent.yaml --format ray
mkdir planned && echo '{"points": [{}]}' > planned/sweep.json
expect 2 'for a sweep' job planned --format slurm --folder elsewhere
for format in openjd slurm ray; do
  expect 0 '' job good.yaml --format "$format" --out "a job of $format" --folder 'a run'
  expect 0 '' job planned --format "$format" --out "a sweep of $format"
done
for verb in run render; do
  expect 3 'expected the scene that the job was written for, with fingerprint 0123456789abcdef' "$verb" good.yaml --out good --fingerprint 0123456789abcdef
done
fingerprint=$(grep -o 'fingerprint [0-9a-f]*' 'a job of ray' | cut -d ' ' -f 2)
expect 0 '' run good.yaml --out 'a run' --no-pictures --resume --fingerprint "$fingerprint" --progress none
expect 0 '' render good.yaml --out 'a run' --frames 2-9 --fingerprint "$fingerprint" --progress none
expect 3 'fingerprint' render good.yaml --out 'a run' --set duration=0.3 --fingerprint "$fingerprint" --progress none
for error in 1e-12 0 0.5 nan; do
  expect 2 "expected a number from 1e-10 to 0.1, found $error" query contact good.yaml --error "$error"
done
expect 0 '' query contact good.yaml --error 1e-10
expect 0 '' bench --list
expect 2 '--list' bench cores
expect 2 "found '--lst'" bench --lst
expect 2 'collision/poses, collision/calibration' bench collision/posess
# Programs of benchmarks get what follows their names, options too, in its order.
mkdir bin
ln "$supple" bin/supple 2> err.txt || cp "$supple" bin/supple
bin/supple bench core 2> err.txt
[[ $? == 4 ]] && grep -qF 'libexec/supple' err.txt || fault "bench core without its program: $(cat err.txt)"
bin/supple bench --list | grep -q 'core/stability  *not built' || fault 'bench --list: expected no programs'
bin/supple fit data.off -o data.yaml 2> err.txt
[[ $? == 4 ]] && grep -qF -- '--target supple_fit_program' err.txt || fault "fit without its program: $(cat err.txt)"
expect 2 '--out is required' fit data.off
expect 2 'expected a share such as 1% or 0.01, found much' fit data.off -o data.yaml --error much
for folder in bin libexec/supple; do
  mkdir -p "$folder"
  printf '#!/bin/sh\necho "$@"\n' > "$folder/supple_bench"
  chmod +x "$folder/supple_bench"
  [[ $(bin/supple bench collision/stability --seed 7 map.svg) == 'contact_stress --seed 7 map.svg' ]] || fault 'bench collision/stability --seed 7 map.svg: expected these words for its program'
  bin/supple bench --list | grep -q 'core/stability  *built' || fault 'bench --list: expected programs'
  mv "$folder/supple_bench" "$folder/supple_fit"
  [[ $(bin/supple fit fit --out 'an object.yaml' --error 2%) == 'fit --out an object.yaml --error 2%' ]] || fault 'fit fit --out an object.yaml: expected these words for its program'
  rm "$folder/supple_fit"
done
expect 5 'diverged at step' run diverges.yaml --out diverged --progress none
expect 6 'time_step.max_substeps' run too_fine.yaml --out fine --progress none
expect 6 'time_step.max_substeps' check too_fine.yaml
expect 0 '' query forces too_fine.yaml
expect 0 '' explain too_fine.yaml
grep -qF 'no time step is possible' out.txt || { echo 'explain too_fine.yaml: expected why no time step is possible'; failures=$((failures + 1)); }
printf 'schema: 1\nduration: 5 ms\nframe_rate: 1000\nground: {modulus: 1e9}\ntime_step: {substeps: 1}\nobjects:\n' > passes.yaml
printf '  - name: ball\n    particles: {at: [0, 0, 0.2], velocity: [0, 0, -600], mass: 0.001}\n' >> passes.yaml
printf '    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]\n    contact: {modulus: 1e8}\n' >> passes.yaml
expect 5 "at t = 0.001 s 'ball' and 'ground' overlap more" run passes.yaml --out passes --progress none
# A state of a scene with another key: the one that differs, and what to add.
expect 0 '' run good.yaml --out heavy --progress none --simulate-only --set objects.ball.particles.mass=2
expect 7 'with objects.ball.particles.mass=2 (here 1); its scene is this one with --set objects.ball.particles.mass=2' query forces good.yaml --state heavy/states/good.0002.state
if grep -qF -- '--overwrite' err.txt; then
  echo 'query: expected no advice that it does not take, found:'
  cat err.txt
  failures=$((failures + 1))
fi
expect 0 '' query forces good.yaml --state heavy/states/good.0002.state --set objects.ball.particles.mass=2
# A run ends with the last frame asked for, and goes on from there.
expect 0 '' run good.yaml --out part --frames 1-2 --progress none --simulate-only
[[ ! -e part/states/good.0003.state ]] || { echo 'run --frames 1-2: frame 3 was simulated'; failures=$((failures + 1)); }
expect 0 '' run good.yaml --out part --resume --progress none --simulate-only
[[ $(grep state_hash part/result.json) == $(grep state_hash good/result.json) ]] || { echo 'run --resume: another final state'; failures=$((failures + 1)); }
# States under the names of others, and lost ones.
cp part/states/good.0001.state part/states/good.0003.state
expect 7 'expected the state of frame 3, found that of frame 1' run good.yaml --out part --resume --progress none --simulate-only
expect 7 'expected the state of frame 3, found that of frame 1' export good.yaml --out part --mesh usd --progress none
expect 7 'expected the state of frame 3, found that of frame 1' render good.yaml --out part --progress none
rm part/states/good.000[23].state
expect 0 '' run good.yaml --out part --resume --progress none --simulate-only
rm part/states/good.0002.state
expect 0 'frame 2 is simulated again: its saved state is lost' run good.yaml --out part --resume --progress none --simulate-only
# What acts on nothing: a run may be drawn with another floor.
for set in 'ground={height: -1, collides: false}' 'pairs=[]' 'camera={from: [0, -4, 1], look_at: [0, 0, 0]}'; do
  expect 0 '' render good.yaml --out part --progress none --set "$set" --set 'output.images={size: [32, 24]}'
done
# Nothing is left of a scene that could not be read.
expect 4 'nosuch.yaml' run nosuch.yaml --progress none
expect 4 '' run nosuch.yaml --out nothing_read --progress none
expect 4 'run the scene first' render good.yaml --out nothing_read --progress none
for folder in out nothing_read; do
  [[ ! -e $folder ]] || { echo "$folder: expected nothing, found a folder"; failures=$((failures + 1)); }
done

mkdir -p damaged && cp good/states/good.0002.state damaged && printf 'x' >> damaged/good.0002.state
expect 7 'checksum' query forces good.yaml --state damaged/good.0002.state

mkdir -p loop unlocked/.lock && ln -s frames loop/frames
expect 4 'loop/frames' run good.yaml --out loop --progress none
expect 4 '.lock' run good.yaml --out unlocked --progress none
if "$supple" reference > /dev/full 2> err.txt || ! grep -qF 'standard output' err.txt; then
  echo 'output that could not be written was not missed'
  failures=$((failures + 1))
fi

# Files that scenes name are regular ones, inside their folder.
mkfifo pipe.csv
for file in pipe.csv ../good.yaml /etc/hostname '"p.csv\0x"'; do
  printf '%s\nobjects:\n  - name: ball\n    particles: {arrange: file, file: %s}\n    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n' \
    "$head_text" "$file" > names.yaml
  timeout 20 "$supple" check names.yaml > out.txt 2> err.txt < /dev/null
  code=$?
  [[ $code == 3 || $code == 4 ]] && grep -qE 'expected a (regular file|file inside)' err.txt || fault "check with file $file: exit $code, $(cat err.txt)"
done
rm pipe.csv

# Every file that a command opens is a regular one: a pipe in its place is refused or replaced, not waited for.
sed 's/radius: 0.5}}\]/radius: 0.5}}]\noutput: {images: {size: [32, 24], samples: 1}, film: true, particles: csv, mesh: [ply, usd], cell: 0.3}/' good.yaml > piped.yaml
"$supple" run piped.yaml --out piped --progress none > /dev/null 2>&1 || fault 'the run whose files become pipes failed'
"$supple" export piped.yaml --out piped --mesh gltf --progress none > /dev/null 2>&1
for file in $(cd piped && find . -name .lock -o -type f ! -name '*.000[23].*'); do
  for command in 'info piped_now' 'compare piped_now piped --out compared' 'render piped.yaml --out piped_now' 'render piped.yaml --out piped_now --overwrite' \
    'export piped.yaml --out piped_now --particles csv' 'run piped.yaml --out piped_now --resume' 'run piped.yaml --out piped_now --overwrite' \
    'view piped_now --page page.html' 'view piped.yaml --out piped_now' "query forces piped.yaml --state piped_now/$file"; do
    rm -rf piped_now compared page.html
    cp -r piped piped_now
    rm "piped_now/$file"
    mkfifo "piped_now/$file"
    # shellcheck disable=SC2086  # words of a command
    timeout --signal=KILL 20 "$supple" $command > out.txt 2> err.txt < /dev/null
    code=$?
    [[ $code == 0 || $code == 4 || $code == 7 ]] || fault "a pipe as $file, $command: exit $code, $(cat err.txt)"
  done
done
for command in 'check' 'run' 'explain' 'query forces' 'query field good.yaml --points' 'view' 'info' 'compare piped'; do
  rm -f pipe.yaml
  mkfifo pipe.yaml
  # shellcheck disable=SC2086  # words of a command
  timeout --signal=KILL 20 "$supple" $command pipe.yaml > out.txt 2> err.txt < /dev/null
  code=$?
  [[ $code == 4 ]] || fault "a pipe, $command: exit $code, $(cat err.txt)"
done
rm -rf pipe.yaml piped piped_now compared page.html

# Links, and allowed files. Nothing of a file elsewhere is shown.
mkdir -p inside elsewhere
echo '0, 0, 0' > elsewhere/points.csv
printf 'duration: 0.2 s\n' > elsewhere/part.yaml
ln -s ../elsewhere/points.csv inside/link.csv
ln -s ../elsewhere/part.yaml inside/part.yaml
ln -s ../elsewhere inside/folder
ln -s /etc/passwd inside/secret.csv
names() {
  printf '%s\nobjects:\n  - name: ball\n    particles: {arrange: file, file: %s}\n    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n' "$head_text" "$1" > inside/names.yaml
}
for file in link.csv secret.csv folder/points.csv; do
  names $file
  expect 4 "inside/$file: objects.ball.particles.file: expected a file inside the scene's folder, found a link to another place; --allow-path" check inside/names.yaml
  ! grep -q root err.txt || fault "check with file $file shows what is in it: $(cat err.txt)"
done
names ../elsewhere/points.csv
expect 3 "expected a file inside the scene's folder, found '../elsewhere/points.csv'; --allow-path" check inside/names.yaml
expect 3 "expected a file inside the scene's folder" check inside/names.yaml --allow-path inside
for file in link.csv folder/points.csv ../elsewhere/points.csv "$PWD/elsewhere/points.csv"; do
  names "$file"
  expect 0 '' check inside/names.yaml --allow-path elsewhere
  expect 0 '' run inside/names.yaml --allow-path elsewhere/points.csv --out allowed --overwrite --simulate-only --progress none
done
printf 'include: part.yaml\n%s\n' "$(grep -v duration good.yaml)" > inside/includes.yaml
expect 3 "expected a file inside the scene's folder, found 'part.yaml', a link to another place; --allow-path" check inside/includes.yaml
expect 0 '' check inside/includes.yaml --allow-path elsewhere
sed 's/^objects:/ground: {texture: {pattern: picture, file: link.csv}}\nobjects:/' good.yaml > inside/texture.yaml
expect 4 "expected a file inside the scene's folder, found a link" check inside/texture.yaml
# Names of scenes are names of files and of folders.
cp good.yaml ...yaml
expect 4 'found a name that begins with a dot' run ...yaml --progress none
[[ ! -e states && ! -e out ]] || fault 'a scene named ...yaml writes outside its folder'
rm ...yaml
# Control characters of names and words do not reach the terminal.
escape=$'\e]0;x\a\302\233m'
for words in "check $escape.yaml" "$escape" "check good.yaml --$escape" "check good.yaml --memory $escape" "run good.yaml --progress $escape" \
    "run good.yaml --frames $escape" "run good.yaml --set $escape=1" "info $escape" "new $escape" "query forces good.yaml --state $escape" \
    "run good.yaml --simulate-only --out $escape"; do
  "$supple" $words > out.txt 2>&1 < /dev/null
  ! grep -qP '[\x00-\x08\x0b-\x1f\x7f]|\xc2[\x80-\x9f]' out.txt || fault "supple ${words@Q} prints control characters: $(cat -v out.txt)"
done
rm -r "$escape"
# Sizes and kinds before content: a large file that is no state is not read.
truncate -s 3G large
(limit_memory; "$supple" query forces good.yaml --state large > out.txt 2> err.txt)
code=$?
[[ $code == 7 ]] && grep -qF 'another kind of file' err.txt || fault "query --state of a large file: exit $code, $(cat err.txt)"
(limit_memory; "$supple" query field good.yaml --points large > out.txt 2> err.txt)
code=$?
[[ $code == 6 ]] || fault "query --points of a large file: exit $code, $(cat err.txt)"
rm large

# Progress that nobody reads any more: the run goes on. The reader leaves before the first line.
mkfifo progress
"$supple" run good.yaml --out unread --progress plain > out.txt 2> progress &
run=$!
exec 3< progress
exec 3<&-
wait "$run"
code=$?
[[ $code == 0 ]] && grep -q '"outcome": "done"' unread/result.json || fault "run whose progress is not read: exit $code"
rm progress
# Signals from the first line on: a check ends, too.
for signal in INT TERM; do
  "$supple" check "$hostile/huge_ball_about_a_spiral.yaml" --set objects.spiral.particles.count=80 --time-limit 600 > out.txt 2> err.txt &
  run=$!
  # A shell without job control starts it with SIGINT ignored: not before its handler is there.
  for ((k = 0; k < 3000; ++k)); do
    caught=$(awk '/SigCgt/ {print $2}' "/proc/$run/status")
    ((0x0$caught & 2)) && break
    sleep 0.01
  done
  kill -s $signal "$run" 2> /dev/null
  wait "$run"
  code=$?
  [[ $signal == INT && $code == 130 || $signal == TERM && $code == 143 ]] || fault "signal $signal to a check: exit $code, $(cat err.txt)"
done
expect 0 'takes more than the limits of a check, 0.1 s of processor time and 200 MB of memory; --time-limit and --memory raise them' check "$hostile/huge_ball_about_a_spiral.yaml" --time-limit 0.1
expect 2 '--time-limit' check good.yaml --time-limit 0

# Standard streams that are closed: what is printed lands in no file of the run.
sed 's/^objects:/output: {mesh: [ply, usd], cell: 0.1}\nobjects:/' good.yaml > meshes.yaml
"$supple" run meshes.yaml --out closed --progress plain <&- >&- 2>&-
code=$?
[[ $code == 0 ]] || fault "run with closed streams: exit $code"
if grep -rlE 'frame .* stage|folder:' closed; then fault 'printed text is in files'; fi
"$supple" reference >&- 2> err.txt
code=$?
[[ $code == 4 ]] || fault "reference without standard output: exit $code"

# Signals break calls of the system off: the run is the same.
"$supple" run meshes.yaml --out plain --progress none > plain.txt
LD_PRELOAD=$broken_calls "$supple" run meshes.yaml --out broken --progress none > broken.txt 2> err.txt
code=$?
[[ $code == 0 ]] || fault "run with calls that break off: exit $code, $(cat err.txt)"
cmp plain/meshes.usda broken/meshes.usda && cmp <(sed 's/plain/broken/g' plain.txt) broken.txt || fault 'broken calls changed files or text'

# A report of something else.
mkdir foreign
for text in '[' '[1, 2]' '{"frames": 3}' '{"outcome": {}}'; do
  echo "$text" > foreign/result.json
  expect 7 'foreign/result.json: expected the report of a run' info foreign
done

# No more threads, at any moment: a message, or the same run with fewer.
hash_of() { grep -o '"state_hash": "[0-9a-f]*"' "$1/result.json"; }
sed 's/^objects:/output: {mesh: [ply, usd], cell: 0.1, images: {size: [64, 48], samples: 1}}\nobjects:/' good.yaml > drawn.yaml
for ((left = 0; left < 16; ++left)); do
  rm -rf few
  SUPPLE_THREADS_LEFT=$left LD_PRELOAD=$few_threads timeout --signal=KILL 60 "$supple" run drawn.yaml --out few --threads 3 --progress none > out.txt 2> err.txt
  code=$?
  [[ $code == 0 && $(hash_of few) == "$(hash_of plain)" ]] || { [[ $code == 6 ]] && grep -q '^threads: ' err.txt; } ||
    fault "run with $left threads: exit $code, $(cat err.txt)"
  SUPPLE_THREADS_LEFT=$left LD_PRELOAD=$few_threads "$supple" check meshes.yaml > out.txt 2> err.txt
  code=$?
  [[ $code == 0 ]] || { [[ $code == 6 ]] && grep -q '^threads: ' err.txt; } || fault "check with $left threads: exit $code, $(cat err.txt)"
done

# A limit of the system for the size of files.
(ulimit -f 8; "$supple" run meshes.yaml --out large --progress none > out.txt 2> err.txt)
code=$?
[[ $code == 4 ]] && grep -qF 'File too large' err.txt || fault "run with a limit of file sizes: exit $code, $(cat err.txt)"
[[ -z $(find large -name '*.tmp') ]] || fault 'a limit of file sizes leaves temporary files'

# ffmpeg ends with the run, and what it was writing goes.
sed 's/^objects:/output: {images: {size: [64, 48], samples: 1}, film: true}\nobjects:/' good.yaml > film.yaml
printf '#!/bin/sh\necho $$ > "%s/ffmpeg.pid"\nfor last; do :; done\necho half > "$last"\nexec sleep 600\n' "$PWD" > slow_ffmpeg
chmod +x slow_ffmpeg
lives() { grep -qE '^[0-9]+ \(.*\) [^ZX]' "/proc/$1/stat" 2> /dev/null; }
# start_film FOLDER OPTIONS...: a run up to where ffmpeg works; $run and $film are the processes.
start_film() {
  rm -f ffmpeg.pid
  SUPPLE_FFMPEG=$PWD/slow_ffmpeg "$supple" run film.yaml --out "$@" --progress none > out.txt 2> err.txt &
  run=$!
  for ((k = 0; k < 3000; ++k)); do
    [[ -s ffmpeg.pid ]] && find "$1" -name 'film.mp4' -size +0 | grep -q . && break
    sleep 0.02
  done
  film=$(cat ffmpeg.pid)
}
for signal in INT TERM; do
  start_film "film_$signal"
  kill -s $signal "$run"
  wait "$run"
  code=$?
  [[ $signal == INT && $code == 130 || $signal == TERM && $code == 143 ]] || fault "signal $signal while ffmpeg works: exit $code"
  ! lives "$film" || fault "ffmpeg outlives a run that $signal ends"
  [[ -z $(find "film_$signal" -name '*.tmp' -o -name '*.mp4') ]] || fault "files of ffmpeg are left: $(find "film_$signal" -name '*.mp4')"
  [[ -s film_$signal/states/film.0003.state ]] || fault "no state of the last frame after $signal"
  grep -q '"outcome": "interrupted"' "film_$signal/result.json" || fault "no outcome after $signal"
done
start_film film_KILL
kill -9 "$run"
wait "$run" 2> /dev/null
for ((k = 0; k < 500; ++k)); do lives "$film" && sleep 0.02; done
! lives "$film" || fault 'ffmpeg outlives a run that is killed'
touch film_KILL/frames/.film.0001.png.1.0.tmp film_KILL/states/.probe.1.0.tmp
expect 0 '' run film.yaml --out film_KILL --resume --progress none
[[ -s film_KILL/film.mp4 ]] || fault 'no film after --resume'
[[ -z $(find film_KILL -name '*.tmp') ]] || fault "temporary files of a dead run are left: $(find film_KILL -name '*.tmp')"

# Completions and the page for man name every command and option.
"$supple" describe bash > completion.sh && bash -n completion.sh || fault 'completion for bash is no bash'
for word in run render export sweep info compare check explain query bench reference new; do
  completed=$(bash -c "source completion.sh; COMP_WORDS=(supple ${word:0:2}); COMP_CWORD=1; _supple; echo \"\${COMPREPLY[*]}\"")
  [[ " $completed " == *" $word "* ]] || fault "'supple ${word:0:2}' is completed to '$completed'"
done
completed=$(bash -c 'source completion.sh; COMP_WORDS=(supple run --over); COMP_CWORD=2; _supple; echo "${COMPREPLY[*]}"')
[[ $completed == --overwrite ]] || fault "'supple run --over' is completed to '$completed'"
"$supple" describe man > supple.1 && grep -q 'overwrite' supple.1 || fault 'no page for man'
expect 2 '' describe fish

# Templates of scenes.
for template in ball balls chain jelly sheet; do
  expect 0 '' new "new_$template" --template "$template"
  expect 0 '' check "new_$template.yaml"
done
expect 4 'expected a new file, found one that exists' new new_ball
expect 2 "did you mean 'jelly'" new other --template jely
expect 2 'expected a name of letters' new 'a;b'

# Sweeps: all points in one command, resumable after a kill, failed points as rows.
mass=objects.ball.particles.mass
expect 0 '' sweep good.yaml --set "$mass=1:4:log3" --set 'gravity=[[0, 0, 0], [0, 0, -9.81]]' --out sweep --jobs 2 --progress none
[[ $(cut -d, -f1-2 sweep/table.csv | tr '\n' ' ') == "point,$mass 1,1 2,1 3,2 4,2 5,4 6,4 " ]] || fault "table of a sweep: $(cat sweep/table.csv)"
[[ $(grep -c ',done,' sweep/table.csv) == 6 ]] || fault "rows of a sweep: $(cat sweep/table.csv)"
stamp=$(stat -c %y sweep/point_0003/result.json)
expect 0 '' sweep good.yaml --set "$mass=1:4:log3" --set 'gravity=[[0, 0, 0], [0, 0, -9.81]]' --out sweep --progress none
[[ $(stat -c %y sweep/point_0003/result.json) == "$stamp" ]] || fault 'a finished point is run again'
expect 4 'found another one; choose another --out, or --overwrite' sweep good.yaml --set "$mass=[1, 5]" --out sweep --progress none
expect 3 "unknown key; did you mean 'mass'?" sweep good.yaml --set 'objects.ball.particles.mas=1:2:3' --out sweep_none
[[ ! -e sweep_none ]] || fault 'a sweep that is refused leaves a folder'
expect 2 'expected --out DIR' sweep good.yaml --set "$mass=1:2:3"
expect 2 'the plan of a folder is fixed' sweep sweep --set "$mass=1:2:3"
expect 4 'supple sweep SCENE --set KEY=VALUES --out DIR --plan-only writes it' sweep good
expect 0 '' sweep good.yaml --set "$mass=1:4:log3" --set 'gravity=[[0, 0, 0], [0, 0, -9.81]]' --out shared --plan-only
[[ $(find shared -type f) == shared/sweep.json ]] || fault "--plan-only writes more: $(find shared)"
for point in 6 1 3 2 5 4; do expect 0 '' sweep shared --point $point; done
expect 2 'expected a point from 1 to 6, found 7' sweep shared --point 7
expect 0 '' sweep shared --collect
cmp -s sweep/table.csv shared/table.csv || fault 'points on their own give another table'
"$supple" sweep good.yaml --set "$mass=1:4:log3" --set 'gravity=[[0, 0, 0], [0, 0, -9.81]]' --out killed --jobs 1 --progress none > /dev/null 2>&1 &
run=$!
for ((k = 0; k < 500; ++k)); do [[ -e killed/point_0002/row.json ]] && break; sleep 0.02; done
kill -9 "$run"
wait "$run" 2> /dev/null
touch killed/point_0002/.row.json.1.0.tmp
expect 0 '' sweep killed --progress none
cmp -s sweep/table.csv killed/table.csv || fault 'a sweep that was killed ends with another table'
expect 0 '' sweep diverges.yaml --set 'objects.chain.interactions[0]=[{law: bond_frame, stretch: 1e6, rotation: 10}, {law: bond_frame, stretch: 1e-3, rotation: 1e-9}]' --out sweep_fails --progress none
grep -q '^1,.*,diverged,.*diverged at step' sweep_fails/table.csv || fault "no row of a failed point: $(cat sweep_fails/table.csv)"
grep -q '^2,.*,done,' sweep_fails/table.csv || fault "a failed point ends a sweep: $(cat sweep_fails/table.csv)"

# A variation of a run.
expect 0 '' run good.yaml --from-frame 2 --from good --set "$mass=3" --out varied --simulate-only --progress none
grep -q '"differences": "objects.ball.particles.mass=1 (here 3)"' varied/result.json || fault 'no origin of a variation'
expect 7 'start a variation from a frame N of this run' run good.yaml --set "$mass=3" --resume --out good --simulate-only --progress none
expect 2 '--from requires --from-frame' run good.yaml --from good --out varied2

grep -q '"outcome": "diverged"' diverged/result.json || { echo 'no outcome for the diverged run'; failures=$((failures + 1)); }
expect 3 '' run nan.yaml --out invalid --progress none
grep -q '"outcome": "invalid"' invalid/result.json || { echo 'no outcome for the invalid scene'; failures=$((failures + 1)); }
if find . -name '*.tmp*' | grep -q .; then
  echo 'temporary files were left:'
  find . -name '*.tmp*'
  failures=$((failures + 1))
fi
exit $((failures > 0))
