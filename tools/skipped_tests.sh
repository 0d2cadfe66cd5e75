# Names the tests that ctest skips: a run without them proves less. Sourced by tools/test.
# shellcheck shell=bash

skipped=() # names of all tests that were skipped

# run_tests ARGUMENT...: runs ctest with these arguments, and adds the skipped tests to `skipped`. Returns the status of ctest,
# which is 0 when tests were skipped.
run_tests() {
  local log name status=0
  log=$(mktemp)
  ctest "$@" 2>&1 | tee "$log" || status=$?
  while IFS= read -r name; do skipped+=("$name"); done < <(sed -nE 's/^[[:space:]]+[0-9]+ - (.+) \(Skipped\)$/\1/p' "$log")
  rm -f "$log"
  return "$status"
}

# reject_skips COUNT: returns 1, and names the tests on stderr, when more than COUNT tests were skipped.
reject_skips() {
  [ ${#skipped[@]} -gt "$1" ] || return 0
  printf 'skipped: %s\n' "${skipped[@]:$1}" >&2
  echo "test: tests of scenarios, the lab or the browser were skipped, see above and \
build/release/Testing/Temporary/LastTest.log for the causes; --allow-skips accepts this" >&2
  return 1
}
