# shellcheck shell=bash
# What a release has in the rest of the machine: units, users, rules, limits; starting, the health check, and the way back.

# file in kit/systemd, the folder it goes to, its name there
managed_files() {
    cat <<'TABLE'
dnb-edge.service /etc/systemd/system dnb-edge.service
dnb-edge-web.service /etc/systemd/system dnb-edge-web.service
dnb-edge-foxglove.service /etc/systemd/system dnb-edge-foxglove.service
dnb-edge-fleet.service /etc/systemd/system dnb-edge-fleet.service
dnb-edge-vehicle.service /etc/systemd/system dnb-edge-vehicle.service
dnb-edge-take-home@.service /etc/systemd/system dnb-edge-take-home@.service
dnb-edge.sysusers.conf /usr/lib/sysusers.d dnb-edge.conf
dnb-edge.tmpfiles.conf /usr/lib/tmpfiles.d dnb-edge.conf
70-dnb-edge.rules /etc/udev/rules.d 70-dnb-edge.rules
dnb-edge-journald.conf /etc/systemd/journald.conf.d dnb-edge.conf
TABLE
    optional_files
}

# Only where they were asked for, now or before.
optional_files() {
    cat <<'TABLE'
99-dnb-edge-take-home.rules /etc/udev/rules.d 99-dnb-edge-take-home.rules
dnb-edge-watchdog.conf /etc/systemd/system.conf.d dnb-edge-watchdog.conf
TABLE
}

systemd_runs() { [ -d "$root/run/systemd/system" ]; }

# Units that are to run: all, or those that are enabled where somebody switched one off.
wanted_units() {
    local unit
    for unit in "${units[@]}"; do
        if systemctl is-enabled --quiet "$unit" 2>/dev/null; then printf '%s\n' "$unit"; fi
    done
}

