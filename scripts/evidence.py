#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Bill of materials and provenance of a build, and checks of both: the same bytes for the same build.

evidence.py sbom --build DIR -o FILE                  CycloneDX 1.6: programs, libraries that they link with or load, networks, page
evidence.py provenance --build DIR -o FILE FILES...   SLSA provenance (build level 1) of files, as an in-toto statement
evidence.py check FILE...                             is each well-formed? Exit status 1 with a sentence for each fault
"""
import argparse
import datetime
import hashlib
import json
import os
import platform
import re
import subprocess
import sys
import uuid

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LICENCE = [{"license": {"id": "Apache-2.0"}}]
# A name in the text of a program that it may load at run time; names that it links with are left out.
LOADED = re.compile(rb"\0(lib[A-Za-z0-9_+-]+\.so\.[0-9][0-9.]*)\0")
STATEMENT, PROVENANCE = "https://in-toto.io/Statement/v1", "https://slsa.dev/provenance/v1"
BUILD_TYPE = "urn:sst:make-release:1"  # docs/design/release.md


def run(*command):
    """Output of a command; "" where it fails."""
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def run_some(*command):
    """Output of a command that fails where only some of what it is asked for exists."""
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout


def version():
    with open(os.path.join(ROOT, "Makefile"), encoding="utf-8") as f:
        return re.search(r"^VERSION := (.*)$", f.read(), re.M).group(1)


def built_at():
    """Time of the source, not of the clock: SOURCE_DATE_EPOCH, else the commit's."""
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH") or run("git", "log", "-1", "--format=%ct") or 0)
    return datetime.datetime.fromtimestamp(seconds, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")


def sha256(path):
    digest = hashlib.sha256()
    with open(path, "rb") as f:
        for part in iter(lambda: f.read(1 << 20), b""):
            digest.update(part)
    return digest.hexdigest()


def hashes(path):
    return [{"alg": "SHA-256", "content": sha256(path)}]


def is_elf(path):
    with open(path, "rb") as f:
        return f.read(4) == b"\x7fELF"


def programs(build):
    """Programs and plugins of a build: what make install installs."""
    names = [n for n in sorted(os.listdir(build)) if re.fullmatch(r"sst|sstd|sst-[a-z]+|libsst-[a-z-]+\.so(\.[0-9]+)*", n)]
    found = [n for n in names if os.path.isfile(os.path.join(build, n)) and is_elf(os.path.join(build, n))]
    if "sst" not in found:
        sys.exit(f"error: {build} has no program sst; run make first")
    return found


def needed(path):
    """Libraries that a program links with, and ones that it may load, by their names."""
    out = run("readelf", "-dW", path)
    linked = set(re.findall(r"\(NEEDED\).*\[([^\]]+)\]", out))
    with open(path, "rb") as f:
        loaded = {m.decode() for m in LOADED.findall(f.read())}
    return linked, loaded - linked


def library_files():
    """Files of libraries by their names, as the dynamic linker finds them."""
    files = {}
    for line in run("/sbin/ldconfig", "-p").splitlines():
        found = re.match(r"\s*(\S+) \(([^)]*)\) => (\S+)", line)
        if found and found.group(1) not in files:
            files[found.group(1)] = found.group(3)
    return files


def spellings(path):
    """A file's names: packages may have it below /lib or /usr/lib, by its name or that of the file behind a link."""
    real = os.path.realpath(path)
    return list(dict.fromkeys(f(p) for p in (path, real) for f in (str, lambda p: re.sub(r"^/lib", "/usr/lib", p), lambda p: re.sub(r"^/usr/lib", "/lib", p))))


def packages_of(paths):
    """Debian packages that have files: {path: (name, version, architecture)}."""
    names = {s: path for path in paths for s in spellings(path)}
    done = subprocess.run(["dpkg-query", "-S", *names], capture_output=True, text=True, check=False) if names else None
    owners = {}
    for line in done.stdout.splitlines() if done else []:
        owner, _, path = line.partition(": ")
        if path in names:
            owners.setdefault(names[path], owner.split(",")[0])
    facts = {}
    asked = sorted(set(owners.values()))
    for line in run("dpkg-query", "-W", "-f", "${binary:Package}\t${Package}\t${Version}\t${Architecture}\n", *asked).splitlines() if asked else []:
        full, name, of, arch = line.split("\t")
        for key in (full, name, f"{name}:{arch}"):
            facts[key] = (name, of, arch)
    return {path: facts[owner] for path, owner in owners.items() if owner in facts}


def distribution():
    with open("/etc/os-release", encoding="utf-8") as f:
        facts = dict(line.strip().split("=", 1) for line in f if "=" in line)
    return facts.get("ID", "linux").strip('"'), facts.get("VERSION_ID", "0").strip('"')


def purl(vendor, name, of, rest=""):
    return f"pkg:deb/{vendor}/{name}@{of.replace(':', '%3A').replace('+', '%2B')}{rest}"


def library(name, path, package, required):
    part = {"type": "library", "bom-ref": f"library:{name}", "name": name, "scope": "required" if required else "optional"}
    if package:
        vendor, release = distribution()
        part.update(version=package[1], purl=purl(vendor, package[0], package[1], f"?arch={package[2]}&distro={vendor}-{release}"))
        part["properties"] = [{"name": "sst:package", "value": package[0]}]
    elif path:
        part["hashes"] = hashes(path)
    return part


def networks():
    with open(os.path.join(ROOT, "models/manifest.json"), encoding="utf-8") as f:
        models = json.load(f)["models"]
    return [{"type": "machine-learning-model", "bom-ref": f"model:{m['file']}", "name": m["file"], "description": m["description"],
             "hashes": hashes(os.path.join(ROOT, "models", m["file"])), "licenses": [{"license": {"name": m["licence"]}}]} for m in models]


def embedded():
    """Files of the page, and shaders, which are compiled into sstd and sst."""
    out = []
    for folder, ending, why in (("daemon/web", "", "page"), ("pipeline/kernels", ".comp", "shader")):
        for name in sorted(os.listdir(os.path.join(ROOT, folder))):
            path = os.path.join(ROOT, folder, name)
            if os.path.isfile(path) and name.endswith(ending):
                out.append({"type": "file", "bom-ref": f"embedded:{folder}/{name}", "name": f"{folder}/{name}", "hashes": hashes(path),
                            "licenses": LICENCE, "properties": [{"name": "sst:embedded", "value": why}]})
    return out


def sbom(build):
    ref = f"pkg:generic/sst@{version()}"
    files, parts, links, libraries = library_files(), [], [], {}
    for name in programs(build):
        path = os.path.join(build, name)
        linked, loaded = needed(path)
        for n in linked | loaded:
            libraries[n] = libraries.get(n, False) or n in linked
        parts.append({"type": "file", "bom-ref": f"program:{name}", "name": name, "hashes": hashes(path), "licenses": LICENCE})
        links.append({"ref": f"program:{name}", "dependsOn": [f"library:{n}" for n in sorted(linked | loaded)]})
    own = {p["name"] for p in parts}
    others = [n for n in sorted(libraries) if n not in own]
    packages = packages_of([files[n] for n in others if n in files])
    parts += [library(n, files.get(n), packages.get(files.get(n)), libraries[n]) for n in others]
    for link in links:
        link["dependsOn"] = [r if r[8:] not in own else f"program:{r[8:]}" for r in link["dependsOn"]]
    parts += networks() + embedded()
    links.append({"ref": ref, "dependsOn": [p["bom-ref"] for p in parts if not p["bom-ref"].startswith("library:")]})
    bom = {"$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json", "bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1,
           "metadata": {"timestamp": built_at(), "lifecycles": [{"phase": "build"}],
                        "tools": {"components": [{"type": "application", "name": "scripts/evidence.py", "version": version()}]},
                        "component": {"type": "application", "bom-ref": ref, "name": "sst", "version": version(), "purl": ref, "licenses": LICENCE,
                                      "properties": [{"name": "sst:vendored", "value": "none"}, {"name": "sst:commit", "value": run("git", "rev-parse", "HEAD") or "unknown"}]}},
           "components": parts, "dependencies": sorted(links, key=lambda d: d["ref"])}
    bom["serialNumber"] = f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(bom, sort_keys=True))}"
    return bom


