# shellcheck shell=sh
# Functions that open the root file system of a slot with dm-verity, for the sh of busybox.
#
# A slot holds a squashfs image, a block of 4,096 bytes with text, and the hash tree (tools/appliance/make-slot). The text
# has the hash of the tree's root: "root-hash HEX". It lies in the slot itself, so an update of the slot is one image.

# squashfs_size DEVICE: bytes of its squashfs image, padded to blocks; 0 where there is none.
squashfs_size() {
  if [ "$(dd if="$1" bs=4 count=1 2>/dev/null | tr -d '\0')" != hsqs ]; then echo 0 && return; fi
  size=$(dd if="$1" bs=8 skip=5 count=1 2>/dev/null | od -An -t u8)
  echo $(((size + 4095) / 4096 * 4096))
}

# slot_text DEVICE KEY: value of a line of the text, or nothing.
slot_text() {
  at=$(squashfs_size "$1")
  [ "$at" -gt 0 ] || return 0
  dd if="$1" bs=4096 skip=$((at / 4096)) count=1 2>/dev/null | tr -d '\0' | sed -n "s/^$2 \([0-9A-Za-z.+~:_-]*\)\$/\1/p"
}

# open_verity DEVICE NAME: makes /dev/mapper/NAME, which returns an error instead of a block that was changed.
open_verity() {
  root_hash=$(slot_text "$1" root-hash)
  [ "$root_hash" ] || return 1
  veritysetup open "$1" "$2" "$1" "$root_hash" --hash-offset=$(($(squashfs_size "$1") + 4096))
}
