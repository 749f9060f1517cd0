#!/bin/sh
# Installs through apt, where it may, what pip cannot: headless OpenGL for pictures, and a browser for the tests of
# pages; else says which to install.
set -eu

has() { ldconfig -p 2>/dev/null | grep -q "$1"; }

packages=""
# EGL needs both the dispatcher and Mesa's software renderer; OSMesa is whole in itself.
if ! { { has libEGL.so.1 && has libEGL_mesa.so.0; } || has libOSMesa.so; }; then
    packages="libegl1 libegl-mesa0 libgl1-mesa-dri"
    lost="pictures and films cannot be rendered"
fi
if ! { command -v chromium && command -v chromedriver; } >/dev/null; then
    packages="$packages chromium chromium-driver"
    lost="${lost:+$lost, and }pages cannot be tested in a browser"
fi
if [ -z "$packages" ]; then
    exit 0
fi
if command -v apt-get >/dev/null && [ "$(id -u)" -eq 0 ]; then
    install="apt-get install -y -qq --no-install-recommends"
    if apt-get update -qq && DEBIAN_FRONTEND=noninteractive $install $packages >/dev/null; then
        exit 0
    fi
fi
echo "$lost until you run: apt-get install$(printf ' %s' $packages)" >&2
