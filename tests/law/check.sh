#!/usr/bin/env bash
# Evidence judged by others: reuse on the tree, the bill of materials against CycloneDX's own schema (npm). Downloads both; needs root for Debian's
# packages where they are missing, node's npm, and the network.
set -u
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
for p in npm git; do command -v $p >/dev/null || skip "$p is not installed"; done
if ! command -v reuse >/dev/null || ! /usr/bin/python3 -c 'import jsonschema' 2>/dev/null; then
  [ "$(id -u)" -eq 0 ] || skip "reuse and python3-jsonschema are not installed, and only root installs them"
  apt-get -qq install -y --no-install-recommends reuse python3-jsonschema >apt.log 2>&1 || skip "apt: $(tail -n 1 apt.log)"
fi
reuse --root "$root" lint >reuse.log 2>&1 && tail -n 1 reuse.log || fail "reuse lint: $(grep -A5 '^# SUMMARY' reuse.log; head -n 12 reuse.log)"

npm pack --silent @cyclonedx/cyclonedx-library@10.3.0 >npm.log 2>&1 && tar xzf cyclonedx-*.tgz || skip "npm: $(tail -n 1 npm.log)"
"$root/scripts/evidence.py" sbom --build "$build" -o bom.json || fail "sbom"
/usr/bin/python3 - <<'PY' || fail "the bill of materials against the schema"
import glob, json, os
import jsonschema
schemas = {os.path.basename(f).replace(".SNAPSHOT", ""): json.load(open(f)) for f in glob.glob("package/res/schema/*.schema.json")}
store = {f"http://cyclonedx.org/schema/{n}": s for n, s in schemas.items()}
store.update({f"http://cyclonedx.org/schema/{n.replace('.schema', '.SNAPSHOT.schema')}": s for n, s in schemas.items()})
schema = schemas["bom-1.6.schema.json"]
judge = jsonschema.Draft7Validator(schema, resolver=jsonschema.RefResolver.from_schema(schema, store=store))
bom = json.load(open("bom.json"))
faults = [f"{e.json_path}: {e.message[:200]}" for e in judge.iter_errors(bom)]
print("\n".join(faults) or f"bill of materials: {len(bom['components'])} components, valid by CycloneDX's schema 1.6")
bom["components"][0]["type"] = "none"
assert any(True for _ in judge.iter_errors(bom)), "the schema accepts anything"
raise SystemExit(bool(faults))
PY
exit $failed
