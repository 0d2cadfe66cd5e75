# shellcheck shell=sh
# Functions of the initial RAM disk's script (/etc/initramfs-tools/scripts/local-bottom/v3d), for the sh of busybox.
# Callers set: rootmnt, where the root is mounted; data, where the data partition is mounted.

# partition NAME: its device.
partition() { readlink -f "/dev/disk/by-partlabel/$1"; }

# id_of FILE: number of the user or group v3d of the root; FILE is passwd or group.
id_of() { sed -n 's/^v3d:[^:]*:\([0-9]*\):.*/\1/p' "$rootmnt/etc/$1"; }

# mount_data: repairs and mounts the data partition; without it, memory, so that somebody can log in and look ($in_memory). In
# memory the folder of takes is read-only and has no takes: the capture daemon reports it and refuses to arm. A take in memory would
# be lost.
mount_data() {
  in_memory=''
  # It replays the journal, and checks all only when the file system has an error. What it cannot repair by itself stays.
  e2fsck -p "$(partition v3d-data)" || true
  mount -t ext4 -o rw,noatime "$(partition v3d-data)" "$data" && return 0
  echo "v3d: the data partition cannot be mounted: nothing can be recorded, and no change stays" >&2
  in_memory=yes
  mount -t tmpfs tmpfs "$data"
  mkdir "$data/v3d"
  user=$(id_of passwd) group=$(id_of group)
  mount -t tmpfs -o "ro,mode=0775,uid=${user:-0},gid=${group:-0}" tmpfs "$data/v3d"
}

# set_system_aside: renames the folder of this PC's changes to the first free name of system.before, system.before2, ... Each of them
# may have the only copy of a key.
set_system_aside() {
  number=''
  while [ -e "$data/system.before$number" ]; do number=$((${number:-1} + 1)); done
  mv "$data/system" "$data/system.before$number"
}

# layer NAME: mounts the changes of /NAME over it.
layer() {
  changes=$data/system/$1
  mkdir -p "$changes/upper" "$changes/work"
  mount -t overlay -o "lowerdir=$rootmnt/$1,upperdir=$changes/upper,workdir=$changes/work" overlay "$rootmnt/$1"
}

hash_of() { sha256sum <"$1" | cut -d ' ' -f 1; }

# install_setting FILE MODE DESTINATION: replaces the destination in one step. Other systems end their lines otherwise.
install_setting() {
  mkdir -p "${3%/*}"
  : >"$3.new" && chmod "$2" "$3.new" && tr -d '\r' <"$1" >>"$3.new" && mv "$3.new" "$3"
}

# source_of NAME: the file of a setting, or nothing. What a stick has set (take-setup) precedes the folder of V3D-BOOT; without the
# data partition, what the last good start used (keep-settings).
source_of() {
  for folder in "$first" "$settings"; do
    if [ -f "$folder/$1" ]; then echo "$folder/$1" && return; fi
  done
}

# setting NAME MODE DESTINATION REMOVAL: copies the setting NAME to the destination when it changed since it was copied; so it
# does not undo what changed on this PC, such as a new key. $records/NAME has the hashes of both files. REMOVAL says what happens with the copy when NAME is gone: it "stays"; it is removed "unless-changed" on this PC; it is
# removed "always".
setting() {
  from='' installed=''
  if [ -f "$records/$1" ]; then read -r from installed <"$records/$1"; fi
  source=$(source_of "$1")
  if [ "$source" ]; then
    hash=$(hash_of "$source")
    [ "$hash" ] && [ "$hash" != "$from" ] || return 0
    install_setting "$source" "$2" "$3" || return 0
    mkdir -p "$records"
    echo "$hash $(hash_of "$3")" >"$records/$1.new" && mv "$records/$1.new" "$records/$1"
  elif [ "$from" ] && [ "$4" != stays ] && [ -d "$settings" ]; then
    if [ "$4" = always ] || [ "$(hash_of "$3" 2>/dev/null)" = "$installed" ]; then rm -f "$3"; fi
    rm -f "$records/$1"
  fi
}

# key NAME: a secret that the group v3d may read.
key() {
  setting "$1" 640 "$rootmnt/etc/v3d/$1" unless-changed
  [ ! -f "$rootmnt/etc/v3d/$1" ] || chown "0:$(id_of group)" "$rootmnt/etc/v3d/$1"
}

# time_sources: tells chrony the servers of the setting time_servers, a name or an address on each line; without any, Debian's.
time_sources() {
  list=$rootmnt/etc/v3d/time_servers
  sources=$(sed -n 's/^[[:space:]]*\([0-9A-Za-z][0-9A-Za-z.:-]*\)[[:space:]]*$/server \1 iburst/p' "$list" 2>/dev/null || true)
  mkdir -p "$rootmnt/etc/chrony/sources.d"
  echo "${sources:-pool 2.debian.pool.ntp.org iburst}" >"$rootmnt/etc/chrony/sources.d/v3d.sources"
}

# boot_settings FOLDER: copies the settings of a stick, and those in the folder of the partition V3D-BOOT, into /etc. Without
# the folder, nothing is removed.
boot_settings() {
  settings=$1 records=$data/system/settings first=$data/setup/current
  [ -z "${in_memory:-}" ] || first=$settings/rescue
  setting hostname 644 "$rootmnt/etc/hostname" stays
  for name in studio.toml calib.toml members.toml role time_servers; do
    setting "$name" 644 "$rootmnt/etc/v3d/$name" unless-changed
  done
  key studio.key
  key signing.key
  # Always: whoever removes the file here revokes these logins.
  setting authorized_keys 644 "$rootmnt/etc/ssh/authorized_keys.d/crew" always
  setting root_authorized_keys 644 "$rootmnt/etc/ssh/authorized_keys.d/root" always
  for folder in "$first" "$settings" "$records"; do
    for file in "$folder"/*.network "$folder"/*.link; do
      setting "${file##*/}" 644 "$rootmnt/etc/systemd/network/${file##*/}" unless-changed
    done
  done
  time_sources
  sync # the records must not be older than a key that changes on this PC later
}
