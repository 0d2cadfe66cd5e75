# Sourced by programs that read Debian packages of another architecture than this PC's.
# apt_for ARCH DIR: sets the array apt to an apt-get of this architecture. For a foreign one, it has its lists in DIR, after an update.
apt_for() {
  apt=(apt-get)
  [ "$1" != "$(dpkg --print-architecture)" ] || return 0
  mkdir -p "$2/lists" "$2/cache"
  apt+=(-o "APT::Architecture=$1" -o "APT::Architectures=$1" -o "Dir::State::Lists=$2/lists" -o "Dir::Cache=$2/cache"
    -o Dir::State::Status=/dev/null)
}
