# shellcheck shell=bash
# Releases: each a virtual environment of its own under /opt/dnb-edge/releases; /opt/dnb-edge/venv is a link to the one that
# runs. A release without the file .complete was interrupted, and is swept away.

settle_release() {
    local now
    now=$(current_release)
    if [ -n "$now" ] && [ ${#extras[@]} -eq 0 ]; then
        # What was asked for once is wanted in the next release, too.
        kept_note "$now" extras | read -ra extras || true
    fi
    sources=$(digest_of_sources)
    pins=$(digest_of_pins)
    built='' base=''
    if [ -n "$now" ] && [ "$fresh" = no ]; then
        if [ "$(kept_note "$now" sources)" = "$sources" ]; then
            built=$now
        elif [ "$(kept_note "$now" pins)" = "$pins" ]; then
            base=$now
        fi
    fi
    release=$built
    if [ -z "$built" ]; then release=$(unused "$opt/releases/$version-$(date -u +%Y%m%d-%H%M%S)"); fi
}

# A path that is not there yet, for two releases within a second.
unused() {
    local at=$1 number=2
    while [ -e "$at" ]; do at=$1-$((number++)); done
    printf '%s\n' "$at"
}

# The complete release that runs; nothing where there is none, or an installation older than releases.
current_release() {
    [ -L "$opt/venv" ] || return 0
    local at
    at=$opt/$(readlink "$opt/venv")
    if [ -e "$at/.complete" ]; then printf '%s\n' "$at"; fi
}

kept_note() { sed -n "s/^$2=//p" "$1/.complete"; }

# Of everything that the package is made of; caches are none of it.
digest_of_sources() {
    (
        cd "$here" || exit
        find dnb_edge systemd install.sh pyproject.toml README.md LICENSE -type f ! -path '*/__pycache__/*' -print0 |
            LC_ALL=C sort -z | xargs -0 sha256sum
        digest_of_pins
    ) | sha256sum | cut -c 1-16
}

# Of what it stands on: the same, and the packages of the last release can be taken over.
digest_of_pins() {
    {
        cat "$here/constraints.txt"
        sed -n '/^dependencies = \[/,/^\]/p; /^\[project.optional-dependencies\]/,/^\[/p' "$here/pyproject.toml"
        printf '%s\n' "${extras[@]}"
        "$python" -VV 2>/dev/null || true
    } | sha256sum | cut -c 1-16
}

sweep_releases() {
    local at
    for at in "$opt"/releases/*/; do
        if [ -d "$at" ] && [ ! -e "$at/.complete" ]; then
            note "removing ${at%/}, which was interrupted"
            rm -rf "$at"
        fi
    done
}

build_release() {
    sweep_releases
    stage=building
    mkdir -p "$release"
    if [ -n "$base" ]; then
        step "building $version beside ${base##*/}, with the same Python packages"
        take_over "$base"
    else
        step "building $version in $release (a few minutes)"
        quietly "$python" -m venv --system-site-packages "$release" ||
            failed "the virtual environment was not made: $(reason_since 0)"
    fi
    install_python_packages
    mkdir -p "$release/kit"
    cp -r "$here/systemd" "$here/install.sh" "$release/kit/"
    ln -sfn kit/install.sh "$release/install.sh"
    check_release
    # On the disk, not on its way there, before anything leads to it.
    sync -f "$release"
    printf 'version=%s\nsources=%s\npins=%s\nextras=%s\n' "$version" "$sources" "$pins" "${extras[*]}" >"$release/.complete"
    sync -f "$release"
}

# Another release's packages, as further names of the same files: pip replaces files, it never writes into one.
take_over() {
    local line script
    line=$(log_lines)
    quietly cp -al "$1/." "$release/" || failed "the last release's packages were not taken over: $(reason_since "$line")"
    rm -rf "$release/.complete" "$release/kit"
    for script in "$release"/bin/* "$release/pyvenv.cfg"; do
        # Its programs name the folder they lie in. sed writes another file, the old release keeps its own.
        if [ -f "$script" ] && [ ! -L "$script" ] && grep -qIF "$1" "$script"; then
            sed -i "s#$1#$release#g" "$script"
        fi
    done
}

install_python_packages() {
    local pip=("$release/bin/python" -m pip install --no-compile --no-cache-dir --no-input --disable-pip-version-check
        --root-user-action=ignore -c "$here/constraints.txt")
    local wanted=$release/source line builders=()
    if [ -n "$wheels" ]; then pip+=(--no-index --find-links "$wheels"); fi
    mkdir -p "$release/scratch" "$wanted"
    # Not in the clone: building leaves files of root's there.
    (cd "$here" && cp -r dnb_edge pyproject.toml README.md LICENSE "$wanted/")
    if [ ${#extras[@]} -gt 0 ]; then wanted+="[$(IFS=, && printf '%s' "${extras[*]}")]"; fi
    line=$(log_lines)
    # What is unpacked on the way may be larger than /tmp, which lies in memory on Debian 13.
    export TMPDIR=$release/scratch
    if [ -n "$base" ]; then
        pip+=(--no-deps --force-reinstall)
    else
        # What builds the package stays, so that the next release needs no network.
        "$python" -c 'import sys, tomllib
print("\n".join(tomllib.load(open(sys.argv[1], "rb"))["build-system"]["requires"]), end="")' "$here/pyproject.toml" |
            mapfile -t builders
        if [ ${#builders[@]} -gt 0 ]; then
            quietly "${pip[@]}" "${builders[@]}" || failed "pip could not install ${builders[*]}: $(reason_since "$line")"
        fi
    fi
    quietly "${pip[@]}" --no-build-isolation "$wanted" ||
        failed "pip could not install the Python packages: $(reason_since "$line")"
    unset TMPDIR
    rm -rf "$release/scratch" "$release/source"
    # By all processors, and now: the service may not write here. Some packages hold examples that do not compile.
    local new=("$release/lib")
    if [ -n "$base" ]; then new=("$release"/lib/python3*/site-packages/dnb_edge); fi
    try "$release/bin/python" -m compileall -q -j 0 "${new[@]}"
}

