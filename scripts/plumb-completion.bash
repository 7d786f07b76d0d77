# Completion of plumb and its processes in bash (zsh: autoload bashcompinit && bashcompinit first):
#
#   source scripts/plumb-completion.bash
#
# Commands, options and the values of those that have a list are what --help of the program says, so that they are always its own.

_plumb_words() {  # what --help of a command says: commands, and options
  "$@" --help 2>/dev/null | awk '
    /^[A-Z][a-z]+:$/ { section = $1; next }
    section == "Subcommands:" && /^  [^ ]/ { print $1 }
    section == "Options:" && /^  -/ { n = split($1, names, ","); for (i = 1; i <= n; ++i) if (names[i] ~ /^--/) print names[i] }'
}

_plumb_values() {  # of an option: {one,other} in its line
  local option=$1
  shift
  "$@" --help 2>/dev/null | sed -n "s/^  ${option}[ ,].*{\([^}]*\)}.*/\1/p" | tr , '\n'
}

_plumb() {
  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} command=("${COMP_WORDS[0]}") word
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    [[ $word == -* ]] && break
    _plumb_words "${command[@]}" | grep -qx -- "$word" && command+=("$word")
  done
  COMPREPLY=()
  if [[ $before == --* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(_plumb_values "$before" "${command[@]}")" -- "$current")
  fi
  [[ ${#COMPREPLY[@]} -gt 0 ]] || mapfile -t COMPREPLY < <(compgen -W "$(_plumb_words "${command[@]}")" -- "$current")
  [[ $current == -* || ${#COMPREPLY[@]} -gt 0 ]] || mapfile -t COMPREPLY < <(compgen -f -- "$current")
}

complete -o filenames -F _plumb plumb plumb-{driver,estimator,controller,calibrator,trainer,robot,dashboard,chaos} \
  plumb-{figure-1,figure-2,figure-3,learning-curves,reality-gap,sample-efficiency,step-vs-trajectory}