switch_to() {
    local new=$1 raced=no enabled=()
    previous=$(current_release) before=''
    made_users=no
    if systemd_runs && [ "$(phase_now)" = racing ]; then raced=yes; fi
    if [ -d "$opt/venv" ] && [ ! -L "$opt/venv" ]; then keep_what_was; fi
    if [ -n "$previous$before" ]; then wanted_units | mapfile -t enabled; else enabled=("${units[@]}"); fi
    stage=switching
    if [ "$new" = "$previous" ] && files_are_as_in "$new"; then
        if ! systemd_runs || [ "$start" = no ] || systemctl is-active --quiet "${enabled[@]}" 2>/dev/null; then
            # Nothing is changed, so nothing is put back.
            stage=checking
            note "units and rules are as they should be"
            if systemd_runs && [ "$start" = yes ]; then check_health "$raced" "${enabled[@]}"; fi
            return
        fi
    fi
    step "putting ${new##*/} in place"
    stop_units
    put_files "$new"
    lead_to "$new"
    touch "$new/.complete"
    make_users
    tell_systemd
    if [ ${#enabled[@]} -eq 0 ]; then
        note "somebody has switched all units off: they stay so"
    else
        systemctl --quiet enable "${enabled[@]}" >>"$log" 2>&1 || failed "systemctl could not enable ${enabled[*]}"
    fi
    if systemd_runs && [ "$start" = yes ] && [ ${#enabled[@]} -gt 0 ]; then
        step "starting ${enabled[*]}"
        start_units "${enabled[@]}"
        check_health "$raced" "${enabled[@]}"
    fi
    stage='done'
}

# An installation older than releases: its files as its kit, its folder as a release, so that it can be gone back to.
keep_what_was() {
    local name folder as
    before=$(unused "$opt/releases/before-$(date -u +%Y%m%d-%H%M%S)")
    step "keeping the older installation in $opt/venv as ${before##*/}"
    mkdir -p "$opt/venv/kit/systemd"
    managed_files | while read -r name folder as; do
        if [ -f "$root$folder/$as" ]; then cp -p "$root$folder/$as" "$opt/venv/kit/systemd/$name"; fi
    done
    printf 'version=before\n' >"$opt/venv/.complete"
}

files_are_as_in() {
    local name folder as
    managed_files | while read -r name folder as; do
        if is_optional "$as" && [ ! -e "$root$folder/$as" ]; then continue; fi
        cmp -s "$1/kit/systemd/$name" "$root$folder/$as" || return 1
    done
    [ -L "$root/usr/local/bin/dnb-edge" ]
}

is_optional() { optional_files | grep -q " $1\$"; }

# Each file in one rename. What a release does not have, and another one had, goes.
put_files() {
    local name folder as from to
    managed_files | while read -r name folder as; do
        from=$1/kit/systemd/$name to=$root$folder/$as
        if is_optional "$as" && [ ! -e "$to" ]; then continue; fi
        if [ ! -f "$from" ]; then
            rm -f "$to"
        elif ! cmp -s "$from" "$to"; then
            note "$folder/$as"
            mkdir -p "${to%/*}"
            put_file "$from" "$to"
        fi
    done
    mkdir -p "$root/usr/local/bin"
    ln -sfn /opt/dnb-edge/venv/bin/dnb-edge "$root/usr/local/bin/dnb-edge"
}

put_file() {
    if install -m 644 "$1" "$2.new" 2>>"$log" && mv -T "$2.new" "$2" 2>>"$log"; then return; fi
    rm -rf "$2.new"
    # On the way back the rest still has to be done.
    if [ "$stage" = back ]; then
        printf 'dnb-edge: %s could not be put back\n' "$2" >&2
        return
    fi
    failed "$2 could not be written: is the disk full? (see df -h)"
}

make_users() {
    if ! grep -qs '^dnb-edge:' "$root/etc/passwd"; then made_users=yes; fi
    # An installation older than releases may have had neither.
    if [ -e "$root/usr/lib/sysusers.d/dnb-edge.conf" ]; then
        quietly systemd-sysusers ${root:+"--root=$root"} dnb-edge.conf || failed "the users dnb-edge, dnb-edge-web and dnb-edge-fleet were not made"
    fi
    if [ -e "$root/usr/lib/tmpfiles.d/dnb-edge.conf" ]; then
        # The start of the machine makes them, too: without /proc, where a card's contents are built, it is left to that.
        quietly systemd-tmpfiles ${root:+"--root=$root"} --create dnb-edge.conf || ! systemd_runs ||
            failed "/var/lib/dnb-edge was not made"
    fi
    # Its configuration is root's; the service's group reads it.
    mkdir -p "$root/etc/dnb-edge"
}

tell_systemd() {
    systemd_runs || return 0
    systemctl daemon-reload >>"$log" 2>&1 || failed "systemctl daemon-reload failed"
    try systemctl try-restart systemd-journald.service
    try udevadm control --reload
    try udevadm trigger --subsystem-match=video4linux --subsystem-match=tty
}

stop_units() {
    systemd_runs || return 0
    try systemctl stop "${units[@]}"
}

start_units() {
    local unit
    for unit in "$@"; do
        quietly systemctl restart "$unit" ||
            failed "$unit does not start: $(systemctl show -P Result "$unit" 2>/dev/null); journalctl -u $unit says why"
    done
    # Off unless somebody has enabled it; it would go on with the old release's programs.
    try systemctl try-restart dnb-edge-foxglove.service dnb-edge-fleet.service dnb-edge-vehicle.service
}

phase_now() { "$python" "$here/systemd/health_check.py" --phase "$root/run/dnb-edge/live.sock" 2>/dev/null || true; }

# Healthy: all units stay up, and the race says what it does: frames are raced, or why they cannot be yet. A box that raced
# before must race again.
check_health() {
    local raced=$1 said within=${DNB_EDGE_HEALTH_S:-90} words=() unit
    shift
    step "checking that it is healthy"
    if [ "$raced" = yes ]; then words=(--must-race); fi
    if [[ " $* " == *' dnb-edge '* ]]; then
        # Its words come through a file: in a substitution Ctrl-C would have to wait for it.
        quietly "$python" "$here/systemd/health_check.py" --within "$within" "${words[@]}" "$root/run/dnb-edge/live.sock" ||
            failed "it is not healthy: $(tail -n 1 "$log")"
        said=$(tail -n 1 "$log")
        note "$said"
    fi
    for unit in "$@"; do
        systemctl is-active --quiet "$unit" || failed "it is not healthy: $unit does not stay up; journalctl -u $unit says why"
    done
}

# The way back of whatever failed behind the first change to the machine.
switch_back() {
    stage=back
    if systemd_runs; then systemctl stop "${units[@]}" >>"$log" 2>&1; fi
    if [ -n "$before" ] && [ -d "$before" ]; then previous=$before; fi
    if [ -z "$previous" ] && [ -z "$before" ]; then
        take_away
        printf 'dnb-edge: everything was removed again\n' >&2
        return
    fi
    if [ -n "$previous" ]; then
        lead_to "$previous"
        # First the room, then the files: the disk may be full.
        if [ "$release" != "$previous" ]; then rm -rf "$release"; fi
        put_files "$previous"
    else
        # The older folder had not been moved yet.
        rm -rf "$release"
        put_files "$opt/venv"
        rm -rf "$opt/venv/kit" "$opt/venv/.complete"
    fi
    if systemd_runs; then
        systemctl daemon-reload >>"$log" 2>&1
        wanted_units | mapfile -t back
        systemctl start "${back[@]}" >>"$log" 2>&1
        systemctl try-restart dnb-edge-foxglove.service dnb-edge-fleet.service dnb-edge-vehicle.service >>"$log" 2>&1
    fi
    printf 'dnb-edge: rolled back: %s runs as before\n' "${previous:+${previous##*/}}" >&2
}

roll_back() {
    local to now
    now=$(current_release)
    to=$(releases_newest_first | grep -vxF "$now" | sed -n 1p) || true
    [ -n "$now" ] || failed "dnb-edge is not installed by install.sh here: there is nothing to go back to"
    [ -n "$to" ] || failed "there is no release before ${now##*/} to go back to"
    if [ "$dry_run" = yes ]; then
        note "would go back from ${now##*/} to ${to##*/}"
        return
    fi
    version=$(kept_note "$to" version) release=$now
    step "going back from ${now##*/} to ${to##*/}"
    switch_to "$to"
    say_done
}

uninstall() {
    if [ "$dry_run" = yes ]; then
        note "would stop and remove dnb-edge; with all recordings: $purge"
        return
    fi
    step "removing dnb-edge"
    take_away
    if [ "$purge" = yes ]; then
        step "removing its configuration, set-up, recordings and users"
        rm -rf "$root/etc/dnb-edge" "$root/var/lib/dnb-edge" "$root/var/cache/dnb-edge-web"
        remove_users
        step "done"
    else
        step "done; configuration, set-up and recordings are still in /etc/dnb-edge and /var/lib/dnb-edge (--uninstall --purge)"
    fi
}

# Everything that install.sh has put anywhere, but not what users have made.
take_away() {
    local name folder as
    if systemd_runs; then systemctl stop "${units[@]}" dnb-edge-foxglove.service dnb-edge-fleet.service dnb-edge-vehicle.service >>"$log" 2>&1 || true; fi
    systemctl --quiet disable "${units[@]}" dnb-edge-foxglove.service dnb-edge-fleet.service dnb-edge-vehicle.service >>"$log" 2>&1 || true
    managed_files | while read -r name folder as; do rm -f "$root$folder/$as" "$root$folder/$as.new"; done
    if [ "$(readlink "$root/usr/local/bin/dnb-edge")" = /opt/dnb-edge/venv/bin/dnb-edge ]; then
        rm -f "$root/usr/local/bin/dnb-edge"
    fi
    remove_extras
    rm -rf "$opt"
    rmdir --ignore-fail-on-non-empty "$root/etc/dnb-edge" "$root"/etc/systemd/{journald,system}.conf.d 2>/dev/null || true
    if systemd_runs; then
        systemctl daemon-reload >>"$log" 2>&1 || true
        systemctl reset-failed "${units[@]}" >>"$log" 2>&1 || true
        systemctl try-restart systemd-journald.service >>"$log" 2>&1 || true
        udevadm control --reload >>"$log" 2>&1 || true
    fi
    if [ "${made_users:-no}" = yes ]; then
        rmdir "$root"/var/lib/dnb-edge/{runs,setup,last-good,fleet} "$root/var/lib/dnb-edge" 2>/dev/null || true
        remove_users
    fi
}

remove_users() {
    local name
    for name in dnb-edge-fleet dnb-edge-web dnb-edge; do
        if grep -qs "^$name:" "$root/etc/passwd"; then userdel ${root:+--root "$root"} "$name" >>"$log" 2>&1 || true; fi
    done
    if grep -qs '^dnb-edge:' "$root/etc/group"; then groupdel ${root:+--root "$root"} dnb-edge >>"$log" 2>&1 || true; fi
}

say_plan() {
    local missing=() name folder as
    missing_debian_packages | mapfile -t missing
    if [ ${#missing[@]} -gt 0 ]; then note "would install Debian packages: ${missing[*]}"; fi
    if [ -n "$built" ]; then
        note "$version is installed already, from the same sources"
    elif [ -n "$base" ]; then
        note "would build $release with the Python packages of ${base##*/}"
    else
        note "would build $release with all Python packages${wheels:+, from $wheels}"
    fi
    managed_files | while read -r name folder as; do
        if is_optional "$as" && [ ! -e "$root$folder/$as" ]; then continue; fi
        cmp -s "$here/systemd/$name" "$root$folder/$as" || note "would write $folder/$as"
    done
    note "would lead /opt/dnb-edge/venv there, start ${units[*]}, and go back where that is not healthy"
    say_planned_extras
}
