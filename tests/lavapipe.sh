# Sourced after tests/lib.sh by scripts that run on Mesa's software device, and on no other: without Vulkan they are skipped, without
# the device they fail, for shaders that nobody runs are not tested.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
need vulkan
driver=$(compgen -G '/usr/share/vulkan/icd.d/lvp_icd*.json' | head -n 1)
[ -n "$driver" ] || { fail "no lavapipe: install mesa-vulkan-drivers"; exit 1; }
export VK_DRIVER_FILES=$driver VK_ICD_FILENAMES=$driver

# Judged by Khronos' validation layers where they are installed.
validate() { [ ! -e /usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json ] || export SST_GPU_VALIDATE=1; }

# device FILE CONDITION: of its `device` d
device() { python3 -c 'import json, sys; d = json.load(open(sys.argv[1]))["device"]; assert eval(sys.argv[2]), d' "$1" "$2" || fail "$1: not $2"; }
