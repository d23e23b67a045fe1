#!/usr/bin/env bash
# Stand-ins for nouns in comments: counted in changed lines against a base, in all of a clone of one commit and of an archive.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
mkdir scripts && cp "$root/scripts/check_words.py" scripts/
export GIT_CONFIG_GLOBAL=/dev/null GIT_CONFIG_SYSTEM=/dev/null GIT_AUTHOR_NAME=t GIT_AUTHOR_EMAIL=t GIT_COMMITTER_NAME=t GIT_COMMITTER_EMAIL=t

# words N: a comment of that many words that name things
words() { yes noun | head -n "$1" | tr '\n' ' ' | sed 's,.*,/* & */\n,'; }
# checks RC WORDS WHAT: exit code, and what is said
checks() {
  scripts/check_words.py >out 2>&1
  local rc=$?
  [ $rc -eq "$1" ] || fail "$3: exit $rc: $(cat out)"
  grep -q "$2" out || fail "$3: $(cat out)"
}

words 2000 >a.c
checks 0 'the tree: 0 stand-ins' 'an archive'
git init -q -b main . && git add a.c && git commit -qm one
checks 0 'the tree: 0 stand-ins' 'a single commit'
grep -q changed out && fail "a single commit has a base"
git clone -q --depth 1 "file://$tmp" shallow && cp -r scripts shallow/ && (cd shallow && scripts/check_words.py >../out 2>&1) || fail "a shallow clone: $(cat out)"
rm -rf shallow

{ words 300; echo '/* What is left of those. Who knows? likewise, of that */'; } >>a.c
git commit -qam two
checks 1 'error: changed since' 'a commit on main'
grep -q 'changed since .*: 4 stand-ins' out || fail "four, without the question: $(cat out)"
scripts/check_words.py --list 2>&1 | grep -q '^a.c:3: What is left of those' || fail "--list"
git checkout -qb side && words 100 >b.c && git add b.c && git commit -qm three
checks 0 'changed since .*: 0 stand-ins' 'a branch of clean comments'
printf '// %s\n' 'whose is it' 'who goes there' 'those that stay' 'what remains' >c.c
git add c.c
checks 1 'error: changed since' 'a change that is not committed'
printf 'const char *s = "what who whose those"; int c = %s;\n' "'\"'" >c.c
checks 0 'changed since .*: 0 stand-ins' 'strings are no comments'
for i in $(seq 30); do echo '/* what */'; done >c.c
git add c.c && git commit -qm four
rm -rf .git
checks 1 'error: the tree' 'an archive above the ceiling'
exit $failed
