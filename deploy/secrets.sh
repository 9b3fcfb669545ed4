#!/bin/sh
# Create the database password, the first API key and the password of Grafana once, in deploy/secrets/ (ignored by git).
set -eu
folder=${1:-$(dirname "$0")/secrets}
# The mode of the folder excludes other users. In the containers two users read the files, so the files are readable.
umask 077
mkdir -p "$folder"

random() {
  od -An -N"$1" -tx1 /dev/urandom | tr -d ' \n'
}

keep() {
  if [ -e "$folder/$1" ]; then
    echo "secrets.sh: $folder/$1 already exists and is kept" >&2
    return
  fi
  printf '%s' "$2" > "$folder/$1"
  chmod 444 "$folder/$1"
}

keep database-password "$(random 32)"
keep grafana-password "$(random 16)"
keep first-key "bentray_$(random 6)_$(random 20)"
