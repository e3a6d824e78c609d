#!/bin/sh
# Ends what start.sh has started in FOLDER, and waits until it has ended.
for name in slurmd slurmctld munged; do
    [ -f "$1/$name.pid" ] || continue
    pid=$(cat "$1/$name.pid")
    kill "$pid" 2> /dev/null
    for _ in $(seq 100); do
        state=$(ps -o stat= -p "$pid") || break
        case $state in Z*) break ;; esac
        sleep 0.1
    done
    if ps -o stat= -p "$pid" | grep -qv Z; then kill -9 "$pid"; fi
done
exit 0
