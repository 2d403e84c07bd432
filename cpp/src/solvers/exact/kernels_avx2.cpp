#define WIDTH 4
#define BUILD avx2
#define BUILD_NAME "avx2"
#if DUALDRIVE_KERNELS_X86
#include "kernels.ipp"
#endif
