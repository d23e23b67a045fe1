// Dot products of four signed bytes: OpSDot of SPV_KHR_integer_dot_product, which glslang 12 does not know by name.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

// format 0: four bytes in a word
spirv_instruction(extensions = ["SPV_KHR_integer_dot_product"], capabilities = [6018, 6019], id = 4450)
int signed_dot(uint a, uint b, spirv_literal int format);

int dot4(uint a, uint b)
{
    return signed_dot(a, b, 0);
}
