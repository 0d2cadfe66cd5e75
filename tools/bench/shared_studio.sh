# Sourced by the scripts here that run a simulated studio, also one that several nodes reconstruct.
# shellcheck shell=bash

# wait_for TEXT COMMAND...: until what the command prints has the text, two minutes at most. fail() is the caller's.
wait_for() {
  local text=$1 i
  shift
  for ((i = 0; i < 1200; ++i)); do
    # grep -q would end before the command has said all, which fails it.
    if [ "$("$@" 2>/dev/null | grep -c "$text")" != 0 ]; then return; fi
    sleep 0.1
  done
  fail "never heard '$text'"
}

# with_frame_groups N: a studio file that passes through gets so many.
with_frame_groups() {
  local list="" i
  for ((i = 1; i <= $1; ++i)); do
    list+="${list:+, }\"udpm://239.255.77.$i:$((7700 + i))?ttl=1\\&recv_buf_size=16777216\""
  done
  sed -e "s|^\[network\]|[network]\nframe_groups = [$list]|"
}

# write_shared_studio FOLDER NODES: of FOLDER/plain.toml, as v3d-sim wrote it. FOLDER/studio.toml is the operator's and the
# capture node's; each node of the reconstruction has one in FOLDER/recon0N, with takes of its own; key, wire, calibration
# and background are those of FOLDER.
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
