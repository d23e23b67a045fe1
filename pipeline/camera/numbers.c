#include "pipeline/camera/numbers.h"

#include <math.h>

bool sst_numbers_solve_definite(double *a, double *b, int n)
{
    for (int j = 0; j < n; j++) {
        const double before = a[j * n + j];

        for (int i = j; i < n; i++) {
            double sum = a[i * n + j];

            for (int k = 0; k < j; k++)
                sum -= a[i * n + k] * a[j * n + k];
            if (i > j) {
                a[i * n + j] = sum / a[j * n + j];
            } else {
                if (!(sum > 1e-13 * before) || !(sum > 1e-280))
                    return false;
                a[j * n + j] = sqrt(sum);
            }
        }
    }
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++)
            b[i] -= a[i * n + k] * b[k];
        b[i] /= a[i * n + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            b[i] -= a[k * n + i] * b[k];
        b[i] /= a[i * n + i];
    }
    return true;
}
