#!/bin/sh
# Check before the first start whether this machine can run docker-compose.yml: deploy/check.sh
# Prints one line for each thing that is missing; the exit code is 1 then.
set -u
cd "$(dirname "$0")/.."
missing=0
lacks() {
  echo "check.sh: $1" >&2
  missing=1
}

command -v docker >/dev/null || { lacks "no docker client; install the Docker engine with its compose plugin"; exit 1; }
docker info >/dev/null 2>&1 || lacks "the Docker engine does not answer; start it, or set DOCKER_HOST"
version=$(docker compose version --short 2>/dev/null | sed 's/^v//')
major=${version%%.*}
rest=${version#*.}
minor=${rest%%.*}
if [ -z "$version" ]; then
  lacks "no docker compose; install its plugin, 2.24 or later"
elif [ "$major" -lt 2 ] || { [ "$major" -eq 2 ] && [ "$minor" -lt 24 ]; }; then
  lacks "docker compose $version; 2.24 or later reads .env for the service"
else
  for secret in "${BENTRAY_FIRST_KEY_SECRET:-deploy/secrets/first-key}" \
    "${BENTRAY_DATABASE_PASSWORD_SECRET:-deploy/secrets/database-password}" \
    "${BENTRAY_EDGE_CERTIFICATE_SECRET:-deploy/secrets/edge-certificate.pem}" \
    "${BENTRAY_EDGE_KEY_SECRET:-deploy/secrets/edge-key.pem}"; do
    [ -r "$secret" ] || lacks "no $secret; deploy/secrets.sh creates it"
  done
  docker compose config -q || lacks "docker-compose.yml with .env is not valid, as said above"
fi
memory=$(docker info --format '{{.MemTotal}}' 2>/dev/null || echo 0)
if [ "${memory:-0}" -gt 0 ] && [ "$memory" -lt 8000000000 ]; then
  lacks "$((memory / 1000000)) MB of memory; a service with one worker needs 8 GB, or smaller limits in .env (deploy/README.md)"
fi
exit $missing
