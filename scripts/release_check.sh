#!/usr/bin/env bash
# Version of the release: Makefile, CHANGELOG, README, man pages and the example of the API name one version, and so does a tag of this
# commit. release_check.sh [FOLDER]   each difference is a sentence; exit status 1 if there is one.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
cd "${1:-$(dirname "$0")/..}" || exit 1
bad=0
fail() { echo "error: $*" >&2; bad=1; }

version=$(sed -nE 's/^VERSION := ([0-9]+\.[0-9]+\.[0-9]+)$/\1/p' Makefile)
[ -n "$version" ] || { fail "Makefile: no line \`VERSION := N.N.N\`"; exit 1; }

# names FILE WHAT PATTERN: the first match in the file, \1 of it, is the version
names() {
  local found
  found=$(sed -nE "s/$3/\\1/p" "$1" 2>/dev/null | head -n 1)
  [ "$found" = "$version" ] || fail "$1: $2 names ${found:-no version}; the Makefile has $version"
}

names CHANGELOG.md "the newest release" '^## ([0-9]+\.[0-9]+\.[0-9]+)( .*)?$'
grep -qE "^## $version - [0-9]{4}-[0-9]{2}-[0-9]{2}\$" CHANGELOG.md || fail "CHANGELOG.md: no heading \`## $version - YYYY-MM-DD\`"
names README.md "the status" '^Version ([0-9]+\.[0-9]+\.[0-9]+)\..*'
names docs/man/sst.1 "the title" '^\.TH SST .*"sst ([^"]*)".*'
names docs/man/sstd.8 "the title" '^\.TH SSTD .*"sst ([^"]*)".*'
names docs/man/sstd.yaml.5 "the title" '^\.TH SSTD\.YAML .*"sst ([^"]*)".*'
names python/pyproject.toml "the package" '^version = "([^"]*)".*'
names python/sst/__init__.py "the package" '^__version__ = "([^"]*)".*'
names debian/changelog "the newest entry" '^sst \(([^)]*)\) .*'
for page in sst-sim.1 sst-rtsp.8 sst-mqtt.8 sst-onvif.8; do names docs/man/$page "the title" '^\.TH SST.*"sst ([^"]*)".*'; done
tag=$(git tag --points-at HEAD 2>/dev/null | grep -E '^v[0-9]' | head -n 1)
[ -z "$tag" ] || [ "$tag" = "v$version" ] || fail "this commit has the tag $tag; the Makefile has $version"
exit $bad
