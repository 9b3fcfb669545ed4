#!/bin/sh
# Remove from the image's libraries what nothing runs there: trim.sh SITE_PACKAGES
set -eu
cd "${1:?usage: trim.sh SITE_PACKAGES}"
find . -type d \( -name tests -o -name test \) -prune -exec rm -rf {} +
# Of botocore's descriptions of Amazon's services: a bucket's, and those of signing in to one.
for service in botocore/data/*/; do
  case ${service#botocore/data/} in
    s3/ | sts/ | sso/ | sso-oidc/ | signin/) ;;
    *) rm -rf "$service" ;;
  esac
done
