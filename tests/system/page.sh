#!/usr/bin/env bash
# The page in a real browser, against a service that only pretends (tests/page/fake.py), with real pictures.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"

/usr/bin/python3 -c 'import PIL' 2>/dev/null || skip "python3-pil is not installed"
/usr/bin/python3 -c "import sys; sys.path.insert(0, '$root/tests/page'); import cdp; sys.exit(cdp.program() is None)" ||
  skip "chromium is not installed"

"$root/tests/page/pictures.sh" "$sst" pedestrian 160x120 8 pictures 2>err || fail "pictures: $(head -c 300 err)"
timeout 600 /usr/bin/python3 "$root/tests/page/test_page.py" pictures || fail "the page"

[ "$failed" -eq 0 ] && echo "all passed"
exit "$failed"
