# shellcheck shell=bash
# What must be so before anything is done, and the Debian packages that dnb-edge stands on.

check_root() {
    [ -n "$root" ] || [ "$(id -u)" -eq 0 ] || [ "$dry_run" = yes ] || bad "it needs root: sudo ./install.sh"
}

check_system() {
    step "looking at this machine"
    local name id release_number architecture systemd
    [ -r "$root/etc/os-release" ] || bad "this is no Debian: /etc/os-release is not there"
    id=$(os_release ID) release_number=$(os_release VERSION_ID) name=$(os_release PRETTY_NAME)
    case $id-$release_number in
        debian-12 | debian-13 | raspbian-12 | raspbian-13) ;;
        *) bad "this is ${name:-an unknown system}; dnb-edge is installed on Debian 12 or 13, or Raspberry Pi OS of that age" ;;
    esac
    architecture=$(dpkg --print-architecture)
    case $architecture in
        amd64 | arm64) ;;
        *) bad "this is a system for $architecture; a 64-bit one is needed (amd64 or arm64), also on a Raspberry Pi" ;;
    esac
    systemd=$(systemctl --version | sed -n '1s/^systemd \([0-9]*\).*/\1/p')
    [ "${systemd:-0}" -ge 248 ] || bad "systemd is ${systemd:-not there}; 248 or newer is needed"
    if [ -x "$python" ]; then
        "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
            bad "$python is $("$python" -V 2>&1), and 3.11 or newer is needed"
    fi
    if grep -qs '^overlayroot / overlay ' "$root/proc/mounts"; then
        bad "the root is read-only, all of this would be gone with the next start: run" \
            "'overlayroot-chroot rm /etc/overlayroot.local.conf', restart, and install again with --read-only-root"
    fi
    note "$name, $architecture, systemd $systemd, $("$python" -V 2>/dev/null || printf 'Python to be installed')"
}

os_release() { sed -n "s/^$1=\"\{0,1\}\([^\"]*\)\"\{0,1\}\$/\1/p" "$root/etc/os-release"; }

check_sources() {
    local name
    for name in pyproject.toml constraints.txt README.md LICENSE dnb_edge/__init__.py; do
        [ -e "$here/$name" ] || bad "$here/$name is not there: run install.sh in a whole clone of dnb-edge"
    done
    version=$(sed -n 's/^__version__ = "\(.*\)"$/\1/p' "$here/dnb_edge/__init__.py")
    [ -n "$version" ] || bad "$here/dnb_edge/__init__.py: no __version__ in it: run install.sh in a whole clone of dnb-edge"
}

# Megabytes: what the packages take, as measured, with the wheels beside them while they are unpacked, and some to spare.
check_room() {
    # DNB_EDGE_NEEDED_MB is for tests.
    local needed=${DNB_EDGE_NEEDED_MB:-900} free
    if [ -n "$built" ]; then
        return
    fi
    if [ -n "$base" ]; then
        needed=${DNB_EDGE_NEEDED_MB:-200}
    fi
    free=$(free_mb)
    [ "$free" -ge "$needed" ] || failed "the disk of $opt has $free MB of room, $needed MB are needed: make room (see df -h)"
}

# Room on the disk of /opt/dnb-edge, megabytes.
free_mb() {
    local at=$opt
    while [ ! -d "$at" ]; do at=${at%/*}; done
    # Not df: it wants /proc.
    printf '%s\n' "$(($(stat -f -c '%a * %S / 1048576' "${at:-/}")))"
}

missing_debian_packages() {
    "$python" -c 'import venv, ensurepip' 2>/dev/null || printf 'python3-venv\n'
    "$python" -c 'import systemd.daemon' 2>/dev/null || printf 'python3-systemd\n'
}

install_debian_packages() {
    local missing=() debs=() line
    missing_debian_packages | mapfile -t missing
    [ ${#missing[@]} -gt 0 ] || return 0
    step "installing Debian packages: ${missing[*]}"
    local apt=(env DEBIAN_FRONTEND=noninteractive apt-get -y -o DPkg::Lock::Timeout=300)
    line=$(log_lines)
    if [ -n "$wheels" ]; then find "$wheels" -name '*.deb' | mapfile -t debs; fi
    if [ ${#debs[@]} -gt 0 ]; then
        quietly "${apt[@]}" install --no-install-recommends --no-download "${debs[@]}" ||
            failed "apt-get could not install the packages in $wheels: $(reason_since "$line")"
    else
        try "${apt[@]}" update
        quietly "${apt[@]}" install --no-install-recommends "${missing[@]}" ||
            failed "apt-get could not install ${missing[*]}: $(reason_since "$line")"
    fi
    missing_debian_packages | mapfile -t missing
    [ ${#missing[@]} -eq 0 ] || failed "$python still lacks what ${missing[*]} brings: is it Debian's own Python?"
}
