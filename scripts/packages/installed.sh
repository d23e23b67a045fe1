#!/usr/bin/env bash
# Checks inside a root folder with the packages of /packages installed: man pages, completions by the shells themselves, AppArmor's
# profiles, units. check.sh runs it.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
failed=0
fail() { echo "FAIL: $*"; failed=1; }
apt-get -qq update && apt-get -qq -o Dpkg::Use-Pty=0 install -y --no-install-recommends /packages/sst_*.deb /packages/sst-opencv_*.deb /packages/sst-genicam_*.deb /packages/sst-video_*.deb /packages/sst-rtsp_*.deb /packages/sstd_*.deb /packages/sst-sim_*.deb /packages/sst-models_*.deb ||
  { fail "cannot be installed"; exit 1; }

for page in sst.1 sst-sim.1 sstd.8 sst-rtsp.8 sst-mqtt.8 sst-onvif.8 sstd.yaml.5; do
  [ -n "$(find /usr/share/man -name "$page.gz")" ] || { grep -q 'path-exclude.*man' /etc/dpkg/dpkg.cfg.d/* 2>/dev/null || fail "no man page $page"; }
done
for program in /usr/bin/sst /usr/bin/sst-sim /usr/sbin/sstd /usr/sbin/sst-rtsp /usr/sbin/sst-mqtt /usr/sbin/sst-onvif; do
  $program --help >/dev/null || fail "$program --help: exit $?"
done
sst version
sst version --json | grep -q '"opencv": true' || fail "built without OpenCV"
sst cameras --local >/tmp/cameras 2>&1
grep -E 'libsst-(aravis|opencv|gphoto|video)' /tmp/cameras && fail "sst cameras: $(cat /tmp/cameras)"

# has LIST WORDS...: each word is in the list
has() {
  local list=$1 w
  shift
  for w in "$@"; do grep -qwe "$w" <<<"$list" || fail "$shell does not complete $w: $(tr '\n' ' ' <<<"$list" | head -c 300)"; done
}
shell=fish
complete() { fish -c "complete -C '$1'" 2>&1; }
has "$(complete 'sst re')" render record reload rectify recording
has "$(complete 'sst render lf --method ')" refocus see-through clear
has "$(complete 'sst process lf --preset ')" preview balanced accurate
has "$(complete 'sst scene b')" bush bust
has "$(complete 'sst demo --scene ')" pedestrian hedge
has "$(complete 'sst capture ')" array rig
has "$(complete 'sst capture array --tri')" --trigger
has "$(complete 'sst models ')" pspnet-small pspnet-large
has "$(complete 'sst-sim --world ')" hedge board
has "$(complete 'sstd --ch')" --check

shell=zsh
zsh -f -c 'autoload -Uz compinit && compinit -u -D && (( $+_comps[sst] && $+_comps[sst-sim] && $+_comps[sstd] ))' || fail "zsh knows no completions of sst"
for f in /usr/share/zsh/vendor-completions/_sst*; do zsh -n "$f" || fail "$f"; done
# In a terminal of its own: Tab twice lists the values.
cat >/tmp/ask.zsh <<'Z'
zmodload zsh/zpty
complete() {
  local line
  zpty z 'PS1= zsh -f -i'
  zpty -w z 'autoload -Uz compinit && compinit -u -D; LISTMAX=1000; zstyle ":completion:*" list-colors ""; setopt no_list_ambiguous; stty columns 200 2>/dev/null; print ready-$((1 + 1))'
  while zpty -r z line; do [[ $line == *ready-2* ]] && break; done
  zpty -w -n z "$1"$'\t\t\t'
  sleep 2
  zpty -w z ''
  while zpty -r -t z line; do print -rn -- "$line"; done
  zpty -d z
}
complete "$1"
Z
complete() { timeout 30 zsh -f /tmp/ask.zsh "$1" 2>&1 | sed 's/\x1b\[[0-9;?]*[A-Za-z]//g'; }
has "$(complete 'sst render lf --method ')" refocus see-through clear
has "$(complete 'sst process lf --preset ')" preview balanced accurate
has "$(complete 'sst-sim --world ')" hedge board

shell=bash
complete() {
  bash -c '. /usr/share/bash-completion/bash_completion; . /usr/share/bash-completion/completions/$0
    COMP_WORDS=("$0" "$@"); COMP_CWORD=$#; COMPREPLY=(); f=_${0//-/_}; $f; echo "${COMPREPLY[*]}"' "$@" 2>/dev/null
}
has "$(complete sst render lf --method '')" refocus see-through clear
has "$(complete sst process lf --preset '')" preview balanced accurate
has "$(complete sst-sim --world '')" hedge board

for f in /etc/apparmor.d/usr.sbin.sst*; do
  [ -d "$f" ] || apparmor_parser -Q -K -S "$f" >/dev/null || fail "AppArmor refuses $f"
done
units=$(systemctl --version >/dev/null 2>&1 && dpkg -L sstd sst-rtsp | grep -E '/systemd/system/sst[^/]*\.(service|socket)$')
systemd-analyze verify --man=no $units >/tmp/verify 2>&1 || fail "units: $(cat /tmp/verify)"
grep -E '(^|/)sst[d-]' /tmp/verify && fail "units: $(cat /tmp/verify)"
for unit in sstd:15 sst-rtsp:12 sst-mqtt:12 sst-onvif:12; do
  systemd-analyze security --offline=true --threshold="${unit#*:}" "$(dpkg -L sstd sst-rtsp | grep "/system/${unit%:*}.service$")" >/tmp/security 2>&1 || fail "exposure of $unit"
  tail -n 1 /tmp/security
done
exit $failed
