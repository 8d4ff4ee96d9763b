#!/usr/bin/env bash
# Job of the sweep 'a sweep', fingerprint FINGERPRINT: 3 points.
#   bash FILE              submits all tasks; submitted again, it does what is missing
#   bash FILE TASK ...     one task, as the cluster calls it
# Options of all tasks are variables of sbatch: SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_TIMELIMIT ...
set -eu
name='a sweep'
logs='/runs/a sweep/logs'
threads=4
points=3
point=('supple' 'sweep' '/runs/a sweep' '--fingerprint' 'FINGERPRINT' '--threads' '4' '--quiet')
collect=('supple' 'sweep' '/runs/a sweep' '--fingerprint' 'FINGERPRINT' '--threads' '4' '--quiet' '--collect')
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
  point) exec "${point[@]}" --point $(($2 + SLURM_ARRAY_TASK_ID + 1)) ;;
  collect) exec "${collect[@]}" ;;
  '') ;;
  *) echo "expected point, collect or nothing, found '$1'" >&2; exit 2 ;;
esac

file=$(realpath -- "$0")
mkdir -p -- "$logs"
points_sent=$(send_array "$name point" "$points" '' point)
# Failed points are rows of the table, too.
table=$(send "$name collect" --dependency="afterany$points_sent" -- collect)
echo "submitted: points ${points_sent#:}, table $table"
