# Sourced by tests/system/*.sh: finds the program, works in a folder that goes at the end, and judges refusals.
# Afterwards: $root (the repository), $sst, $tmp (the current folder), $failed.
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1
root=$PWD
sst=$PWD/${SST_BUILD:-build}/sst
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
cd "$tmp" || exit 1
failed=0

fail() { echo "FAIL: $*"; failed=1; }

# judge CODE WORDS RC WHAT: of a run whose standard error is in ./err; ./bad* must not exist afterwards
judge() {
  [ "$3" -eq "$1" ] || fail "$4: exit $3, not $1: $(head -c 300 err)"
  [ "$(wc -l <err)" -eq 1 ] || fail "$4: not one line: $(head -c 600 err)"
  case $(head -c 12 err) in "sst: error: ") ;; *) fail "$4: not an error: $(head -c 300 err)";; esac
  grep -qi -- "$2" err || fail "$4: no '$2' in: $(head -c 300 err)"
  [ -z "$(compgen -G 'bad*')" ] || fail "$4: left $(echo bad*)"
  [ -z "$(find . -name '*.tmp-*')" ] || fail "$4: left $(find . -name '*.tmp-*')"
  rm -rf bad*
}

# want CODE WORDS ARGS...: exit code, one line of error with these words, no output
want() {
  local code=$1 words=$2
  shift 2
  "$sst" "$@" >/dev/null 2>err
  judge "$code" "$words" $? "sst $*"
}
