# Functions for the scripts in this folder that run a simulated studio, also with several reconstruction nodes.
# shellcheck shell=bash

# wait_for TEXT COMMAND...: repeats the command until its output contains the text, for at most two minutes. The caller
# defines fail().
wait_for() {
  local text=$1 i
  shift
  for ((i = 0; i < 1200; ++i)); do
    # grep -q would end before the command has written everything, and the command would fail.
    if [ "$("$@" 2>/dev/null | grep -c "$text")" != 0 ]; then return; fi
    sleep 0.1
  done
  fail "no '$text' in the output of '$*' within two minutes"
}

# with_frame_groups N: filter that adds N frame groups to a studio file.
with_frame_groups() {
  local list="" i
  for ((i = 1; i <= $1; ++i)); do
    list+="${list:+, }\"udpm://239.255.77.$i:$((7700 + i))?ttl=1\\&recv_buf_size=16777216\""
  done
  sed -e "s|^\[network\]|[network]\nframe_groups = [$list]|"
}

# write_shared_studio FOLDER NODES: writes studio files from FOLDER/plain.toml, the file of v3d-sim. FOLDER/studio.toml is for
# the operator and the capture node. Each reconstruction node has a file in FOLDER/recon0N with its own takes; key, trigger,
# calibration and background are those of FOLDER.
write_shared_studio() {
  local folder=$1 names="" tables="" i
  for ((i = 1; i <= $2; ++i)); do
    names+="${names:+, }\"recon0$i\""
    tables+="${tables:+\\n[[node]]\\n}name = \"recon0$i\""
  done
  sed -e "s/^name = \"recon01\"/$tables/" -e "s/^node = \"recon01\"/nodes = [$names]/" \
    "$folder/plain.toml" >"$folder/studio.toml"
  for ((i = 1; i <= $2; ++i)); do
    mkdir -p "$folder/recon0$i"
    sed -e "s|\"trigger.sock\"|\"$folder/trigger.sock\"|" -e "s|\"studio.key\"|\"$folder/studio.key\"|" \
      -e "s|\"calib.toml\"|\"$folder/calib.toml\"|" -e "s|\"background\"|\"$folder/background\"|" \
      "$folder/studio.toml" >"$folder/recon0$i/studio.toml"
  done
}
