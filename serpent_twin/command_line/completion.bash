# Completes the commands of serpent-twin: verbs from this file, options from each verb's --help.

_serpent_twin() {
    local word="${COMP_WORDS[COMP_CWORD]}" verb="${COMP_WORDS[1]}" depth=1 choices=""
    case "$verb" in bus|log|mocap) depth=2 ;; esac
    if [ "$COMP_CWORD" -eq 1 ]; then
        choices="@VERBS@ --help --version"
    elif [ "$COMP_CWORD $verb" = "2 bus" ]; then
        choices="@BUS@"
    elif [ "$COMP_CWORD" -le "$depth" ] || [ "${word#-}" != "$word" ]; then
        choices="$(_serpent_twin_words "${COMP_WORDS[@]:1:depth}")"
    fi
    COMPREPLY=($(compgen -W "$choices" -- "$word"))
    [ "${#COMPREPLY[@]}" -gt 0 ] || COMPREPLY=($(compgen -f -- "$word"))
}

# Subcommands and options that a help lists: {a,b} of its first line, and each --option.
_serpent_twin_words() {
    serpent-twin "$@" --help 2>/dev/null |
        grep -oE -e '^usage: [^{]*\{[a-z,]+\}' -e '--[a-z][a-z-]+' |
        sed 's/^usage: .*{\(.*\)}/\1/' | tr ',' '\n' | sort -u
}

complete -o filenames -F _serpent_twin serpent-twin
