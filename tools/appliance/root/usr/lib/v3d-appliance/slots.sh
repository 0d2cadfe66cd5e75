# shellcheck shell=sh
# Functions that read and change which slot starts, for the sh of busybox and of Debian. The file is grubenv of the partition
# V3D-BOOT; the boot menu (grub.cfg) explains its variables.
#
# Its first 512 bytes hold all variables, and it is written in place, in one request: a disk writes a sector whole or not at
# all. A file that a power cut damaged all the same is like a missing one. Without it, the boot menu starts slot A, or B where A
# cannot be read, and counts no starts. A missing file is made with the next change.
#
# Without the file, both slots are "unknown": they may start, but neither is on trial, because the other one may be empty.

# booted_slot: the slot that runs, A or B.
booted_slot() { sed -n 's/.*\bv3d\.slot=\([AB]\)\b.*/\1/p' "${cmdline:-/proc/cmdline}"; }
other_slot() { if [ "$1" = A ]; then echo B; else echo A; fi; }

# read_slots FILE: sets ORDER, A_STATE, A_TRIES, B_STATE and B_TRIES. The file may be missing.
read_slots() {
  ORDER='A B' A_STATE=unknown A_TRIES=3 B_STATE=unknown B_TRIES=3
  [ -f "$1" ] || return 0
  while IFS='=' read -r name value; do
    case $name=$value in
      ORDER='A B' | ORDER='B A') ORDER=$value ;;
      A_STATE=good | A_STATE=trial | A_STATE=bad | A_STATE=unknown) A_STATE=$value ;;
      B_STATE=good | B_STATE=trial | B_STATE=bad | B_STATE=unknown) B_STATE=$value ;;
      A_TRIES=[0-3]) A_TRIES=$value ;;
      B_TRIES=[0-3]) B_TRIES=$value ;;
    esac
  done <"$1"
}

# write_slots FILE: writes these variables as GRUB's environment block of 1,024 bytes.
write_slots() {
  block=$(printf '# GRUB Environment Block\nORDER=%s\nA_STATE=%s\nA_TRIES=%s\nB_STATE=%s\nB_TRIES=%s\n#' \
    "$ORDER" "$A_STATE" "$A_TRIES" "$B_STATE" "$B_TRIES")
  padding=$((1024 - ${#block}))
  { printf '%s' "$block"; printf "%${padding}s" '' | tr ' ' '#'; } |
    dd of="$1" bs=1024 count=1 iflag=fullblock conv=notrunc,fsync 2>/dev/null
}

# slot_state SLOT, slot_tries SLOT: of the variables that were read.
slot_state() { if [ "$1" = A ]; then echo "$A_STATE"; else echo "$B_STATE"; fi; }
slot_tries() { if [ "$1" = A ]; then echo "$A_TRIES"; else echo "$B_TRIES"; fi; }
# set_slot SLOT STATE TRIES
set_slot() { if [ "$1" = A ]; then A_STATE=$2 A_TRIES=$3; else B_STATE=$2 B_TRIES=$3; fi; }

# primary_slot: the slot that starts next.
primary_slot() {
  for slot in $ORDER; do
    if [ "$(slot_state "$slot")" != bad ] && [ "$(slot_tries "$slot")" -gt 0 ]; then echo "$slot" && return; fi
  done
  for slot in $ORDER; do
    if [ "$(slot_state "$slot")" != bad ]; then echo "$slot" && return; fi
  done
  echo "${ORDER%% *}"
}
# prefer_slot SLOT: it starts next, on trial.
prefer_slot() {
  ORDER="$1 $(other_slot "$1")"
  set_slot "$1" trial 3
}
# confirm_slot SLOT: it has started well. A slot that was on trial before it has failed.
confirm_slot() {
  other=$(other_slot "$1")
  if [ "$(slot_state "$other")" = trial ]; then set_slot "$other" bad 0; fi
  ORDER="$1 $other"
  set_slot "$1" good 3
}
# fail_slot SLOT: it does not start again, unless nothing else is left.
fail_slot() { set_slot "$1" bad 0; }

# with_slots FUNCTION [ARGUMENT]...: reads the file, calls the function, and writes what it has changed. The partition is
# mounted for this time only, and writable only for a change. The status is not 0 when it cannot be mounted or written.
with_slots() (
  boot=${boot_folder:-${boot_mount:-/run/v3d-boot}}
  if [ -z "${boot_folder:-}" ]; then
    mkdir -p -m 700 "$boot"
    if command -v flock >/dev/null; then exec 9>"$boot.lock" && flock 9; fi
    # Its folder v3d may have keys, which root alone may read.
    mount -t vfat -o ro,noatime,umask=0077 "$(readlink -f /dev/disk/by-partlabel/v3d-boot)" "$boot" || exit 1
    trap 'umount "$boot"' EXIT
  fi
  read_slots "$boot/grubenv"
  before="$ORDER $A_STATE $A_TRIES $B_STATE $B_TRIES"
  "$@"
  if [ "$before" != "$ORDER $A_STATE $A_TRIES $B_STATE $B_TRIES" ]; then
    [ -n "${boot_folder:-}" ] || mount -o remount,rw "$boot"
    write_slots "$boot/grubenv"
  fi
)
