#!/usr/bin/env bash
# sst doctor --law: each fault of retention, access and encryption is found, with its key; a configuration without them has none.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"

# item FOLDER/NAME WHY DAYS: something stored that ended so long ago
item() {
  mkdir -p "store/$1"
  printf '{"format":"sst-storage","version":1,"order":1,"why":"%s","finished":true,"from_ns":1,"to_ns":%d,"made_ns":1,"sets":1,"gone":0,"bytes":1}' \
    "$2" $((($(date +%s) - $3 * 86400) * 1000000000)) >"store/$1/storage.json"
}
# law: runs it; $rc is its exit status, law.json its answer
law() { "$sst" doctor --law --json --config sstd.yaml >law.json 2>err; rc=$?; [ -s law.json ] || fail "no answer: $(cat err)"; }
# found LEVEL KEY WORDS: a finding
found() {
  /usr/bin/python3 - "$@" <<'PY' || fail "no $1 of $2 with '$3': $(cat law.json)"
import json, sys
level, key, words = sys.argv[1:]
sys.exit(not any(f["level"] == level and f.get("key", "") == key and words in f["text"] for f in json.load(open("law.json"))["findings"]))
PY
}

mkdir -m 755 store
cat >sstd.yaml <<YAML
array: {rows: 2, cols: 2}
web: {address: 0.0.0.0, insecure: true, token_file: $tmp/token}
rtsp: {enabled: true, address: 0.0.0.0, insecure: true}
mqtt: {enabled: true, host: broker.example, insecure: true}
storage: {dir: $tmp/store, mode: continuous, reduced: view, visits_days: 3}
proxy: {addresses: [127.0.0.1], rights: [control]}
privacy: {masks: [{name: a, x0: 0.5, near_px: 3}]}
live: {calibration: $tmp/none.yaml}
YAML
echo t >token; chmod 644 token
item recordings/old continuous 40
item recordings/asked "on demand" 3
mkdir -p store/visits/2020-01-05 store/visits/2020-01-06
touch store/visits/2020-01-06/x-keep
"$sst" token add guard --rights view,control --config sstd.yaml >/dev/null 2>err || fail "token: $(cat err)"
law
[ $rc -eq 3 ] || fail "with problems: exit $rc"
found PROBLEM storage.max_age_days "have no limit of age"
found PROBLEM storage.reduced_max_age_days "have no limit of age"
found WARNING storage.by_hand_max_age_days "have no limit of age"
found WARNING storage.max_age_days "(old) ended 40.0 days ago"
found WARNING storage.by_hand_max_age_days "(asked) ended 3.0 days ago"
found PROBLEM storage.visits_days "2020-01-05"
found WARNING storage.dir "mode 0755"
found PROBLEM web.token_file "mode 0644"
found WARNING web.token_file "named tokens: 1, with control: 1, expired: 0; without an end: guard"
found WARNING proxy.rights "control"
found PROBLEM web.insecure "unencrypted"
found PROBLEM rtsp.address "needs no password"
found PROBLEM mqtt.ca_file "unencrypted"
found PROBLEM privacy.masks "none.yaml"
found NOTE "" "the sign"
"$sst" doctor --law --config sstd.yaml 2>/dev/null | grep -q '^PROBLEM  network .*\[web.insecure\]$' || fail "text"

# A host's name may begin like an address of this machine.
sed 's/host: broker.example/host: 127.example.org/' sstd.yaml >named.yaml
"$sst" doctor --law --config named.yaml 2>/dev/null | grep -q '127.example.org unencrypted' || fail "a broker's name is taken for this host"

# All of it put right.
chmod 600 token
chmod 750 store
rm -rf store/visits/2020-01-05 token.named
item recordings/old continuous 2
"$sst" token add guard --rights view --expires 30d --config sstd.yaml >/dev/null 2>err || fail "token: $(cat err)"
cat >sstd.yaml <<YAML
array: {rows: 2, cols: 2}
site: yard
web: {token_file: $tmp/token}
storage: {dir: $tmp/store, mode: continuous, max_age_days: 3, by_hand_max_age_days: 14, visits_days: 3}
privacy: {masks: [{name: a, row: 0, col: 0, x0: 0.5}]}
YAML
law
[ $rc -eq 0 ] || fail "without problems: exit $rc"
grep -q '"problems": 0, *$' law.json && grep -q '"warnings": 0, *$' law.json || fail "put right: $(grep -B1 -A3 'WARNING\|PROBLEM' law.json)"
# A recording that should be gone.
item recordings/old continuous 5
law
found PROBLEM storage.max_age_days "should be gone after 3"
want 3 "nowhere.yaml" doctor --law --config nowhere.yaml
exit $failed
