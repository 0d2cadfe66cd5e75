# Functions of the stories; sourced in the machine.
set -euo pipefail
trap 'echo "failed at line $LINENO: $BASH_COMMAND"' ERR
# A new PC needs the studio key before anything else.
[ -e /etc/v3d/studio.key ] || v3dctl key new

# until_true SECONDS COMMAND...: waits for a condition.
until_true() {
  local deadline=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    if [ "$SECONDS" -ge "$deadline" ]; then
      echo "timeout, expected: $*"
      "$@" || true
      return 1
    fi
    sleep 0.2
  done
}

# equal NAME EXPECTED ACTUAL: fails when the values differ.
equal() {
  if [ "$2" = "$3" ]; then
    echo "$1: $3"
  else
    echo "$1: $3, expected $2"
    return 1
  fi
}

# simulated_studio CAMERAS RATE: starts simulated GigE Vision cameras and a trigger cable. Writes the studio to /etc/v3d and
# enables the nodes cap01 and recon01 at boot.
simulated_studio() {
  local cameras=$1 rate=$2 sim=/var/lib/v3d/sim
  for i in $(seq 11 $((10 + cameras))); do ip address add "127.0.0.$i/32" dev lo; done
  install -d -o v3d -g v3d "$sim"
  mkfifo /run/sim-ready
  setpriv --reuid v3d --regid v3d --init-groups v3d-sim studio "$sim" --cameras "$cameras" --rate "$rate" \
    --size 160x120 --loop-frames 5 --empty-pulses 8 --voxel 50mm >/run/sim-ready 2>/run/sim.log &
  local ready
  read -r ready </run/sim-ready || true
  rm /run/sim-ready
  [ "$ready" = ready ] || { cat /run/sim.log; return 1; }
  [ "$LAB_BOOT" -eq 1 ] || return 0
  sed "s#^takes = .*#takes = \"/var/lib/v3d/takes\"#; s#^background = .*#background = \"/var/lib/v3d/background\"#
    s#^calib = .*#calib = \"/etc/v3d/calib.toml\"#; s#^wire = .*#wire = \"$sim/trigger.sock\"#
    /^key = /d" \
    "$sim/studio.toml" >/etc/v3d/studio.toml
  cp "$sim/calib.toml" /etc/v3d/
  systemctl -q enable v3d-studio.target v3d-captured@cap01.service v3d-recond@recon01.service
}

# gpio_lines: makes a GPIO chip with the lines TRIGGER and SENSE. Sets $gpio to its folder in sysfs.
gpio_lines() {
  local lab=/sys/kernel/config/gpio-sim/lab
  modprobe -a irq_sim gpio-sim
  mountpoint -q /sys/kernel/config || mount -t configfs none /sys/kernel/config
  mkdir -p "$lab"/bank0/line0 "$lab"/bank0/line1
  echo 8 >"$lab/bank0/num_lines"
  echo TRIGGER >"$lab/bank0/line0/name"
  echo SENSE >"$lab/bank0/line1/name"
  echo 1 >"$lab/live"
  gpio=/sys/devices/platform/$(cat "$lab/dev_name")/$(cat "$lab/bank0/chip_name")
  udevadm settle
}

# usb_generator DIALECT [FAULT]: starts and plugs in a signal generator on USB, whose output is SENSE of gpio_lines. Its
# output goes to /run/generator.txt. end_usb_generator ends it.
usb_generator() {
  local gadget=/sys/kernel/config/usb_gadget/lab
  if [ ! -d "$gadget" ]; then
    modprobe -a dummy_hcd usb_f_fs usbtmc
    mkdir -p "$gadget/strings/0x409" "$gadget/configs/c.1" "$gadget/functions/ffs.generator" /dev/ffs
    echo 0x0957 >"$gadget/idVendor"
    echo 0x2c07 >"$gadget/idProduct"
    echo LAB0001 >"$gadget/strings/0x409/serialnumber"
    ln -s "$gadget/functions/ffs.generator" "$gadget/configs/c.1/"
    mount -t functionfs generator /dev/ffs
    cp /lab/programs/usb-generator /run/
  fi
  : >/run/generator.txt
  /run/usb-generator /dev/ffs "$gpio/sim_gpio1/pull" "$@" >/run/generator.txt &
  generator=$!
  until_true 10 grep -q ready /run/generator.txt
  plug_in
}

# plug_in, unplug: connect and disconnect the usb_generator.
plug_in() {
  ls /sys/class/udc | head -n 1 >/sys/kernel/config/usb_gadget/lab/UDC
  until_true 10 sh -c 'lsusb -d 0957:2c07'
  udevadm settle
}
unplug() { echo >/sys/kernel/config/usb_gadget/lab/UDC; }

# end_usb_generator: ends it and sets $made to the number of pulses that it has made.
end_usb_generator() {
  kill "$generator"
  wait "$generator" || true
  made=$(tail -n 1 /run/generator.txt)
}

