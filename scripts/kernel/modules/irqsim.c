/* scripts/kernel/modules/irqsim.c - the kernel's interrupt simulator, which gpio-sim needs, as a module. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <linux/irq.h>
#include <linux/module.h>

/* The only function it calls that modules may not. */
#define irq_to_desc(irq) irq_data_to_desc(irq_get_irq_data(irq))
#include "irq_sim.c"

MODULE_DESCRIPTION("interrupt simulator for gpio-sim");
MODULE_LICENSE("GPL");
