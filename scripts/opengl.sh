#!/usr/bin/env bash
# Makes sure that simulators can render: installs Mesa's EGL where it is missing and we may, else says how.
set -u
python=$1
renders() { MUJOCO_GL=${MUJOCO_GL:-egl} "$python" -c 'import mujoco; mujoco.GLContext(64, 64).make_current()' 2>/dev/null; }
[ "$(uname -s)" = Linux ] || exit 0
renders && exit 0
packages="libegl1 libgl1-mesa-dri"
command="apt-get update && apt-get install -y $packages"
if command -v apt-get >/dev/null; then
  if [ "$(id -u)" = 0 ]; then
    bash -c "$command" >/dev/null
  elif sudo -n true 2>/dev/null; then
    sudo bash -c "$command" >/dev/null
  fi
fi
renders && exit 0
echo "This machine cannot render yet (OpenGL is missing). On Debian or Ubuntu type: sudo bash -c '$command'" >&2
exit 1
