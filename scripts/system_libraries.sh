#!/bin/sh
# Installs through apt, where it may, what pip cannot: headless OpenGL for pictures, and a browser for the tests of
# pages; else says which to install.
set -eu

has() { ldconfig -p 2>/dev/null | grep -q "$1"; }
has_egl() { has libEGL.so.1 && has libEGL_mesa.so.0; }
has_browser() { { command -v chromium && command -v chromedriver; } >/dev/null; }

# EGL needs both the dispatcher and Mesa's software renderer; OSMesa, the second choice, is whole in itself.
packages=""
has_egl || packages="libegl1 libegl-mesa0 libgl1-mesa-dri"
has libOSMesa.so || packages="$packages libosmesa6"
has_browser || packages="$packages chromium chromium-driver"
[ -n "$packages" ] || exit 0
if command -v apt-get >/dev/null && [ "$(id -u)" -eq 0 ] && apt-get update -qq; then
    for package in $packages; do # one by one: newer systems have no OSMesa any more
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$package" >/dev/null 2>&1 || true
    done
fi

needed=""
if ! has_egl && ! has libOSMesa.so; then
    needed=" libegl1 libegl-mesa0 libgl1-mesa-dri"
    lost="pictures and films cannot be rendered"
fi
if ! has_browser; then
    needed="$needed chromium chromium-driver"
    lost="${lost:+$lost, and }pages cannot be tested in a browser"
fi
[ -z "$needed" ] || echo "$lost until you run: apt-get install$needed" >&2
