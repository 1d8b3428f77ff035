#!/usr/bin/env bash
# Many scenes in one go, each into a run folder of its own; of recordings `twin batch` takes care.
#   examples/import_many.sh OUT scenes/*.urdf scenes/*.xml
# Exit codes of each: 0 done, 2 done but to be looked at, 1 refused.
set -u
out=$1
shift
worst=0
for source in "$@"; do
  name=$(basename "${source%.*}")
  twin import "$source" -o "$out/$name"
  code=$?
  # export and check go on with what is doubted; both say so again
  if [ $code -ne 1 ]; then
    twin export "$out/$name" --json > "$out/$name/export.json" || code=$?
    twin check "$out/$name" --json > "$out/$name/check.json" || code=$?
  fi
  printf '%s: %s\n' "$source" "$code"
  if [ $code -ne 0 ]; then worst=2; fi
done
exit $worst
