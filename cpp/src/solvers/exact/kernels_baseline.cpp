#define WIDTH 2
#define BUILD baseline
#define BUILD_NAME "baseline"
#include "kernels.ipp"
