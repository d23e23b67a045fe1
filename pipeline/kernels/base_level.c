/* The templates for the compiler's default target: runs on any CPU of the architecture. */
#include <math.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"

#define KERNEL(name) name##_base
#include "pipeline/kernels/templates.h"
