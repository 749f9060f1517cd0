#!/bin/sh
# Installs the system library for drawing without a screen, through apt where it may; else says which to install.
set -eu

has() { ldconfig -p 2>/dev/null | grep -q "$1"; }

# EGL needs both the dispatcher and Mesa's software renderer; OSMesa is whole in itself.
if { has libEGL.so.1 && has libEGL_mesa.so.0; } || has libOSMesa.so; then
    exit 0
fi
packages="libegl1 libegl-mesa0 libgl1-mesa-dri"
if command -v apt-get >/dev/null && [ "$(id -u)" -eq 0 ]; then
    if apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $packages >/dev/null; then
        exit 0
    fi
fi
echo "no headless OpenGL: pictures and films cannot be rendered until you run: apt-get install $packages" >&2
