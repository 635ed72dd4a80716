# shellcheck shell=bash
# Sourced by ./demo and ./test: installs what is missing, saying what and why, and fetches dependencies once.
# Everything after it works without a network.

say() { printf '\n== %s\n' "$*"; }
fail() { printf '\nerror: %s\n' "$*" >&2; exit 1; }

# apt_install WHY PACKAGE...: through apt as root or with a sudo that asks nothing. Fails where neither works.
apt_install() {
    local why=$1
    shift
    command -v apt-get >/dev/null || return 1
    local sudo=()
    if [ "$(id -u)" -ne 0 ]; then
        sudo -n true 2>/dev/null || return 1
        sudo=(sudo -n)
    fi
    say "installing $* through apt: $why"
    local apt=("${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0)
    "${apt[@]}" install -y --no-install-recommends "$@" >/dev/null 2>&1 && return 0
    "${apt[@]}" update >/dev/null 2>&1 || return 1
    "${apt[@]}" install -y --no-install-recommends "$@" >/dev/null
}

need_cargo() {
    if ! command -v cargo >/dev/null && [ -x "$HOME/.cargo/bin/cargo" ]; then
        PATH="$HOME/.cargo/bin:$PATH"
    fi
    command -v cargo >/dev/null || fail "Rust is missing; install it from https://rustup.rs and run this again"
}

need_linker() {
    command -v cc >/dev/null && return
    apt_install "a C compiler links every program" gcc libc6-dev ||
        fail "there is no C compiler (cc), which links programs; install gcc and the C library's headers and run this again"
}

need_c_compiler() {
    command -v cc >/dev/null && command -v c++ >/dev/null && return
    apt_install "a C compiler builds the zstd library, which GeoTIFF needs, and links every program; the encoder of pictures needs the C++ library" \
        gcc g++ libc6-dev ||
        fail "there is no C compiler (cc) or no C++ library (g++ has it); install gcc, g++ and the C library's headers and run this again"
}

# has_target TARGET WHY: whether Rust's library is here for another system, fetching it through rustup if need be.
has_target() {
    [ -d "$(rustc --print sysroot)/lib/rustlib/$1/lib" ] && return
    command -v rustup >/dev/null || return 1
    say "fetching Rust's library for $1 through rustup: $2"
    timeout 120 rustup target add "$1" >/dev/null 2>&1
}

# fetch_for TARGET: what Cargo.lock names for another system, if it is not here yet; fails without a network.
fetch_for() {
    cargo fetch --locked --offline --target "$1" >/dev/null 2>&1 ||
        CARGO_NET_OFFLINE=false timeout 120 cargo fetch --locked --target "$1" >/dev/null 2>&1
}

# need_component NAME WHY
need_component() {
    cargo "${1#cargo-}" --version >/dev/null 2>&1 && return
    local component=${1#cargo-}
    [ "$component" = fmt ] && component=rustfmt
    command -v rustup >/dev/null || fail "$component is missing; install it with your Rust and run this again ($2)"
    say "installing $component through rustup: $2"
    rustup component add "$component" || fail "rustup cannot install $component; it needs the network once"
}

# need_cargo_tool NAME VERSION WHY [OPTION...]: a subcommand of cargo, built from its source if it is not here.
need_cargo_tool() {
    cargo "${1#cargo-}" --version >/dev/null 2>&1 && return
    say "building $1 $2 through cargo, once: $3"
    CARGO_NET_OFFLINE=false cargo install --quiet --locked "$1" --version "$2" "${@:4}" ||
        fail "$1 cannot be installed; it needs the network once"
}

# Fetches what Cargo.lock names for this machine, if it is not here yet, and keeps cargo off the network from then on.
fetch_dependencies() {
    local host
    host=$(rustc -vV | sed -n 's/^host: //p')
    if ! cargo fetch --locked --offline --target "$host" >/dev/null 2>&1; then
        say "fetching the dependencies that Cargo.lock names: needed once, offline afterwards"
        cargo fetch --locked --target "$host" || fail "the dependencies cannot be fetched; the first run needs the network"
    fi
    export CARGO_NET_OFFLINE=true
}

# graphics_driver WHY: whether there is one, installing one in software if need be.
graphics_driver() {
    [ "$(uname)" = Darwin ] && return
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || apt_install "$1" mesa-vulkan-drivers libvulkan1
}
