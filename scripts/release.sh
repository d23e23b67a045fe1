#!/usr/bin/env bash
# A release in build/release: source archive, bill of materials, provenance, hashes, and a tag where a key is configured
# (docs/design/release.md). release.sh [BUILD]   exit status 1 with a sentence where it cannot be made; nothing is left then.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
fail() { echo "error: $*" >&2; exit 1; }

scripts/release_check.sh || fail "the tree names more than one version"
version=$(sed -nE 's/^VERSION := (.*)$/\1/p' Makefile)
git rev-parse --git-dir >/dev/null 2>&1 || fail "a release is made of a git repository, not of an unpacked archive"
[ -z "$(git status --porcelain --untracked-files=no)" ] || fail "there are changes that are not committed: commit or stash them"
out=$build/release
rm -rf "$out" "$out.new"
mkdir -p "$out.new"
trap 'rm -rf "$out.new"' EXIT
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}

# The same bytes on every machine: times of the commit, no user, no time in gzip's header.
git -c tar.umask=0022 archive --format=tar --prefix="sst-$version/" HEAD | gzip -6n >"$out.new/sst-$version.tar.gz"
scripts/evidence.py sbom --build "$build" -o "$out.new/sst-$version.cdx.json"
scripts/evidence.py provenance --build "$build" -o "$out.new/sst-$version.provenance.json" "$out.new"/sst-"$version".*
(cd "$out.new" && sha256sum -- * >SHA256SUMS)
mv "$out.new" "$out"
trap - EXIT

tag=v$version
if git rev-parse -q --verify "refs/tags/$tag" >/dev/null; then
  [ "$(git rev-parse "$tag^{commit}")" = "$(git rev-parse HEAD)" ] || fail "the tag $tag exists on another commit; set VERSION in the Makefile"
  echo "the tag $tag is there already"
elif git config user.signingkey >/dev/null; then
  { echo "sst $version"; echo; cat "$out/SHA256SUMS"; } | git tag -s -F - "$tag" || fail "the tag $tag could not be signed; see git config user.signingkey"
  echo "signed tag $tag, with the hashes of the files; push it with: git push origin $tag"
else
  echo "no tag was made: no signing key is configured (git config user.signingkey KEY, then make release again)"
fi
ls -l "$out" | awk 'NR > 1 { print $5, $9 }'
