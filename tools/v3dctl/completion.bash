# Bash completion of v3dctl: reads commands and options from the help text of the program.

_v3dctl_words_of_help() {
  # Prints the commands and every --option of the help text of "$@".
  "$@" --help 2>/dev/null | awk '
    /^Subcommands:/ { in_commands = 1; next }
    /^[A-Z]/ { in_commands = 0 }
    in_commands && /^  [a-z]/ { print $1 }
    { line = $0
      while (match(line, /--[a-z][a-z-]*/)) {
        if ($0 ~ /^  +-/ && line == $0) print substr(line, RSTART, RLENGTH)
        line = substr(line, RSTART + RLENGTH)
      } }'
}

_v3dctl() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]}
  local program=${COMP_WORDS[0]} command="" under="" i
  for ((i = 1; i < COMP_CWORD; i++)); do
    case ${COMP_WORDS[i]} in
      --studio) ((i++)) ;;
      -*) ;;
      *) if [[ -z $command ]]; then command=${COMP_WORDS[i]}; else under=${COMP_WORDS[i]}; fi
         [[ $command =~ ^(takes|calibrate|key|node)$ && -z $under ]] || break ;;
    esac
  done
  COMPREPLY=()
  case $previous in
    --format) COMPREPLY=($(compgen -W "ply obj glb glb-sequence usda volume colmap nerfstudio flac" -- "$current")); return ;;
    --compress) COMPREPLY=($(compgen -W "none draco meshopt" -- "$current")); return ;;
    --surface) COMPREPLY=($(compgen -W "automatic meshes tracked" -- "$current")); return ;;
    --role) COMPREPLY=($(compgen -W "operator capture reconstruction viewer" -- "$current")); return ;;
    --mount) COMPREPLY=($(compgen -W "wall rail ceiling" -- "$current")); return ;;
    --quality) COMPREPLY=($(compgen -W "live high" -- "$current")); return ;;
  esac
  if [[ -z $command ]]; then
    COMPREPLY=($(compgen -W "$(_v3dctl_words_of_help "$program")" -- "$current"))
  elif [[ $command =~ ^(takes|calibrate|key|node)$ && -z $under && $current != -* ]]; then
    COMPREPLY=($(compgen -W "$(_v3dctl_words_of_help "$program" "$command")" -- "$current"
      [[ $command =~ ^(calibrate|key|node)$ ]] || compgen -f -- "$current"))
  elif [[ $current == -* ]]; then
    COMPREPLY=($(compgen -W "$(_v3dctl_words_of_help "$program" "$command" $under)" -- "$current"))
  else
    COMPREPLY=($(compgen -f -- "${current#*=}"))
  fi
}

complete -o filenames -F _v3dctl v3dctl
