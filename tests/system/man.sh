#!/usr/bin/env bash
# Man pages and completion fit the programs, are in order, and complete the words that a user begins to type.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
[ "$("$sst" --describe | wc -l)" -gt 20 ] || fail "--describe: $("$sst" --describe | head -c 300)"
"$root/scripts/man.py" --build "${SST_BUILD:-build}" --check || fail "stale"

# Words of options that sst-sim's help names.
for w in wide tight single-tt multi-tt rows one; do "$root/${SST_BUILD:-build}/sst-sim" --help | grep -qE "\b$w\b" || fail "sst-sim knows no $w"; done

for page in "$root"/docs/man/*.[1-8]; do
  [ -z "$(groff -k -ww -man -Tutf8 "$page" 2>&1 >text)" ] || fail "$page: $(groff -k -ww -man -Tutf8 "$page" 2>&1 >/dev/null)"
  [ "$(wc -l <text)" -gt 30 ] || fail "$page is empty"
done

# Options of sstd, both ways.
sstd=$root/${SST_BUILD:-build}/sstd
if [ -x "$sstd" ]; then
  "$sstd" --help >help 2>&1 || fail "sstd --help: exit $?"
  groff -k -man -Tascii -P-cbou "$root/docs/man/sstd.8" >page
  sed -n '/^OPTIONS/,/^SIGNALS/p' page | grep -oE '^ +(-[a-z], )?--[a-z-]+' | grep -oE -- '--[a-z-]+' | sort -u >in_page
  grep -oE '^ +(-[a-z], )?--[a-z-]+' help | grep -oE -- '--[a-z-]+' | sort -u >in_help
  cmp -s in_page in_help || fail "sstd(8) and sstd --help differ: $(diff in_page in_help)"
fi

# completes WANTED WORDS...: the last word is incomplete
completes() {
  local wanted=$1
  shift
  COMP_WORDS=("${program:-sst}" "$@")
  COMP_CWORD=$#
  COMPREPLY=()
  local name=_${program:-sst}
  "${name//-/_}" 2>/dev/null
  [ "${COMPREPLY[*]}" = "$wanted" ] || fail "${program:-sst} $*: '${COMPREPLY[*]}', not '$wanted'"
}
. "$root/completions/sst"
complete -p sst >/dev/null || fail "nothing completes sst"
completes 'snapshot' snap
completes 'recording rectify render record reload' re
completes 'start stop' record st
completes '--follow' events --f
completes 'colmap' export c
completes 'array rig' capture ''
completes '--pitch --pitch-y' capture rig --pi
completes '--duration' capture array --du
completes '' snapshot -o ''
completes '' render garden ''
completes 'sst see-through' render garden --method s
completes 'clear' sweep garden -m c
completes 'preview balanced accurate' process garden --preset ''
completes 'hedge' demo --scene he
completes 'cell cd-cases cat' scene c
completes '' scene bush -o ''
sst() { SST_MODELS=$root/models "$root/${SST_BUILD:-build}/sst" "$@"; }
completes 'pspnet-large pspnet-small' models p
completes 'pspnet-large pspnet-small' process garden --model p
. "$root/completions/sst-sim"
. "$root/completions/sstd"
program=sst-sim completes 'fault status stop' ''
program=sst-sim completes '--triggers --truth' --tr
program=sst-sim completes 'hedge humvee' --world h
program=sst-sim completes '' --cache ''
program=sstd completes '--config --check' --c
program=sstd completes '' --config ''
exit $failed
