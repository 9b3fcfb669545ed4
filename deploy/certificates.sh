#!/bin/sh
# Create a certificate authority and one certificate for scheduler, workers and clients:
#   certificates.sh [--containers] FOLDER [DAYS]
#
# With --containers the user inside a container can read them too; the mode of the folder excludes other users.
# FOLDER/authority-key.pem signs further certificates: keep it off the cluster. Each machine needs the other
# three files. The owner of these files can run code on every worker.
set -eu
containers=
if [ "${1:-}" = --containers ]; then
  containers=yes
  shift
fi
folder=${1:?usage: certificates.sh [--containers] FOLDER [DAYS]}
days=${2:-365}
umask 077
mkdir -p "$folder"
cd "$folder"
if [ -e authority-key.pem ]; then
  echo "certificates.sh: $folder has an authority already; remove it to start again" >&2
  exit 1
fi
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days "$days" -subj "/CN=Bentray authority" \
  -addext "basicConstraints=critical,CA:TRUE,pathlen:0" -addext "keyUsage=critical,keyCertSign" \
  -keyout authority-key.pem -out authority.pem 2>/dev/null
openssl req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj "/CN=bentray" \
  -keyout key.pem -out request.pem 2>/dev/null
openssl x509 -req -in request.pem -CA authority.pem -CAkey authority-key.pem -CAcreateserial -days "$days" \
  -out certificate.pem 2>/dev/null
rm -f request.pem authority.srl
if [ -n "$containers" ]; then
  chmod 700 .
  chmod 444 authority.pem certificate.pem key.pem
fi
echo "$folder: authority.pem, certificate.pem and key.pem for every machine; keep authority-key.pem private"
