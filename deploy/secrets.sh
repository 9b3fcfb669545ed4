#!/bin/sh
# Make the password of the database and the first API key once, in deploy/secrets/, which git ignores.
set -eu
folder=${1:-$(dirname "$0")/secrets}
# Closed to others by the folder: in the containers the files belong to whoever made them, and two accounts read them.
umask 077
mkdir -p "$folder"

random() {
  od -An -N"$1" -tx1 /dev/urandom | tr -d ' \n'
}

keep() {
  if [ -e "$folder/$1" ]; then
    echo "secrets.sh: $folder/$1 is there already and stays" >&2
    return
  fi
  printf '%s' "$2" > "$folder/$1"
  chmod 444 "$folder/$1"
}

keep database-password "$(random 32)"
keep first-key "bentray_$(random 6)_$(random 20)"