check_release() {
    local line said
    line=$(log_lines)
    quietly "$release/bin/dnb-edge" --version || failed "the new dnb-edge does not even start: $(reason_since "$line")"
    said=$(tail -n 1 "$log")
    [ "$said" = "dnb-edge $version" ] || failed "the new dnb-edge calls itself '$said', not 'dnb-edge $version'"
}

# One rename, so that the link leads to a whole release at any moment. A folder of an installation older than releases
# changes places with the link, and becomes a release that can be gone back to.
lead_to() {
    local link=$opt/.venv-link
    rm -rf "$link"
    ln -s "releases/${1##*/}" "$link"
    if [ -L "$opt/venv" ] || [ ! -e "$opt/venv" ]; then
        mv -T "$link" "$opt/venv"
        return
    fi
    exchange "$link" "$opt/venv" || { mv -T "$opt/venv" "$link.old" && mv -T "$link" "$opt/venv" && mv -T "$link.old" "$link"; }
    mv -T "$link" "$before"
}

exchange() {
    "$python" - "$1" "$2" <<'PYTHON'
import ctypes, os, sys
at_folder, exchange = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
libc = ctypes.CDLL(None, use_errno=True)
one, other = (os.fsencode(path) for path in sys.argv[1:])
sys.exit(libc.renameat2(at_folder, one, at_folder, other, exchange) != 0)
PYTHON
}

# The one that runs, and the one before it.
prune_releases() {
    local at kept=0 now
    now=$(current_release)
    releases_newest_first | while read -r at; do
        if [ "$at" = "$now" ]; then continue; fi
        if [ $((kept++)) -ge 1 ]; then
            note "removing ${at##*/}"
            rm -rf "$at"
        fi
    done
}

# By the moment at which they were last led to, which the time of .complete tells.
releases_newest_first() {
    local at
    for at in "$opt"/releases/*/.complete; do
        if [ -e "$at" ]; then printf '%s\t%s\n' "$(stat -c %.Y "$at")" "${at%/.complete}"; fi
    done | sort -rn | cut -f 2
}

# What a box without a network lacks: wheels, and the Debian packages that a small system does not have.
download_wheels() {
    check_system
    check_sources
    local line names=() scratch name python_name
    "$python" -c 'import venv, ensurepip' 2>/dev/null || failed "--download needs python3-venv here: apt install python3-venv"
    step "downloading to $download"
    mkdir -p "$download"
    download=$(cd "$download" && pwd)
    scratch=$(mktemp -d)
    # systemd-python is Debian's, since it has no wheels.
    "$python" -c 'import sys, tomllib
whole = tomllib.load(open(sys.argv[1], "rb"))
wanted = whole["build-system"]["requires"] + whole["project"]["dependencies"]
for extra in sys.argv[2:]:
    wanted += whole["project"]["optional-dependencies"][extra]
print("\n".join(name for name in wanted if not name.startswith("systemd-python")))' \
        "$here/pyproject.toml" "${extras[@]}" | mapfile -t names
    line=$(log_lines)
    quietly "$python" -m venv "$scratch/venv"
    quietly "$scratch/venv/bin/python" -m pip download --disable-pip-version-check --only-binary=:all: -d "$download" \
        -c "$here/constraints.txt" "${names[@]}" || {
        rm -rf "$scratch"
        failed "pip could not download the packages: $(reason_since "$line")"
    }
    rm -rf "$scratch"
    python_name=$("$python" -c 'import sys; print(f"python{sys.version_info[0]}.{sys.version_info[1]}-venv")')
    for name in python3-venv "$python_name" python3-pip-whl python3-setuptools-whl python3-systemd; do
        (cd "$download" && try apt-get download "$name")
    done
    step "done: carry $download to the box and run there: sudo ./install.sh --wheels DIR"
}
