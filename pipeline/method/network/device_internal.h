/* pipeline/method/network/device_internal.h - plans of networks on a device. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_DEVICE_INTERNAL_H
#define SST_PIPELINE_METHOD_NETWORK_DEVICE_INTERNAL_H

#include "pipeline/method/network/network_internal.h"

/* --- device_plan.c: a plan on a device; under its lock --- */

struct net_device_plan;

#define NET_DEVICE_WHY 128 /* bytes of a reason */

/**
 * Upload the weights and reserve memory for the activations.
 *
 * @param cfg  borrowed during the call
 * @param why  out, without a plan: a layer has no shader, or memory lacks
 * @return NULL: there is none; errors of the device are noted in r
 */
struct net_device_plan *net_device_plan_create(struct sst_run *r, const struct net_plan_config *cfg,
                                               char why[NET_DEVICE_WHY]);
void net_device_plan_destroy(struct net_device_plan *p);

/** Memory on the device: of the weights; of the activations, which plans share. */
void net_device_plan_bytes(const struct net_device_plan *p, size_t *weights, size_t *activations);

/** Shader of convolutions on 8 bits. NULL: there are none */
const char *net_device_plan_conv8(const struct net_device_plan *p);

/** True where the result is in bytes, as of net_plan_run_s8(); else it is in floats. */
bool net_device_plan_has_s8(const struct net_device_plan *p);

/** Run once, without job->keeper on a dummy device, which computes nothing. */
void net_device_plan_run(struct net_device_plan *p, struct sst_run *r, struct net_job *job);

#endif
