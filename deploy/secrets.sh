#!/bin/sh
# Create the database password, the first API key, the password of Grafana and a self-signed certificate of the edge
# once, in deploy/secrets/ (ignored by git).
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

if [ -e "$folder/edge-key.pem" ]; then
  echo "secrets.sh: $folder/edge-key.pem already exists and is kept" >&2
elif ! command -v openssl >/dev/null; then
  echo "secrets.sh: no openssl to create the certificate of the edge; install it, or put edge-certificate.pem and edge-key.pem into $folder" >&2
  exit 1
else
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 365 -subj "/CN=localhost" \
    -addext "subjectAltName=DNS:localhost,IP:127.0.0.1" \
    -keyout "$folder/edge-key.pem" -out "$folder/edge-certificate.pem" 2>/dev/null
  chmod 444 "$folder/edge-key.pem" "$folder/edge-certificate.pem"
fi