# trigger_studio TRIGGER: a studio with a trigger and one camera that does not exist. TRIGGER: the fields of [trigger] and
# further tables. trigger_take records takes.
trigger_studio() {
  cat >/etc/v3d/studio.toml <<X
name = "lab"
[[node]]
name = "cap01"
[[camera]]
name = "cam01"
node = "cap01"
address = "127.0.0.99"
[storage]
takes = "/var/lib/v3d/takes"
background = "/var/lib/v3d/background"
calib = "/etc/v3d/calib.toml"
[space]
min = [-1, -1, 0]
max = [1, 1, 2]
[reconstruction]
node = "cap01"
[trigger]
node = "cap01"
$1
X
  cat >/etc/v3d/calib.toml <<X
[cam_0]
name = "cam01"
size = [640, 480]
matrix = [[600, 0, 320], [0, 600, 240], [0, 0, 1]]
distortions = []
rotation = [0, 0, 0]
translation = [0, 0, 0]
X
  systemctl start v3d-captured@cap01
  until_true 60 v3dctl status
}

# wire_lines: connects the lines of gpio_lines, by the process $wire, which writes what it saw to /run/wire.txt.
wire_lines() {
  [ -e /run/gpio-wire ] || cp /lab/programs/gpio-wire /run/
  /run/gpio-wire "$gpio/sim_gpio0/value" "$gpio/sim_gpio1/pull" >/run/wire.txt &
  wire=$!
}

# vivid_cameras N: loads the vivid driver with N webcams, /dev/video0 and so on.
vivid_cameras() {
  local types inputs sources
  types=$(for _ in $(seq "$1"); do echo 0x1; done | paste -sd,)
  inputs=${types//0x1/1} sources=${types//0x1/0x0}
  modprobe vivid n_devs="$1" node_types="$types" num_inputs="$inputs" input_types="$sources"
  udevadm settle
}

# prefer_cameras: gives the threads of vivid that fill images real-time priority: a camera does not wait for the processor of its
# PC. vivid omits an image when its thread runs half a period late. A camera that starts again has a new thread.
prefer_cameras() {
  local thread
  for thread in $(pgrep '^vivid-.*-vid-c'); do chrt --fifo --pid 40 "$thread"; done
}

# v4l2_studio RATE FORMAT...: a studio with free-running V4L2 cameras, one for each pixel format, and a trigger on the lines of
# gpio_lines.
v4l2_studio() {
  local rate=$1 i=0 format
  shift
  {
    printf 'name = "lab"\n[[node]]\nname = "cap01"\n'
    printf '[camera_defaults]\nnode = "cap01"\nkind = "v4l2"\nwidth = 320\nheight = 180\n'
    for format in "$@"; do
      printf '[[camera]]\nname = "cam%02d"\naddress = "/dev/video%d"\npixel_format = "%s"\n' $((i + 1)) "$i" "$format"
      i=$((i + 1))
    done
    printf '[trigger]\nnode = "cap01"\nkind = "gpio"\nchip = "gpiochip0"\nline = "TRIGGER"\nrate_hz = %d\n' "$rate"
    printf 'pulse_width_us = 4000\n[trigger.sense]\nchip = "gpiochip0"\nline = "SENSE"\n'
    printf '[storage]\ntakes = "/var/lib/v3d/takes"\nbackground = "/var/lib/v3d/background"\n'
    printf 'calib = "/etc/v3d/calib.toml"\n[space]\nmin = [-1, -1, 0]\nmax = [1, 1, 2]\n'
    printf '[reconstruction]\nnode = "cap01"\n'
  } >/etc/v3d/studio.toml
  for i in $(seq $#); do
    printf '[cam_%d]\nname = "cam%02d"\nsize = [320, 180]\nmatrix = [[300, 0, 160], [0, 300, 90], [0, 0, 1]]\n' "$i" "$i"
    printf 'distortions = []\nrotation = [0, 0, 0]\ntranslation = [%d, 0, 0]\n' "$i"
  done >/etc/v3d/calib.toml
}

# losses TAKE "LIST...": lengths of lists of the ledger (missing, duplicate, suspect), each the sum of all cameras.
losses() {
  local list
  for list in $2; do ledger "$1" "[.cameras[].$list | length] | add"; done | paste -sd' '
}

# trigger_take NAME PULSES: like take, without cameras.
trigger_take() {
  v3dctl arm "$1" --pulses "$2" --allow-missing cam01
  v3dctl start --wait || [ $? -eq 3 ]
  v3dctl stop --json >/run/stop.json || [ $? -eq 3 ]
  jq -r .verdict /run/stop.json
}

# take NAME PULSES: arms, records all pulses and stops. Writes the reply of v3dctl stop to /run/stop.json.
take() {
  v3dctl arm "$1" --pulses "$2"
  prefer_cameras
  v3dctl start --wait
  v3dctl stop --json >/run/stop.json || { cat /run/stop.json; return 1; }
  jq -r .verdict /run/stop.json
}

# reboot_machine: ends this run of the story and reboots; the story runs again after the boot.
reboot_machine() {
  touch /run/lab-reboots
  sync
  systemctl --no-block start reboot.target
  exit 0
}

# studio_up: starts the daemons, waits until they reply, and learns the background.
studio_up() {
  systemctl start v3d-studio.target
  until_true 60 v3dctl status
  v3dctl background
}

# ledger TAKE FILTER: applies a jq filter to the JSON of v3dctl verify. An incomplete take is not an error here.
ledger() { { v3dctl verify "/var/lib/v3d/takes/$1" --json || [ $? -eq 3 ]; } | jq -r "$2"; }

# recording TAKE PULSES: starts a take without end and waits until PULSES pulses are sensed.
recording() {
  v3dctl arm "$1"
  v3dctl start
  until_true 60 sh -c "v3dctl health --json | jq -e '[.. | .pulses_sensed? // empty | numbers] | max >= $2'"
}
