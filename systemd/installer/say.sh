# shellcheck shell=bash
# How install.sh speaks, ends, and runs what may be interrupted. Knows nothing of dnb-edge.

stage=checking # building: a release is being made; switching: the machine is being changed; back: and back again; done
child='' told=no

# The log may lie on a full disk: that it cannot be written ends nothing.
step() { printf '== %s\n' "$*" | tee -a "$log" || true; }
note() { printf '   %s\n' "$*" | tee -a "$log" || true; }

# The user can mend it, and nothing was done.
bad() {
    told=yes
    printf 'dnb-edge: %s\n' "$*" >&2
    exit 2
}

# It did not work, and on_exit puts everything back.
failed() {
    told=yes
    printf 'dnb-edge: %s\n' "$*" | tee -a "$log" >&2 || true
    exit 1
}

# Takes the lock, opens the log, and makes sure that whatever ends this leaves nothing half done.
begin() {
    local lock=$root/run/lock/dnb-edge-install.lock
    if [ "$dry_run" = no ]; then
        mkdir -p "${lock%/*}"
        exec 9>"$lock"
        flock --nonblock 9 || failed "another install.sh is at work on this machine: wait until it is done"
        log=$root/var/log/dnb-edge-install.log
        mkdir -p "${log%/*}"
        printf '\n#### %s install.sh (%s)\n' "$(date -Is)" "$verb" >>"$log"
    fi
    trap 'on_exit $?' EXIT
    trap interrupted INT TERM HUP
}

interrupted() {
    printf '\n' >&2
    failed 'interrupted'
}

on_exit() {
    local code=$1
    trap '' INT TERM HUP
    # A failure in here must not end it.
    set +e
    if [ "$code" -ne 0 ] && [ "$told" = no ]; then
        printf 'dnb-edge: install.sh stopped at something that it does not foresee; the line above says at what\n' >&2
    fi
    if [ -n "$child" ]; then
        kill -- "-$child" 2>/dev/null
        wait "$child" 2>/dev/null
    fi
    case $stage in
        building)
            rm -rf "$release"
            rmdir "$opt/releases" "$opt" 2>/dev/null
            printf 'dnb-edge: nothing was changed; what was there before goes on\n' >&2
            ;;
        switching) switch_back ;;
    esac
    [ "$code" -eq 0 ] || [ "$stage" = 'done' ] || [ "$log" = /dev/null ] || [ "$code" -eq 2 ] ||
        printf 'dnb-edge: details: %s\n' "$log" >&2
    exit "$code"
}

# Runs a command with its output in the log alone. In the background and in a session of its own, so that Ctrl-C ends it whole.
quietly() {
    printf '%(%T)T $ %s\n' -1 "$*" 2>/dev/null >>"$log" || true
    setsid "$@" </dev/null >>"$log" 2>&1 &
    child=$!
    local code=0
    wait "$child" || code=$?
    child=''
    return "$code"
}

# The same where failing is no matter.
try() { quietly "$@" || true; }

# Why the last command failed, in words, by what it wrote into the log behind line $1.
reason_since() {
    local said
    said=$(tail -n "+$(($1 + 1))" "$log")
    if [ "$(free_mb)" -lt 10 ]; then said+='No space left on device'; fi
    case $said in
        *'No space left on device'* | *'Disk quota exceeded'*)
            printf 'the disk is full: make room (see df -h) and run it again' ;;
        *'Temporary failure'* | *'NewConnectionError'* | *'Name or service not known'* | *'Network is unreachable'* | \
            *'Could not resolve'* | *'ConnectTimeoutError'* | *'Connection timed out'* | *'Could not connect'* | *'ReadTimeoutError'*)
            printf 'there is no network: connect the box, or give it what it needs: --wheels DIR (see docs/install.md)' ;;
        *'No matching distribution found'*)
            printf '%s: it is not in %s' "$(grep -o 'No matching distribution found for .*' <<<"$said" | tail -1)" \
                "${wheels:-any package index that pip knows}" ;;
        *) printf 'its last words: %s' "$(grep -v '^[[:space:]]*$' <<<"$said" | tail -1)" ;;
    esac
}

log_lines() { wc -l <"$log"; }
