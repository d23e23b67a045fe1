/* simulators/devices/faults.h - what can be made to go wrong, by name, while programs run. */
#ifndef SST_SIMULATORS_DEVICES_FAULTS_H
#define SST_SIMULATORS_DEVICES_FAULTS_H

#include "base/base.h"

struct sst_sim_faults; /* opaque; simulator's thread */

/** One fault; 0 is "all well". */
struct sst_sim_fault {
    const char *name; /* "late_ms" */
    double min, max;
    const char *help; /* one line, with the unit and what the value means */
};

/** A kind of devices that has faults. Tables are const and live for ever. */
struct sst_sim_fault_scope {
    const char *name;                   /* "camera", "gpio", "usb" */
    const struct sst_sim_fault *faults; /* [count] */
    int count;
    int instances; /* "camera.3.late_ms", "camera.*.late_ms"; 0: only one, "gpio.busy" */
    /** A value was set, also to what it was. NULL: nobody cares. @return 0, or -errno: value stays as it was. */
    int (*changed)(void *arg, int instance, int fault, double value);
    void *arg;
};

SST_MUST_CHECK int sst_sim_faults_create(struct sst_sim_faults **out);
void sst_sim_faults_destroy(struct sst_sim_faults *f);

/** @return the scope's number for sst_sim_fault_value(), or -ENOMEM. */
SST_MUST_CHECK int sst_sim_faults_add(struct sst_sim_faults *f, const struct sst_sim_fault_scope *scope);

/** Value of fault `fault` of an instance (0 where there is only one). */
double sst_sim_fault_value(const struct sst_sim_faults *f, int scope, int instance, int fault);

/** Set a value from inside (a fault that ended by itself); `changed` is not called. */
void sst_sim_fault_reset(struct sst_sim_faults *f, int scope, int instance, int fault);

/**
 * "camera.3.late_ms=20", "camera.*.eio=0.1", "gpio.busy=1".
 * @param message  out, [size], on failure: one sentence that names the value and the remedy
 * @return 0, -EINVAL (no such name), -ERANGE, or what `changed` returned.
 */
SST_MUST_CHECK int sst_sim_faults_set(struct sst_sim_faults *f, const char *text, char *message, size_t size);

/** All faults with range and help, then the values that are not 0, as text. @return bytes written, NUL left out. */
size_t sst_sim_faults_list(const struct sst_sim_faults *f, char *out, size_t size);

/** Call fn for each value that is not 0. */
void sst_sim_faults_each(const struct sst_sim_faults *f, void (*fn)(void *arg, const char *name, double value),
                         void *arg);

#endif
