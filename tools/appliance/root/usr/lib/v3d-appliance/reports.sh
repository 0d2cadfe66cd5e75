# shellcheck shell=bash
# Functions that show v3dctl the report on an update.
#
# The folder, /var/lib/v3d/updates, may hold anything that the group v3d puts there, links, pipes and folders too: every file is
# moved from and to the folder of the bundle, which root alone can write.
folder=${folder:-/data/v3d/updates} # /var/lib/v3d/updates, on the mount of /data: a move copies nothing
bundle=${bundle:-/data/appliance/bundle.raucb}
own=${bundle%/*}

# set_aside FILE: renames a folder in the place of this file. Nobody knows what is in it, so it is not removed.
set_aside() {
  [ ! -d "$1" ] || [ -L "$1" ] || mv -T --backup=numbered "$1" "$1.folder"
}
# publish: shows the report to v3dctl.
publish() {
  cp "$own/result.json" "$own/result.shown"
  sync "$own/result.shown"
  set_aside "$folder/result.json"
  mv -T "$own/result.shown" "$folder/result.json"
  sync "$folder"
}
# write_report: the report is what stdin has. It is on the disk before v3dctl can read it.
write_report() {
  cat >"$own/result.new"
  sync "$own/result.new"
  mv -T "$own/result.new" "$own/result.json"
  sync "$own"
  publish
}
