#!/usr/bin/env bash
# Version of the release: the tree names one, the programs report it, and each file that names another one is named.
. "$(dirname "$0")/../lib.sh"
"$root/scripts/release_check.sh" 2>err || fail "this tree: $(cat err)"
version=$(sed -nE 's/^VERSION := (.*)/\1/p' "$root/Makefile")
"$sst" version | grep -qF "sst $version" || fail "sst version: $("$sst" version | head -n 1), not $version"

files='CHANGELOG.md README.md docs/man/sst.1 docs/man/sstd.8 docs/man/sstd.yaml.5 python/pyproject.toml python/sst/__init__.py'
(cd "$root" && cp --parents Makefile $files "$tmp")
"$root/scripts/release_check.sh" "$tmp" 2>err || fail "a copy: $(cat err)"
for file in $files; do
  sed -i "s/${version//./\\.}/9.8.7/" "$file"
  "$root/scripts/release_check.sh" "$tmp" 2>err && fail "$file: another version passes"
  grep -q "^error: $file: .*9\.8\.7" err || fail "$file: $(cat err)"
  cp "$root/$file" "$file"
done
sed -i "s/^\(## ${version//./\\.}\) - .*/\1/" CHANGELOG.md
"$root/scripts/release_check.sh" "$tmp" 2>err && fail "a release without a date passes"
grep -q "^error: CHANGELOG.md: no heading" err || fail "without a date: $(cat err)"
exit $failed
