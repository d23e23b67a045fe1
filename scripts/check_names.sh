#!/usr/bin/env bash
# Names and arrows of the built objects and of the headers:
# - code depends one way, and no circle of folders is linked (base < drivers, pipeline < capture < daemon, cli; base < client < publishers, cli);
# - the first word after sst_ belongs to one folder and its subfolders; sst_sim_ to simulators/;
# - sst_ means public: a folder's private headers are FOLDER_internal.h and, where that would be too long, PART_internal.h, in which no
#   function or tag has sst_, and only files of the folder, of its subfolders and tests include them; functions in other headers have sst_;
# - a struct, union or enum tag that a header defines stands for one type.
# - a class of the page defines a method once;
# - in pipeline/method/ only device*.c and device*.h name devices: the others describe steps, which the runner (pipeline/step/) places.
# Exceptions: headers that bring a library's types (*_dnnl.h, rtsp_*.h) or C++ (opencv_*.h) into a few files of a folder,
# the templates and parts of kernels, and programs' own tables (cli, daemon/main).
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
cd "$(dirname "$0")/.." || exit 1
build=${SST_BUILD:-build}
roots='base client config read drivers capture pipeline daemon publishers cli simulators'
bad=0
fail() { echo "error: $*" >&2; bad=1; }

# --- linked symbols -------------------------------------------------------------------------------------------------
# A plugin that calls none of the program is linked alone: FFmpeg's functions in it are not those of capture/recording/libav.c.
objects=$(cd "$build/obj" && find $roots -name '*.o' ! -path pipeline/video/h264_libav.o | while read -r o; do
  for ext in c cc; do [ -e "$OLDPWD/${o%.o}.$ext" ] && echo "$o"; done
done)
[ -n "$objects" ] || { echo "error: no objects in $build/obj; build first" >&2; exit 1; }
(cd "$build/obj" && nm -A -P $objects) | awk '
  function folder(f) { sub(/\/[^\/]*$/, "", f); sub(/^pipeline\/kernels\/(x86|arm)$/, "pipeline/kernels", f); return f }
  function top(f) { sub(/\/.*/, "", f); return f }
  function inside(a, b) { return a == b || index(a, b "/") == 1 }
  BEGIN {
    allowed["client"] = "base"; allowed["publishers"] = "base client config pipeline"
    allowed["config"] = "base"; allowed["drivers"] = "base"; allowed["pipeline"] = "base"
    allowed["read"] = "base pipeline"
    allowed["capture"] = "base drivers pipeline config"; allowed["simulators"] = "base pipeline"
    allowed["daemon"] = "base drivers pipeline config capture"
    allowed["cli"] = "base client drivers pipeline config capture simulators"
  }
  { sub(/:$/, "", $1); f = folder($1) }
  $3 ~ /^[TDBR]$/ { home[$2] = f }
  # libsst-video.so is linked to the libraries of FFmpeg themselves.
  $3 == "U" && !($1 ~ /_libav\.o$/ && $2 ~ /^(av|sws)/) { used[f, $2] = $1 }
  $3 == "T" && match($2, /^sst_[a-z0-9]+/) { p = substr($2, 5, RLENGTH - 4); owners[p] = owners[p] " " f; }
  END {
    for (u in used) {
      split(u, a, SUBSEP)
      if (!(a[2] in home) || home[a[2]] == a[1]) continue
      to = home[a[2]]; edge[a[1], to] = used[u] " uses " a[2]; node[a[1]]; node[to]
      if (top(a[1]) != top(to) && index(" " allowed[top(a[1])] " ", " " top(to) " ") == 0) { print used[u] " must not use " a[2] " of " to; bad = 1 }
    }
    # Folders that need nothing that is left are taken away until none is left, or only circles.
    do {
      gone = 0
      for (n in node) {
        free = 1
        for (m in node) if ((n, m) in edge) { free = 0; break }
        if (free) { for (m in node) delete edge[m, n]; delete node[n]; gone = 1; break }
      }
    } while (gone)
    # What only leads to a circle is none.
    do {
      gone = 0
      for (n in node) {
        free = 1
        for (m in node) if ((m, n) in edge) { free = 0; break }
        if (free) { for (m in node) delete edge[n, m]; delete node[n]; gone = 1; break }
      }
    } while (gone)
    for (e in edge) { split(e, a, SUBSEP); print "circle: " a[1] " -> " a[2] " (" edge[e] ")"; bad = 1 }
    for (p in owners) {
      n = split(owners[p], o, " "); short = o[1]; odd = ""
      for (i = 1; i <= n; i++) if (length(o[i]) < length(short)) short = o[i]
      if (p == "sim") short = "simulators"
      for (i = 1; i <= n; i++) if (!inside(o[i], short) && index(odd, " " o[i]) == 0) odd = odd " " o[i]
      if (odd != "") { print "prefix sst_" p "_ of " short " also in" odd; bad = 1 }
    }
    exit bad
  }' >&2 || bad=1

