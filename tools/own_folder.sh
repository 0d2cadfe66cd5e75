# own_folder: guards folders that a script empties. Sourced by the scripts in this folder.
# shellcheck shell=bash

# own_folder PROGRAM DIR: makes DIR with the marker file .made-by-PROGRAM. Returns 2, with one line on stderr, when DIR exists,
# is not empty and has no marker: then it holds files of somebody else, perhaps takes.
own_folder() {
  local marker=$2/.made-by-$1
  if [ ! -e "$marker" ] && [ -e "$2" ] && { [ ! -d "$2" ] || [ -n "$(ls -A "$2")" ]; }; then
    echo "$1: $2: holds files that $1 did not make; expected a new or empty folder, or one of an earlier run" >&2
    return 2
  fi
  mkdir -p "$2" && : >>"$marker"
}