def provenance(build, files):
    """Level 1 asks that provenance exists and says who built what from what, and how; it is neither signed by a service nor hard to forge."""
    commit, tag = run("git", "rev-parse", "HEAD"), run("git", "describe", "--tags", "--exact-match")
    compiler = run(os.environ.get("CC", "gcc"), "--version").splitlines()
    source = os.environ.get("SOURCE_URI") or run("git", "remote", "get-url", "origin") or "urn:sst:source"
    with open(os.path.join(ROOT, "scripts/packages.txt"), encoding="utf-8") as f:
        wanted = [line.split("#")[0].strip() for line in f]
    packages = []
    for line in run_some("dpkg-query", "-W", "-f", "${Package}\t${Version}\t${db:Status-Abbrev}\n", *sorted({w for w in wanted if w})).splitlines():
        name, of, status = line.split("\t")
        if status.startswith("ii"):
            packages.append({"name": name, "uri": purl(distribution()[0], name, of)})
    return {"_type": STATEMENT,
            "subject": sorted(({"name": os.path.basename(f), "digest": {"sha256": sha256(f)}} for f in files), key=lambda s: s["name"]),
            "predicateType": PROVENANCE,
            "predicate": {
                "buildDefinition": {
                    "buildType": BUILD_TYPE,
                    "externalParameters": {"source": f"git+{source}" if "://" in source else source, "version": version(), "tag": tag, "command": "make release"},
                    "internalParameters": {"compiler": compiler[0] if compiler else "unknown", "build": os.path.basename(os.path.abspath(build))},
                    "resolvedDependencies": [{"uri": f"git+{source}" if "://" in source else source, "digest": {"gitCommit": commit}}] + packages},
                "runDetails": {
                    "builder": {"id": os.environ.get("BUILDER_ID") or "urn:sst:builder:by-hand", "version": {"machine": platform.machine()}},
                    "metadata": {"invocationId": f"{version()}@{commit}", "startedOn": built_at()}}}}


