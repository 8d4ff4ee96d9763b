#!/usr/bin/env bash
# Job of the scene 'two drops', fingerprint FINGERPRINT: 21 frames in 4 tasks.
#   bash FILE              submits all tasks; submitted again, it does what is missing
#   bash FILE TASK ...     one task, as the cluster calls it
# Options of all tasks are variables of sbatch: SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_TIMELIMIT ...
set -eu
name='two drops'
logs='/runs/two drops/logs'
threads=2
frames=21
chunk=6
simulate=('supple' 'run' '/shots/John'\''s/two drops.yaml' '--out' '/runs/two drops' '--set' 'objects.left.particles.mass=0.25' '--threads' '2' '--fingerprint' 'FINGERPRINT' '--progress' 'none' '--quiet' '--no-pictures' '--resume')
draw=('supple' 'render' '/shots/John'\''s/two drops.yaml' '--out' '/runs/two drops' '--set' 'objects.left.particles.mass=0.25' '--threads' '2' '--fingerprint' 'FINGERPRINT' '--progress' 'none' '--quiet')
largest_array=${LARGEST_ARRAY:-1000}  # at most MaxArraySize of the cluster

# send NAME OPTIONS... -- TASK...: submits this file, prints the number of the job
send() {
  local name=$1 options=()
  shift
  while [[ $1 != -- ]]; do options+=("$1"); shift; done
  shift
  sbatch --parsable --requeue --kill-on-invalid-dep=yes --open-mode=append --job-name="$name" --cpus-per-task="$threads" \
    --output="${logs//%/%%}/%x.log" ${options[@]+"${options[@]}"} -- "$file" "$@" | cut -d ';' -f 1
}

# send_array NAME TASKS DEPENDENCY TASK: in arrays that the cluster takes; prints their numbers with a colon before each
send_array() {
  local name=$1 tasks=$2 dependency=$3 first=0 many
  while ((first < tasks)); do
    many=$((tasks - first < largest_array ? tasks - first : largest_array))
    printf ':%s' "$(send "$name" ${dependency:+--dependency="$dependency"} --array="0-$((many - 1))" -- "$4" "$first")"
    first=$((first + many))
  done
}

case ${1:-} in
  simulate) exec "${simulate[@]}" ;;
  draw)
    first=$((($2 + SLURM_ARRAY_TASK_ID) * chunk + 1))
    exec "${draw[@]}" --frames "$first-$((first + chunk - 1))"
    ;;
  film) exec "${draw[@]}" ;;
  '') ;;
  *) echo "expected simulate, draw, film or nothing, found '$1'" >&2; exit 2 ;;
esac

file=$(realpath -- "$0")
mkdir -p -- "$logs"
simulated=$(send "$name simulate" -- simulate)
drawn=$(send_array "$name draw" $(((frames + chunk - 1) / chunk)) "afterok:$simulated" draw)
film=$(send "$name film" --dependency="afterok$drawn" -- film)
echo "submitted: simulation $simulated, frames ${drawn#:}, film $film"
