#!/bin/sh
# Starts a Slurm of one node, with everything it writes in FOLDER: munged, slurmctld and slurmd as the present user
# (root). Ends with 77 where they are not installed. `stop.sh FOLDER` ends them.
set -e
folder=$1
for program in munged slurmctld slurmd sbatch; do
    command -v "$program" > /dev/null || PATH=$PATH:/usr/sbin command -v "$program" > /dev/null || {
        echo "no $program: apt-get install slurmctld slurmd slurm-client munge" >&2
        exit 77
    }
done
[ "$(id -u)" = 0 ] || { echo "slurmd wants root" >&2; exit 77; }
PATH=$PATH:/usr/sbin
mkdir -p "$folder/state" "$folder/spool"
chmod 755 "$folder"
host=$(hostname -s)
head -c 1024 /dev/urandom > "$folder/munge.key"
chmod 400 "$folder/munge.key"
munged --force --socket="$folder/munge.socket" --key-file="$folder/munge.key" \
    --pid-file="$folder/munged.pid" --log-file="$folder/munged.log" --seed-file="$folder/munge.seed"
cat > "$folder/slurm.conf" <<END
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=${2:-26817}
SlurmdPort=${3:-26818}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,batch_sched_delay=0
KillWait=5
MinJobAge=300
ReturnToService=2
MpiDefault=none
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=debug Nodes=$host Default=YES MaxTime=INFINITE State=UP OverSubscribe=FORCE:8
END
export SLURM_CONF=$folder/slurm.conf
slurmctld -c > "$folder/slurmctld.out" 2>&1
slurmd -c > "$folder/slurmd.out" 2>&1
for _ in $(seq 300); do
    if sinfo -h -o %t 2> /dev/null | grep -q idle; then exit 0; fi
    sleep 0.2
done
echo "Slurm did not start: see $folder/*.log" >&2
exit 1