# --- checks: members, types and references that the formats demand, as far as they are used here ---

def check_sbom(bom, say):
    types = {"application", "file", "library", "machine-learning-model"}
    if bom.get("bomFormat") != "CycloneDX" or bom.get("specVersion") != "1.6" or not isinstance(bom.get("version"), int):
        say("is no CycloneDX 1.6")
    if not re.fullmatch(r"urn:uuid:[0-9a-f]{8}-[0-9a-f]{4}-[1-5][0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}", str(bom.get("serialNumber"))):
        say("serialNumber is no UUID")
    unknown = set(bom) - {"$schema", "bomFormat", "specVersion", "serialNumber", "version", "metadata", "components", "dependencies"}
    if unknown:
        say(f"has unknown members {sorted(unknown)}")
    main = bom.get("metadata", {}).get("component", {})
    if not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", str(bom.get("metadata", {}).get("timestamp"))):
        say("metadata.timestamp is no time")
    refs = {main.get("bom-ref")}
    for part in bom.get("components", []):
        ref = part.get("bom-ref")
        if not ref or ref in refs:
            say(f"bom-ref {ref} is missing or twice")
        refs.add(ref)
        if part.get("type") not in types or not part.get("name"):
            say(f"{ref} has no type or name that CycloneDX has")
        if part["type"] != "library" and not part.get("hashes"):
            say(f"{ref} has no hash")
        for h in part.get("hashes", []):
            if h.get("alg") != "SHA-256" or not re.fullmatch(r"[0-9a-f]{64}", str(h.get("content"))):
                say(f"{ref} has a hash that is none")
        if part["type"] == "library" and not part.get("version") and not part.get("hashes"):
            say(f"{ref} has neither version nor hash: the library is not installed")
        if part.get("scope", "required") not in ("required", "optional", "excluded"):
            say(f"{ref} has the scope {part['scope']}")
        if "purl" in part and not re.fullmatch(r"pkg:[a-z]+/\S+@\S+", part["purl"]):
            say(f"{ref} has a purl that is none")
        for licence in part.get("licenses", []):
            if len(set(licence.get("license", {})) & {"id", "name"}) != 1:
                say(f"{ref} has a license without id or name")
    if not main.get("name") or not main.get("version"):
        say("metadata.component has no name or version")
    for link in bom.get("dependencies", []):
        for ref in [link.get("ref")] + link.get("dependsOn", []):
            if ref not in refs:
                say(f"dependencies name {ref}, which is no component")


def check_provenance(statement, say):
    predicate = statement.get("predicate", {})
    build, details = predicate.get("buildDefinition", {}), predicate.get("runDetails", {})
    if statement.get("_type") != STATEMENT or statement.get("predicateType") != PROVENANCE:
        say("is no SLSA provenance")
    if not statement.get("subject"):
        say("has no subject")
    for s in statement.get("subject", []):
        if not s.get("name") or not re.fullmatch(r"[0-9a-f]{64}", str(s.get("digest", {}).get("sha256"))):
            say(f"subject {s.get('name')} has no sha256")
    if ":" not in str(build.get("buildType")) or not isinstance(build.get("externalParameters"), dict):
        say("buildDefinition has no buildType or externalParameters")
    if ":" not in str(details.get("builder", {}).get("id")):
        say("runDetails.builder has no id")
    if not re.fullmatch(r"[0-9a-f]{40}", str((build.get("resolvedDependencies") or [{}])[0].get("digest", {}).get("gitCommit"))):
        say("resolvedDependencies do not begin with the commit")


def check(paths):
    faults = []
    for path in paths:
        with open(path, encoding="utf-8") as f:
            what = json.load(f)
        say = lambda text, path=path: faults.append(f"error: {path}: {text}")
        (check_sbom if "bomFormat" in what else check_provenance)(what, say)
    print("\n".join(faults), end="\n" if faults else "", file=sys.stderr)
    return 1 if faults else 0


def write(path, what):
    with open(path + ".tmp", "w", encoding="utf-8") as f:
        json.dump(what, f, indent=1, sort_keys=True, ensure_ascii=False)
        f.write("\n")
    os.replace(path + ".tmp", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("sbom", "provenance", "check"))
    parser.add_argument("files", nargs="*")
    parser.add_argument("--build", default=os.path.join(ROOT, "build"))
    parser.add_argument("-o", "--output")
    args = parser.parse_intermixed_args()
    if args.what == "check":
        return check(args.files)
    if not args.output:
        parser.error("-o names the file to write")
    write(args.output, sbom(args.build) if args.what == "sbom" else provenance(args.build, args.files))
    return check([args.output])


if __name__ == "__main__":
    sys.exit(main())
