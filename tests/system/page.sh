#!/usr/bin/env bash
# The page in a real browser, against a service that only pretends (tests/page/fake.py), with real pictures.
set -u
. "$(dirname "$0")/../lib.sh"

/usr/bin/python3 -c 'import PIL' 2>/dev/null || { echo "skipped: needs python3-pil"; exit 77; }
/usr/bin/python3 -c "import sys; sys.path.insert(0, '$root/tests/page'); import cdp; sys.exit(cdp.program() is None)" ||
  { echo "skipped: needs chromium"; exit 77; }

"$root/tests/page/pictures.sh" "$sst" pedestrian 160x120 8 pictures 2>err || fail "pictures: $(head -c 300 err)"
timeout 600 /usr/bin/python3 "$root/tests/page/test_page.py" pictures || fail "the page"

[ "$failed" -eq 0 ] && echo "all passed"
exit "$failed"
