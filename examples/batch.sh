#!/usr/bin/env bash
# Many scenes or recordings in one go, each into a run folder of its own:
#   examples/batch.sh OUT scenes/*.urdf scenes/*.xml recordings/*
# A file is imported, a folder is reconstructed. Exit codes of each: 0 done, 2 done but to be looked at, 1 refused.
set -u
out=$1
shift
worst=0
for source in "$@"; do
  name=$(basename "${source%.*}")
  if [ -d "$source" ]; then
    twin reconstruct "$source" -o "$out/$name"
  else
    twin import "$source" -o "$out/$name"
  fi
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
