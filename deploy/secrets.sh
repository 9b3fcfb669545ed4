#!/bin/sh
# Make the password of the database once: deploy/secrets/database-password, which git ignores.
set -eu
folder=${1:-$(dirname "$0")/secrets}
file=$folder/database-password
if [ -e "$file" ]; then
  echo "secrets.sh: $file is there already and stays" >&2
  exit 0
fi
# Closed to others by the folder: in the containers the file belongs to whoever made it, and two accounts read it.
umask 077
mkdir -p "$folder"
od -An -N32 -tx1 /dev/urandom | tr -d ' \n' > "$file"
chmod 444 "$file"
