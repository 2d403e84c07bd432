#define WIDTH 8
#define BUILD avx512
#define BUILD_NAME "avx512"
#if DUALDRIVE_KERNELS_X86
#include "kernels.ipp"
#endif
