#!/usr/bin/env bash
# Installs dnb-edge on Debian 12 or 13 or Raspberry Pi OS, upgrades it, takes it back, or removes it. Asks nothing; may be
# repeated. What it does and leaves, and why: docs/install.md. Its parts are in systemd/installer/.
set -euo pipefail
# The end of a pipe sets variables here: <(...) needs /dev/fd, which is not there where a card's contents are built.
shopt -s lastpipe
umask 022

here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd)
root=${DNB_EDGE_ROOT:-} # everything below another folder, for tests
opt=$root/opt/dnb-edge
python=${PYTHON:-/usr/bin/python3}
units=(dnb-edge dnb-edge-web)
log=/dev/null

# shellcheck source=systemd/installer/say.sh
source "$here/systemd/installer/say.sh"
# shellcheck source=systemd/installer/checks.sh
source "$here/systemd/installer/checks.sh"
# shellcheck source=systemd/installer/release.sh
source "$here/systemd/installer/release.sh"
# shellcheck source=systemd/installer/system.sh
source "$here/systemd/installer/system.sh"
# shellcheck source=systemd/installer/extras.sh
source "$here/systemd/installer/extras.sh"

usage() {
    cat <<'TEXT'
Usage: sudo ./install.sh [OPTION...]        in a clone of dnb-edge; docs/install.md tells all

  (none)               install, or upgrade what is installed; back to what was where the new one is not healthy
  --wheels DIR         take all Python packages (and missing Debian packages, *.deb) from DIR: no network is needed
  --download DIR       only fill such a DIR, for boxes of this kind and Debian without a network
  --extra NAME         with optional Python packages, such as luma for a display on SPI; may be repeated
  --fresh              install all Python packages anew, also where the last release has the same ones
  --no-start           install and enable, but start nothing
  --take-home          recordings onto USB sticks that have a folder dnb-edge
  --watchdog           let the machine's hardware restart it where it hangs
  --access-point[=SSID]  a Wi-Fi of the box's own, through NetworkManager; from the next start on
  --read-only-root     nothing but recordings and set-up is written any more; from the next start on
  --rollback           go back to the release before
  --uninstall          remove it; configuration, set-up, recordings and users stay
  --uninstall --purge  remove those, too
  --dry-run            say what would be done, and do nothing
  --help               this text

Exit code 0: done. 1: it failed, and all is as it was before. 2: wrong use or an unsupported system; nothing was done.
TEXT
}

verb=install wheels='' download='' fresh=no start=yes purge=no dry_run=no
take_home=no watchdog=no access_point=no ssid='' read_only_root=no extras=()

read_options() {
    while [ $# -gt 0 ]; do
        case $1 in
            --wheels | --download | --extra)
                [ $# -ge 2 ] || bad "$1: name what belongs to it: see ./install.sh --help"
                case $1 in
                    --wheels) wheels=$2 ;;
                    --download) verb=download download=$2 ;;
                    --extra) extras+=("$2") ;;
                esac
                shift
                ;;
            --fresh) fresh=yes ;;
            --no-start) start=no ;;
            --take-home) take_home=yes ;;
            --watchdog) watchdog=yes ;;
            --access-point) access_point=yes ;;
            --access-point=*) access_point=yes ssid=${1#*=} ;;
            --read-only-root) read_only_root=yes ;;
            --rollback) verb=rollback ;;
            --uninstall) verb=uninstall ;;
            --purge) purge=yes ;;
            --dry-run) dry_run=yes ;;
            --help | -h) usage && exit 0 ;;
            *) bad "$1: no such option: see ./install.sh --help" ;;
        esac
        shift
    done
    [ "$purge" = no ] || [ "$verb" = uninstall ] || bad "--purge: only with --uninstall"
    [ -z "$wheels" ] || [ -d "$wheels" ] || bad "--wheels $wheels: no such folder"
    [ -z "$wheels" ] || wheels=$(cd "$wheels" && pwd)
}

install_all() {
    check_system
    check_sources
    check_extras
    settle_release
    check_room
    if [ "$dry_run" = yes ]; then
        say_plan
        return
    fi
    install_debian_packages
    if [ -n "$built" ]; then
        step "dnb-edge $version is installed already, from the same sources; nothing is built"
    else
        build_release
    fi
    switch_to "$release"
    add_extras
    prune_releases
    say_done
}

say_done() {
    if ! systemd_runs || [ "$start" = no ]; then
        step "done: dnb-edge $version starts with the machine"
    else
        step "done: dnb-edge $version runs; open http://$(hostname).local:8080/ or http://$(address):8080/ in a browser"
    fi
    note "the race in one line: systemctl status dnb-edge    everything checked: dnb-edge doctor    log: $log"
}

main() {
    read_options "$@"
    check_root
    begin
    case $verb in
        install) install_all ;;
        download) download_wheels ;;
        rollback) roll_back ;;
        uninstall) uninstall ;;
    esac
    stage='done'
}

# In one piece, so that bash has read all of it before the file may be replaced or removed.
main "$@"
exit 0
