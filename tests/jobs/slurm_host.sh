#!/usr/bin/env bash
# Starts Slurm on this machine alone, in a folder of its own: one node that takes CPUS tasks. Needs slurm-wlm and munge, and root.
#   slurm_host.sh FOLDER CPUS   prints the variables that its commands need, and ends when its standard input is closed
set -eu
folder=$(realpath -m -- "$1")
cpus=$2
host=$(hostname -s)
mkdir -p "$folder/state" "$folder/spool"
chmod 711 "$folder"

head -c 1024 /dev/urandom > "$folder/munge.key"
chmod 400 "$folder/munge.key"
socket=$folder/munge.socket
munged --foreground --force --key-file="$folder/munge.key" --socket="$socket" --pid-file="$folder/munged.pid" \
  --seed-file="$folder/munge.seed" --log-file="$folder/munged.log" > /dev/null 2>&1 &
munged=$!

cat > "$folder/slurm.conf" << CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
AuthInfo=socket=$socket
CredType=cred/munge
SlurmUser=root
SlurmdParameters=config_overrides
SlurmdUser=root
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SwitchType=switch/none
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,batch_sched_delay=0,sched_min_interval=10000
ReturnToService=2
MaxArraySize=1001
MinJobAge=600
NodeName=$host NodeAddr=127.0.0.1 CPUs=$cpus RealMemory=1000
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$folder/slurm.conf
slurmctld -D -c > /dev/null 2>&1 &
slurmctld=$!
slurmd -D -N "$host" > /dev/null 2>&1 &
slurmd=$!
trap 'kill "$slurmd" "$slurmctld" "$munged" 2> /dev/null; wait' EXIT

for _ in $(seq 100); do
  [[ $(sinfo --noheader --format=%T 2> /dev/null) == idle ]] && break
  sleep 0.2
done
[[ $(sinfo --noheader --format=%T) == idle ]] || { echo "Slurm does not start; see the logs in $folder" >&2; exit 1; }
echo "SLURM_CONF=$SLURM_CONF"
cat > /dev/null