# --- devices --------------------------------------------------------------------------------------------------------
named=$(grep -rniE 'device|gpu|vulkan' pipeline/method --include='*.[ch]' | grep -vE '^pipeline/method/[a-z/]+/device[^/:]*:')
[ -z "$named" ] || fail "only pipeline/method/*/device*.[ch] name devices; move this to them or to the runner:
$named"

# --- headers --------------------------------------------------------------------------------------------------------
headers=$(find $roots -name '*.h' | sort)
exempt() { case $1 in */opencv_*.h|*_dnnl.h|*_tiff.h|*/rtsp_*.h|pipeline/kernels/*|*_tmpl.h) return 0;; esac; return 1; }
# Names that a header declares: functions at the start of a line, and tags that it defines.
functions_of() { sed 's,/\*.*\*/,,' "$1" | grep -oE '^[A-Za-z][A-Za-z0-9_ ]* \**[a-z][a-z0-9_]*\(' | grep -vE '^(typedef|static|return|else|__attribute__)' | grep -oE '[a-z0-9_]+\($' | tr -d '('; }
tags_of() { grep -oE '^(struct|union|enum) [a-z0-9_]+ \{' "$1" | awk '{ print $2 }'; }
includes=$(grep -rnoE '^#include "[^"]+"' $roots --include='*.c' --include='*.h' --include='*.cc' | sed -E 's/:[0-9]+:#include "/ /; s/"$//')
opaque=$(mktemp) && trap 'rm -f "$opaque"' EXIT
grep -hoE '(struct|union|enum) sst_[a-z0-9_]+' $(echo "$headers" | grep -v '_internal\.h$') | awk '{ print $2 }' | sort -u >"$opaque"
for h in $headers; do
  exempt "$h" && continue
  dir=${h%/*} own=${h%/*}/$(basename "${h%/*}")_internal.h
  case $h in *_internal.h) private=1; [ -e "$own" ] || fail "$h: the private header of $dir is called $own";; *) private=0;; esac
  if [ $private = 1 ]; then
    # An opaque type is named by a public header and defined in the private one.
    for n in $(functions_of "$h") $(tags_of "$h"); do
      case $n in sst_*) grep -qx "$n" "$opaque" || fail "$h: $n is private and has sst_";; esac
    done
    echo "$includes" | awk -v h="$h" -v d="$dir" '$2 == h { f = $1; sub(/\/[^\/]*$/, "", f); if (f != d && index(f, d "/") != 1) { print "error: " $1 " includes " h ", which is private"; bad = 1 } } END { exit bad }' >&2 || bad=1
  else
    for n in $(functions_of "$h"); do case $n in sst_*|main) ;; *) fail "$h: $n is public and has no sst_";; esac; done
    # Included by its own folder alone, and not through another public header: private.
    echo "$includes" | awk -v h="$h" -v d="$dir" '$2 == h { f = $1; sub(/\/[^\/]*$/, "", f); n++; if (f != d || $1 ~ /\.h$/) open = 1 } END { exit n && !open }' ||
      fail "$h is included in $dir alone: it belongs into $own"
  fi
done
for h in $headers; do tags_of "$h" | sed "s,$, $h,"; done | sort | awk '$1 == last { print "error: " $1 " is defined in " file " and " $2; bad = 1 } { last = $1; file = $2 } END { exit bad }' >&2 || bad=1

# --- page -----------------------------------------------------------------------------------------------------------
# A class that defines a method twice loses the first one silently.
awk 'FNR == 1 || /^(export )?class / { split("", seen) }
  match($0, /^  (async )?[A-Za-z_]+\(.*\) \{$/) { n = $0; sub(/^  (async )?/, "", n); sub(/\(.*/, "", n)
    if (n !~ /^(if|for|while|switch|catch)$/ && seen[n]++) { print "error: " FILENAME ":" FNR ": " n " is defined twice"; bad = 1 } }
  END { exit bad }' daemon/web/*.js >&2 || bad=1
exit $bad
