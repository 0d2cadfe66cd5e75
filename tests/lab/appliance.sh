# Functions of run-appliance and of the stories of the appliance; they run on the host.
# Sourced with $build, $root, $here and $arch. The host and the PC share a network of their own, which reaches nothing else.

# --- the PC

pc=
pc_address=10.77.0.2
# switch_on NAME OPTION...: starts the PC and sets $pc to its process ID. Its console goes to NAME.txt.
# Without erms the kernel clears a page by 512 writes instead of 4096. QEMU needs up to 20 s for so many writes to a page whose
# instructions it has translated, and the kernel reports a stall.
# A PC of arm64 has UEFI: $firmware is empty, or .ms for Secure Boot with the keys of Microsoft.
firmware=
switch_on() {
  local name=$1 machine=(qemu-system-x86_64 -machine q35 -cpu "max,avx2=off,erms=off,fsrm=off") aavmf=/usr/share/AAVMF/AAVMF
  shift
  if [ "$arch" = arm64 ]; then
    cp "${aavmf}_VARS$firmware.fd" vars
    machine=(qemu-system-aarch64 -machine virt -cpu cortex-a72
      -drive "if=pflash,format=raw,readonly=on,file=${aavmf}_CODE$firmware.fd" -drive if=pflash,format=raw,file=vars)
  fi
  "${machine[@]}" -accel tcg,thread=multi -smp 2 -m 1536 -nodefaults -no-user-config -display none -serial "file:$name.txt" -drive file=disk,format=raw,if=none,id=disk -device virtio-blk-pci,drive=disk \
    -netdev tap,id=net,ifname=lab0,script=no,downscript=no -device virtio-net-pci,netdev=net "$@" &
  pc=$!
}
cut_the_power() {
  kill -KILL "$pc" 2>/dev/null || true
  wait "$pc" 2>/dev/null || true
}
# lab_network: the host's end of the cable. The process is in a network namespace of its own.
lab_network() {
  ip link set lo up
  ip tuntap add lab0 mode tap
  ip address add 10.77.0.1/24 dev lab0
  ip link set lab0 up
  ip route add 224.0.0.0/4 dev lab0
}

# on_pc COMMAND..., on_pc <SCRIPT: runs a command or a script over ssh.
on_pc() {
  ssh -q -F "$work/ssh_config" -i "$work/${key_of:-${login:-root}}" "${login:-root}@cap01" "${@:-bash -es}"
}
# until_true SECONDS COMMAND...: waits for a condition.
until_true() {
  local deadline=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    [ "$SECONDS" -lt "$deadline" ] || { echo "timeout, expected: $*"; "$@"; return 1; }
    sleep 0.5
  done
}
# equal NAME EXPECTED ACTUAL: fails when the values differ.
equal() {
  echo "$1: $3"
  [ "$2" = "$3" ] || { echo "expected $2" && return 1; }
}
# boots NAME OPTION...: starts the PC and waits until the studio runs on it.
boots() {
  local start=$SECONDS
  switch_on "$@"
  until_true 600 on_pc systemctl is-active v3d-studio.target v3d-captured@cap01
  echo "$1: the studio runs after $((SECONDS - start)) s"
}
# slots: what the PC knows about its slots: the one that runs, and the variables of the boot menu.
slots() {
  on_pc <<'PC'
. /usr/lib/v3d-appliance/slots.sh
show() { echo "runs $(booted_slot), next $(primary_slot), A $A_STATE, B $B_STATE"; }
with_slots show
PC
}
version_of_pc() { on_pc 'sed -n s/^IMAGE_VERSION=//p /etc/os-release'; }
# a_simulated_studio: starts cameras, a trigger cable and a reconstruction node in the PC; takes can be recorded.
a_simulated_studio() {
  on_pc <<'PC'
for i in 11 12; do ip address add "127.0.0.$i/32" dev lo; done
install -d -o v3d -g v3d /run/sim
mkfifo /run/ready
setpriv --reuid v3d --regid v3d --init-groups v3d-sim studio /run/sim --cameras 2 --rate 5 --size 160x120 \
  --loop-frames 5 --empty-pulses 8 --voxel 50mm >/run/ready 2>/run/sim.log &
read -r ready </run/ready
systemctl -q enable --now v3d-recond@recon01
until v3dctl status >/dev/null; do sleep 0.5; done
PC
}
