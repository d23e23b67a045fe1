#!/usr/bin/env bash
# The calibration report of several made-up solutions, drawn by a browser: tests/page/test_report.py.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
tool=$root/${SST_BUILD:-build}/tests/tools/calib_report
[ -x "$tool" ] || skip "$tool is not built"
timeout 600 /usr/bin/python3 "$root/tests/page/test_report.py" "$tool" && echo "calibration report: ok"
