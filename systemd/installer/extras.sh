# shellcheck shell=bash
# What is only done where it is asked for: sticks, the hardware watchdog, a Wi-Fi of its own, a read-only root.

access_point_file=$root/etc/NetworkManager/system-connections/dnb-edge-ap.nmconnection
overlay_file=$root/etc/overlayroot.local.conf

# Before anything is done.
check_extras() {
    if [ "$watchdog" = yes ] && [ ! -e "$root/dev/watchdog" ]; then
        bad "--watchdog: this machine has no /dev/watchdog (on a Raspberry Pi: dtparam=watchdog=on in config.txt)"
    fi
    if [ "$access_point" = yes ]; then
        command -v nmcli >/dev/null || bad "--access-point: it needs NetworkManager: apt install network-manager"
        [ ${#ssid} -le 32 ] || bad "--access-point=$ssid: a Wi-Fi's name has 32 letters at most"
        local password=${DNB_EDGE_AP_PASSWORD:-}
        if [ -n "$password" ] && { [ ${#password} -lt 8 ] || [ ${#password} -gt 63 ]; }; then
            bad "DNB_EDGE_AP_PASSWORD: a Wi-Fi's password has 8 to 63 letters"
        fi
        case $ssid$password in *[!\ -~]* | *\\*) bad "--access-point: name and password may have plain letters only" ;; esac
    fi
    if [ "$read_only_root" = yes ]; then
        mountpoint -q "$root/var/lib/dnb-edge" ||
            bad "--read-only-root: recordings would be gone with each start: mount a partition of its own on /var/lib/dnb-edge" \
                "first (see docs/install.md)"
    fi
}

say_planned_extras() {
    local name
    for name in take_home watchdog access_point read_only_root; do
        if [ "${!name}" = yes ]; then note "would set up --${name//_/-}"; fi
    done
}

add_extras() {
    if [ "$take_home" = yes ]; then
        step "recordings come onto USB sticks that have a folder dnb-edge"
        put_optional 99-dnb-edge-take-home.rules
        if systemd_runs; then try udevadm control --reload; fi
    fi
    if [ "$watchdog" = yes ]; then
        step "the machine is restarted by its hardware where it hangs for 15 s"
        put_optional dnb-edge-watchdog.conf
        if systemd_runs; then try systemctl daemon-reexec; fi
    fi
    if [ "$access_point" = yes ]; then add_access_point; fi
    if [ "$read_only_root" = yes ]; then add_read_only_root; fi
}

put_optional() {
    local name folder as
    optional_files | grep "^$1 " | read -r name folder as
    mkdir -p "$root$folder"
    put_file "$here/systemd/$name" "$root$folder/$as"
}

remove_extras() {
    if [ -e "$access_point_file" ]; then
        rm -f "$access_point_file"
        if systemd_runs; then nmcli connection reload >>"$log" 2>&1 || true; fi
    fi
    if grep -qs dnb-edge "$overlay_file"; then
        rm -f "$overlay_file"
        if [ -z "$root" ]; then update-initramfs -u >>"$log" 2>&1 || true; fi
    fi
}

# Not brought up now: it would take the Wi-Fi away by which somebody may be logged in.
add_access_point() {
    local password=${DNB_EDGE_AP_PASSWORD:-} name=$ssid
    step "a Wi-Fi of the box's own"
    if [ -f "$access_point_file" ]; then
        name=${name:-$(sed -n 's/^ssid=//p' "$access_point_file")}
        password=${password:-$(sed -n 's/^psk=//p' "$access_point_file")}
    fi
    name=${name:-dnb-edge}
    # Letters that nobody takes for another one.
    password=${password:-$(LC_ALL=C tr -dc 'a-hjkmnp-z2-9' </dev/urandom | head -c 12 || true)}
    mkdir -p "${access_point_file%/*}"
    (
        umask 077
        printf '%s\n' '[connection]' 'id=dnb-edge-ap' "uuid=$(cat /proc/sys/kernel/random/uuid)" 'type=wifi' \
            'autoconnect=true' 'autoconnect-priority=10' '' \
            '[wifi]' 'mode=ap' 'band=bg' "ssid=$name" '' \
            '[wifi-security]' 'key-mgmt=wpa-psk' 'proto=rsn' 'pairwise=ccmp' "psk=$password" '' \
            '[ipv4]' 'method=shared' 'address1=10.42.0.1/24' '' '[ipv6]' 'method=disabled' >"$access_point_file.new"
    )
    mv -T "$access_point_file.new" "$access_point_file"
    if systemd_runs; then try nmcli connection reload; fi
    note "name '$name', password '$password'; the pages are then at http://10.42.0.1:8080/"
    note "from the next start on (at once: nmcli connection up dnb-edge-ap); another Wi-Fi of the box goes off by that"
    if command -v rfkill >/dev/null && rfkill list wifi 2>/dev/null | grep -q 'Soft blocked: yes'; then
        note "its Wi-Fi is switched off: on a Raspberry Pi, name the country first: raspi-config nonint do_wifi_country GB"
    fi
}

add_read_only_root() {
    local line
    step "a read-only root: from the next start on, only /var/lib/dnb-edge is written"
    line=$(log_lines)
    if [ -z "$root" ] && ! dpkg-query -W overlayroot >/dev/null 2>&1; then
        # Its initial ram disk wants mke2fs, and it does not say so.
        quietly env DEBIAN_FRONTEND=noninteractive apt-get -y -o DPkg::Lock::Timeout=300 install --no-install-recommends \
            e2fsprogs overlayroot || failed "dnb-edge is installed, but overlayroot is not: $(reason_since "$line")"
    fi
    # recurse=0: only the root itself. Other partitions stay as they are, and so do recordings.
    printf '# Of dnb-edge: install.sh --read-only-root; see docs/install.md for the way back.\noverlayroot="tmpfs:recurse=0"\n' \
        >"$overlay_file.new"
    mv -T "$overlay_file.new" "$overlay_file"
    if [ -z "$root" ] && ! quietly update-initramfs -u; then
        rm -f "$overlay_file"
        failed "dnb-edge is installed, but the root stays writable: update-initramfs failed: $(reason_since "$line")"
    fi
}

# The address by which others in the network reach this machine; its name where it has none.
address() {
    local found
    found=$(hostname -I 2>/dev/null | awk '{ print $1 }') || true
    printf '%s\n' "${found:-localhost}"
}
